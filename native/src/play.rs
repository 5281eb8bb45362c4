//! The play operator: `postproc.robot.backlash_operator`.

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::rows::{array, each, flat, rows, same_length, Six};

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

/// Compose the steps (n, 6) since the last beginning up to each one.
#[pyfunction]
pub fn prefix<'py>(
    py: Python<'py>,
    steps: Clamps<'py>,
    begins: PyReadonlyArray1<'py, bool>,
) -> PyResult<Ends<'py>> {
    let (mut steps, begins) = (steps.list()?, flat(&begins)?);
    same_length(&[steps.len(), begins.len()])?;
    each(py, steps.len(), |i| {
        if i > 0 && !begins[i] {
            steps[i] = steps[i - 1].then(&steps[i]);
        }
    })?;
    Ok(ends(py, &steps))
}
