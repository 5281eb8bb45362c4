//! Values that shares of ways stay within: `postproc.compensation.paths.plan_outcomes`.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::rows::{each, flat, same_length};

/// Return the value that a share of a weight stays within; 0 of no samples.
fn within(share: f64, values: &[f64], weight: &[f64], order: &mut Vec<u32>) -> f64 {
    order.clear();
    order.extend(0..values.len() as u32);
    order.sort_by(|a, b| values[*a as usize].total_cmp(&values[*b as usize]));
    let whole: f64 = order.iter().map(|k| weight[*k as usize]).sum();
    let mut done = 0.0;
    let reached = order.iter().find(|k| {
        done += weight[**k as usize];
        done >= share * whole
    });
    reached.or(order.last()).map_or(0.0, |k| values[*k as usize])
}

/// Tell what a share of the samples of some ways stays within, (k,).
///
/// Samples first[w] .. first[w + 1] - 1 are those of way w; they count by weight.
#[pyfunction]
pub fn stays_within<'py>(
    py: Python<'py>,
    share: f64,
    values: PyReadonlyArray1<'py, f64>,
    weight: PyReadonlyArray1<'py, f64>,
    first: PyReadonlyArray1<'py, i64>,
    ways: PyReadonlyArray1<'py, i64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (values, weight) = (flat(&values)?, flat(&weight)?);
    let (first, ways) = (flat(&first)?, flat(&ways)?);
    same_length(&[values.len(), weight.len()])?;
    let span = |way: i64| {
        let way = usize::try_from(way).ok()?;
        let (begin, end) = (*first.get(way)?, *first.get(way + 1)?);
        let span = usize::try_from(begin).ok()?..usize::try_from(end).ok()?;
        values.get(span.clone()).zip(weight.get(span))
    };
    let mut order = Vec::new();
    let found = each(py, ways.len(), |k| {
        span(ways[k]).map(|(values, weight)| within(share, values, weight, &mut order))
    })?;
    let found: Option<Vec<f64>> = found.into_iter().collect();
    let found = found.ok_or_else(|| PyIndexError::new_err("there is no such way"))?;
    Ok(found.into_pyarray(py))
}
