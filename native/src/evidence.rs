//! Passes over the normal equations of a fit: `postproc.calibration.evidence`.

use numpy::ndarray::Array2;
use numpy::{
    IntoPyArray, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::rows::{detached, flat, same_length};

/// Write 1 + S G S into the lower half of an array, (p, p).
///
/// `gram`: G, (p, p). `scale`: the diagonal of S, (p,).
#[pyfunction]
pub fn scaled<'py>(
    py: Python<'py>,
    gram: PyReadonlyArray2<'py, f64>,
    scale: PyReadonlyArray1<'py, f64>,
    mut out: PyReadwriteArray2<'py, f64>,
) -> PyResult<()> {
    let (gram, s, p) = (flat(&gram)?, flat(&scale)?, scale.len());
    let out = out.as_slice_mut()?;
    same_length(&[gram.len(), out.len(), p * p])?;
    detached(py, || {
        for i in 0..p {
            let (row, given) = (&mut out[i * p..][..=i], &gram[i * p..][..=i]);
            for ((out, g), s_j) in row.iter_mut().zip(given).zip(s) {
                *out = s[i] * g * s_j;
            }
            row[i] += 1.0;
        }
    })
}

/// Sum P_ij (P_ij + 2 z_i z_j) over the pairs of every two groups, (g, g).
///
/// `lower`: P, symmetric, (p, p), of which the lower half is read. `z`: (p,). `group`: of
/// every row, (p,), below `count`.
#[pyfunction]
pub fn by_groups<'py>(
    py: Python<'py>,
    lower: PyReadonlyArray2<'py, f64>,
    z: PyReadonlyArray1<'py, f64>,
    group: PyReadonlyArray1<'py, i64>,
    count: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (lower, z, group) = (flat(&lower)?, flat(&z)?, flat(&group)?);
    let p = same_length(&[z.len(), group.len()])?;
    same_length(&[lower.len(), p * p])?;
    if group.iter().any(|g| *g < 0 || *g as usize >= count) {
        return Err(PyValueError::new_err("a group that there is not"));
    }
    let group: Vec<usize> = group.iter().map(|g| *g as usize).collect();
    let sums = detached(py, || {
        let mut sums = vec![0.0; count * count];
        for i in 0..p {
            let own = &mut sums[group[i] * count..][..count];
            let twice = 2.0 * z[i];
            for ((x, z_j), g) in lower[i * p..][..i].iter().zip(z).zip(&group) {
                own[*g] += x * (x + twice * z_j);
            }
            let x = lower[i * p + i];
            own[group[i]] += 0.5 * x * (x + twice * z[i]);
        }
        sums
    })?;
    let half = Array2::from_shape_vec((count, count), sums).expect("as many sums as pairs");
    Ok((&half + &half.t()).into_pyarray(py))
}
