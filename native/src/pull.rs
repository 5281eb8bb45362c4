//! How corners pull at each other: `postproc.motion.path`.

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::rows::{array, each, flat, rows, same_length, Three};

type Column<'py, T> = PyReadonlyArray1<'py, T>;

/// Move targets so that the path moves as wanted where it passes, (n, 3), by rounds of
/// Jacobi's method. Corners: the points, the targets before and behind
/// them, and the shares of those two, (c,) each.
#[pyfunction]
pub fn to_move<'py>(
    py: Python<'py>,
    wanted: PyReadonlyArray2<'py, f64>,
    corners: (Column<'py, i64>, Column<'py, i64>, Column<'py, i64>),
    shares: (Column<'py, f64>, Column<'py, f64>),
    along: PyReadonlyArray2<'py, f64>,
    rounds: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let wanted = rows::<3>(&wanted)?;
    let (visit, before, behind) = (flat(&corners.0)?, flat(&corners.1)?, flat(&corners.2)?);
    let (v, w) = (flat(&shares.0)?, flat(&shares.1)?);
    let along = rows::<3>(&along)?;
    let count = [visit.len(), before.len(), behind.len(), v.len(), w.len(), along.len()];
    let count = same_length(&count)?;
    let places = 0..wanted.len() as i64;
    if [visit, before, behind].iter().any(|c| c.iter().any(|at| !places.contains(at))) {
        return Err(PyValueError::new_err("a corner at a target that is none"));
    }
    let mut moved = wanted.to_vec();
    for _ in 0..rounds {
        let next: Vec<Three> = each(py, count, |c| {
            let at = visit[c] as usize;
            let (aim, here) = (&wanted[at], &moved[at]);
            let (first, last) = (&moved[before[c] as usize], &moved[behind[c] as usize]);
            let pulled = |k: usize| v[c] * (first[k] - here[k]) + w[c] * (last[k] - here[k]);
            let pulled = across(&std::array::from_fn(pulled), &along[c]);
            std::array::from_fn(|k| aim[k] - pulled[k])
        })?;
        for (c, next) in next.iter().enumerate() {
            moved[visit[c] as usize] = *next;
        }
    }
    Ok(array(py, moved))
}

/// The part of something across a direction.
pub fn across(by: &Three, along: &Three) -> Three {
    let part: f64 = (0..3).map(|k| by[k] * along[k]).sum();
    std::array::from_fn(|k| by[k] - part * along[k])
}
