//! How far joint angles lead the arm from others: `postproc.motion.deviation`.

use std::ops::Range;

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::chain::{Chain, Parameters};
use crate::rows::{array, at_best, dot, in_parts, minus, row, rows, same_length, Six, Three};

/// Rows that are worth a thread.
const LEAST: usize = 4096;

type Pair<'py> = (PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, f64>);
type Rows<'py> = Bound<'py, PyArray2<f64>>;

/// By how much a change lies outside of 0 to its offset; NaN stays NaN.
#[inline(always)]
fn excess(change: f64, offset: f64) -> f64 {
    let beyond = (offset.min(0.0) - change).max(change - offset.max(0.0)).max(0.0);
    if change.is_nan() {
        change
    } else {
        beyond
    }
}

/// Tell by how much elbow, wrist centre and TCP lie apart; NaN where angles are unknown.
#[inline(always)]
fn displacement(chain: &Chain, old: &Six, new: &Six, tool: &Three) -> Three {
    if old.iter().chain(new).any(|angle| angle.is_nan()) {
        return [f64::NAN; 3];
    }
    let [before, after] = [old, new].map(|q| {
        let frames = chain.frames(q);
        [frames[2].origin, frames[4].origin, frames[6].place(tool)]
    });
    std::array::from_fn(|k| {
        let way = minus(&after[k], &before[k]);
        dot(&way, &way).sqrt()
    })
}

/// Compare old and new joint angles, (n, 6) [rad]: what each changes by beyond an offset
/// (6,), (n, 6), and what elbow, wrist centre and points of the flange frame move by,
/// (n, 3) [m].
#[pyfunction]
pub fn departure<'py>(
    py: Python<'py>,
    parameters: Parameters<'py>,
    angles: Pair<'py>,
    point: PyReadonlyArray2<'py, f64>,
    offset: PyReadonlyArray1<'py, f64>,
) -> PyResult<(Rows<'py>, Rows<'py>)> {
    let (chain, offset) = (Chain::new(&parameters)?, row(&offset)?);
    let (old, new) = (rows::<6>(&angles.0)?, rows::<6>(&angles.1)?);
    let point = rows::<3>(&point)?;
    let n = same_length(&[old.len(), new.len(), point.len()])?;
    let one = |i: usize| -> (Six, Three) {
        let joints = std::array::from_fn(|j| excess(new[i][j] - old[i][j], offset[j]));
        (joints, displacement(&chain, &old[i], &new[i], &point[i]))
    };
    let part = |some: Range<usize>| at_best(|| some.map(one).collect());
    let (joints, sizes) = in_parts(py, n, LEAST, part)?.into_iter().unzip();
    Ok((array(py, joints), array(py, sizes)))
}
