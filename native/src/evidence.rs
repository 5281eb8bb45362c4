//! Passes over normal equations: `postproc.calibration.evidence`, `diagnosis.score`.

use numpy::ndarray::Array2;
use numpy::{
    IntoPyArray, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray2,
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

/// Evidence of blocks of columns against draws of rows, each at its best prior scale, (c, d).
///
/// `gain`: eigenvalues of the Gram matrices, (c, k). `share`: what each direction has of
/// the square of every draw, (c, k, d). `signals`: scales tried, over the largest
/// eigenvalue, (s,). `rows`: number N of scalar rows. The logarithm of N / 2 is taken once,
/// of the least of (1 - sum) prod (1 + s^2 g)^(1 / N).
#[pyfunction]
pub fn of_blocks<'py>(
    py: Python<'py>,
    gain: PyReadonlyArray2<'py, f64>,
    share: PyReadonlyArray3<'py, f64>,
    signals: PyReadonlyArray1<'py, f64>,
    rows: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (count, width, draws) = (share.shape()[0], share.shape()[1], share.shape()[2]);
    let (gain, share, signals) = (flat(&gain)?, flat(&share)?, flat(&signals)?);
    same_length(&[gain.len(), count * width])?;
    let out = detached(py, || {
        let mut out = vec![1.0; count * draws];
        let mut rest = vec![0.0; draws];
        for c in 0..count {
            let least = &mut out[c * draws..][..draws];
            let (gain, share) = (&gain[c * width..][..width], &share[c * width * draws..]);
            for signal in signals {
                let charge = without(gain, share, *signal, rows, &mut rest);
                for (least, rest) in least.iter_mut().zip(&rest) {
                    *least = f64::min(*least, rest.max(NOTHING) * charge);
                }
            }
            least.iter_mut().for_each(|x| *x = -0.5 * rows * x.ln());
        }
        out
    })?;
    Ok(Array2::from_shape_vec((count, draws), out).expect("one of each").into_pyarray(py))
}

/// What rows hold of their square at least, once a block is taken out of them.
const NOTHING: f64 = 1e-12;

/// Write what a block at one scale leaves of the square of every draw; return its charge.
fn without(gain: &[f64], share: &[f64], signal: f64, rows: f64, rest: &mut [f64]) -> f64 {
    let largest = gain.iter().fold(1e-300, |a, b| f64::max(a, *b));
    let (s2, mut cost) = (signal / largest, 0.0);
    rest.fill(1.0);
    for (gain, share) in gain.iter().zip(share.chunks_exact(rest.len())) {
        let shrunk = 1.0 + s2 * gain;
        cost += shrunk.ln();
        let weight = s2 / shrunk;
        rest.iter_mut().zip(share).for_each(|(rest, share)| *rest -= weight * share);
    }
    (cost / rows).exp()
}
