//! The play operator: `postproc.robot.backlash_operator`.

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::rows::{array, each, flat, row, rows, same_length, Six};

type Block<'py> = Bound<'py, PyArray2<f64>>;

/// Unknown if one of them is.
fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() {
        a
    } else {
        b
    }
}

/// Unknown if one of them is.
fn smaller(a: f64, b: f64) -> f64 {
    if a < b || a.is_nan() {
        a
    } else {
        b
    }
}

/// Maps z -> min(max(z, lo), hi) of one moment.
#[derive(Clone, Copy)]
pub struct Clamp {
    pub lo: Six,
    pub hi: Six,
}

/// Tell whether numbers are the same within something.
pub fn is_near<const K: usize>(a: &[f64; K], b: &[f64; K], most: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| a == b || (a - b).abs() <= most)
}

impl Clamp {
    pub const IDENTITY: Clamp = Clamp { lo: [f64::NEG_INFINITY; 6], hi: [f64::INFINITY; 6] };

    /// Return the clamp of passing an angle.
    pub fn passing(q: &Six, half: &Six) -> Clamp {
        Clamp {
            lo: std::array::from_fn(|j| q[j] - half[j]),
            hi: std::array::from_fn(|j| q[j] + half[j]),
        }
    }

    /// Compose: this one first, then the other.
    pub fn then(&self, after: &Clamp) -> Clamp {
        let through =
            |z: &Six| std::array::from_fn(|j| smaller(larger(z[j], after.lo[j]), after.hi[j]));
        Clamp { lo: through(&self.lo), hi: through(&self.hi) }
    }

    /// Tell whether another one is the same within some angle.
    pub fn is_near(&self, other: &Clamp, most: f64) -> bool {
        is_near(&self.lo, &other.lo, most) && is_near(&self.hi, &other.hi, most)
    }

    /// Return the hull of two intervals.
    pub fn hull(&self, other: &Clamp) -> Clamp {
        Clamp {
            lo: std::array::from_fn(|j| smaller(self.lo[j], other.lo[j])),
            hi: std::array::from_fn(|j| larger(self.hi[j], other.hi[j])),
        }
    }
}

/// `Clamps` of the package.
#[derive(FromPyObject)]
pub struct Clamps<'py> {
    lo: PyReadonlyArray2<'py, f64>,
    hi: PyReadonlyArray2<'py, f64>,
}

impl Clamps<'_> {
    pub fn list(&self) -> PyResult<Vec<Clamp>> {
        let (lo, hi) = (rows::<6>(&self.lo)?, rows::<6>(&self.hi)?);
        same_length(&[lo.len(), hi.len()])?;
        Ok(lo.iter().zip(hi).map(|(lo, hi)| Clamp { lo: *lo, hi: *hi }).collect())
    }
}

/// Lower and upper ends of clamps, (n, 6).
pub type Ends<'py> = (Block<'py>, Block<'py>);

/// Give clamps to Python.
pub fn ends<'py>(py: Python<'py>, clamps: &[Clamp]) -> Ends<'py> {
    (
        array(py, clamps.iter().map(|c| c.lo).collect()),
        array(py, clamps.iter().map(|c| c.hi).collect()),
    )
}

const DIGITS: f64 = 1e9; // of a side: what is less is rounding of the way up to there

/// Place joints in their plays along ways, (s, 6): the least and the largest side.
///
/// `half` is half of the width of the play at every sample, `begins` tells the first ones
/// of ways, and `state` is what is known there, from the angle on, in halves of the width.
#[pyfunction]
pub fn sides_along<'py>(
    py: Python<'py>,
    angles: PyReadonlyArray2<'py, f64>,
    half: PyReadonlyArray2<'py, f64>,
    begins: PyReadonlyArray1<'py, bool>,
    state: Clamps<'py>,
) -> PyResult<Ends<'py>> {
    let (angles, half) = (rows::<6>(&angles)?, rows::<6>(&half)?);
    let (begins, state) = (flat(&begins)?, state.list()?);
    same_length(&[angles.len(), half.len(), begins.len()])?;
    same_length(&[state.len(), begins.iter().filter(|begins| **begins).count()])?;
    let (mut known, mut u, mut z) = (state.iter(), [0.0; 6], Clamp::IDENTITY);
    let sides = each(py, angles.len(), |i| {
        if begins[i] {
            (u, z) = ([0.0; 6], *known.next().unwrap_or(&Clamp::IDENTITY));
        } else if i > 0 {
            for j in 0..6 {
                u[j] += 2.0 * (angles[i][j] - angles[i - 1][j]) / (half[i][j] + half[i - 1][j]);
            }
        }
        z = z.then(&Clamp::passing(&u, &[1.0; 6]));
        let side =
            |z: &Six| std::array::from_fn(|j| ((u[j] - z[j]) * DIGITS).round_ties_even() / DIGITS);
        Clamp { lo: side(&z.hi), hi: side(&z.lo) }
    })?;
    Ok(ends(py, &sides))
}

/// `LastReversal` of the package, at one moment or at several.
#[derive(FromPyObject)]
pub struct Reversals<'py> {
    side: PyReadonlyArray1<'py, f64>,
    angle: PyReadonlyArray1<'py, f64>,
    z: PyReadonlyArray1<'py, f64>,
}

/// Follow drive-side angles (s, 6) from the last reversal before them; return the last
/// reversals at samples `at` (k,), ascending: side, angle and state of the play, (k, 6).
///
/// A reversal is a return by more than twice `half`, (6,).
#[pyfunction]
pub fn reversals<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f64>,
    at: PyReadonlyArray1<'py, i64>,
    before: Reversals<'py>,
    half: PyReadonlyArray1<'py, f64>,
) -> PyResult<(Block<'py>, Block<'py>, Block<'py>)> {
    let (values, at, half) = (rows::<6>(&values)?, flat(&at)?, row(&half)?);
    let (mut side, mut angle, mut z) = (row(&before.side)?, row(&before.angle)?, row(&before.z)?);
    let (mut found, mut wanted) = ([const { Vec::<Six>::new() }; 3], at.iter().peekable());
    each(py, values.len(), |i| {
        for j in 0..6 {
            let new = smaller(larger(z[j], values[i][j] - half[j]), values[i][j] + half[j]);
            let turned = new - z[j];
            let turned = if turned == 0.0 { side[j] } else { turned.signum() };
            if turned != side[j] {
                angle[j] = z[j] + side[j] * half[j];
            }
            (side[j], z[j]) = (turned, new);
        }
        while wanted.next_if(|at| **at == i as i64).is_some() {
            for (column, row) in found.iter_mut().zip([side, angle, z]) {
                column.push(row);
            }
        }
    })?;
    if wanted.next().is_some() {
        return Err(PyIndexError::new_err("samples that are not there, or not ascending"));
    }
    let [side, angle, z] = found.map(|column| array(py, column));
    Ok((side, angle, z))
}
