//! The play operator: `postproc.robot.play`.

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::rows::{array, rows, same_length, Six};

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

/// Compose the steps (n, 6) since the last beginning up to each one.
#[pyfunction]
pub fn prefix<'py>(
    py: Python<'py>,
    lo: PyReadonlyArray2<'py, f64>,
    hi: PyReadonlyArray2<'py, f64>,
    begins: PyReadonlyArray1<'py, bool>,
) -> PyResult<(Block<'py>, Block<'py>)> {
    let (lo, hi, begins) = (rows::<6>(&lo)?, rows::<6>(&hi)?, begins.as_slice()?);
    let n = same_length(&[lo.len(), hi.len(), begins.len()])?;
    let (mut low, mut high): (Vec<Six>, Vec<Six>) = (lo.to_vec(), hi.to_vec());
    for i in 1..n {
        if begins[i] {
            continue;
        }
        for j in 0..6 {
            low[i][j] = smaller(larger(low[i - 1][j], lo[i][j]), hi[i][j]);
            high[i][j] = smaller(larger(high[i - 1][j], lo[i][j]), hi[i][j]);
        }
    }
    Ok((array(py, low), array(py, high)))
}
