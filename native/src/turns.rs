//! Joint angles on whole turns: `postproc.motion.branches`, `postproc.robot.inverse`.

use std::f64::consts::{PI, TAU};

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::rows::{array, each, row, rows, same_length, Six, Three};

const AXES: [usize; 3] = [3, 5, 2]; // of T1, T2, T3
const OTHER: f64 = 1.0; // [rad] more than rounding of a turn

/// Take whole turns away, 0 <= x < 2 pi.
fn within_a_turn(x: f64) -> f64 {
    match (0.0..TAU).contains(&x) {
        true => x,
        false if x % TAU < 0.0 => x % TAU + TAU,
        false => x % TAU + 0.0, // no -0.0
    }
}

/// Shift an angle by turns into a range where that is possible.
pub fn ranged(q: f64, lower: f64, upper: f64) -> f64 {
    let q = PI - within_a_turn(PI - q);
    match (q + TAU, q - TAU) {
        (up, _) if q < lower && up <= upper => up,
        (_, down) if q > upper && down >= lower => down,
        _ => q,
    }
}

/// Put an angle on the turn that continues a motion from another one.
pub fn nearest_turn(q: f64, near: f64) -> f64 {
    q - TAU * ((q - near) / TAU).round_ties_even()
}

/// Put an axis on its written turn; a missing one is 0, of T3 it says nothing.
fn on_turn(q: f64, turn: f64, axis: usize) -> f64 {
    if axis == AXES[2] && turn.is_nan() {
        return q;
    }
    let turn = if turn.is_nan() { 0.0 } else { turn };
    let whole = (turn + 0.5).floor();
    let middle = TAU * (turn - whole);
    within_a_turn(q - middle + PI) - PI + middle + TAU * whole
}

/// Shift joint angles (n, 6) [rad] by whole turns into a range (6,) where possible.
#[pyfunction]
pub fn into_range<'py>(
    py: Python<'py>,
    q: PyReadonlyArray2<'py, f64>,
    lower: PyReadonlyArray1<'py, f64>,
    upper: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (q, lower, upper) = (rows::<6>(&q)?, row(&lower)?, row(&upper)?);
    let shifted =
        |at: usize| -> Six { std::array::from_fn(|j| ranged(q[at][j], lower[j], upper[j])) };
    Ok(array(py, each(py, q.len(), shifted)?))
}

/// Put joint angles (n, 6) [rad] on written turns T1, T2, T3, (n, 3), NaN: not written.
#[pyfunction]
pub fn on_turns<'py>(
    py: Python<'py>,
    q: PyReadonlyArray2<'py, f64>,
    turns: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (q, turns) = (rows::<6>(&q)?, rows::<3>(&turns)?);
    let n = same_length(&[q.len(), turns.len()])?;
    Ok(array(py, each(py, n, |at| put(&q[at], &turns[at]))?))
}

fn put(q: &Six, turns: &Three) -> Six {
    let mut out = *q;
    for (axis, turn) in AXES.into_iter().zip(turns) {
        out[axis] = on_turn(q[axis], *turn, axis);
    }
    out
}

/// Tell which joint angles (n, 6) [rad] are on other turns than those written, (n,).
#[pyfunction]
pub fn on_other_turns<'py>(
    py: Python<'py>,
    q: PyReadonlyArray2<'py, f64>,
    turns: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<bool>>> {
    let (q, turns) = (rows::<6>(&q)?, rows::<3>(&turns)?);
    let n = same_length(&[q.len(), turns.len()])?;
    let other = |at: usize| {
        let meant = put(&q[at], &turns[at]);
        AXES.iter().any(|axis| (meant[*axis] - q[at][*axis]).abs() > OTHER)
    };
    Ok(each(py, n, other)?.into_pyarray(py))
}
