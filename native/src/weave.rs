//! Edits of texts: `postproc.language.source`.

use std::ops::Range;

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::rows::{detached, each, flat, same_length};

type Ints<'py> = PyReadonlyArray1<'py, i64>;

/// Return spans of a text in ascending order, or refuse them.
fn spans(data: &[u8], start: &Ints<'_>, end: &Ints<'_>) -> PyResult<Vec<Range<usize>>> {
    let (start, end) = (flat(start)?, flat(end)?);
    same_length(&[start.len(), end.len()])?;
    let mut done = 0_i64;
    let mut out = Vec::with_capacity(start.len());
    for (a, b) in start.iter().zip(end) {
        if *a < done || b < a || *b > data.len() as i64 {
            return Err(PyValueError::new_err("an edit lies outside"));
        }
        out.push(*a as usize..*b as usize);
        done = *b;
    }
    Ok(out)
}

/// Texts in rows that are filled up with NUL.
struct Texts<'a> {
    rows: &'a [u8],
    width: usize,
}

impl<'a> Texts<'a> {
    fn of(array: &'a PyReadonlyArray2<'_, u8>, count: usize) -> PyResult<Self> {
        same_length(&[array.shape()[0], count])?;
        Ok(Texts { rows: flat(array)?, width: array.shape()[1] })
    }

    fn get(&self, i: usize) -> &'a [u8] {
        let row = &self.rows[i * self.width..(i + 1) * self.width];
        &row[..row.iter().rposition(|b| *b != 0).map_or(0, |last| last + 1)]
    }
}

/// Replace spans of a text, in ascending order, by other texts (m, w).
#[pyfunction]
pub fn weave<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyBytes>,
    start: Ints<'py>,
    end: Ints<'py>,
    new: PyReadonlyArray2<'py, u8>,
) -> PyResult<Bound<'py, PyBytes>> {
    let data = data.as_bytes();
    let spans = spans(data, &start, &end)?;
    let new = Texts::of(&new, spans.len())?;
    let gone: usize = spans.iter().map(Range::len).sum();
    let come: usize = detached(py, || (0..spans.len()).map(|i| new.get(i).len()).sum())?;
    PyBytes::new_with(py, data.len() - gone + come, |out| {
        let (mut at, mut done) = (0, 0);
        let mut put = |text: &[u8]| {
            out[at..at + text.len()].copy_from_slice(text);
            at += text.len();
        };
        each(py, spans.len(), |i| {
            put(&data[done..spans[i].start]);
            put(new.get(i));
            done = spans[i].end;
        })?;
        put(&data[done..]);
        Ok(())
    })
}

/// Tell whether a text is another one with spans replaced, behind so many bytes.
#[pyfunction]
pub fn is_woven<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyBytes>,
    start: Ints<'py>,
    end: Ints<'py>,
    new: PyReadonlyArray2<'py, u8>,
    found: &Bound<'py, PyBytes>,
    skipped: usize,
) -> PyResult<bool> {
    let (data, found) = (data.as_bytes(), found.as_bytes());
    let spans = spans(data, &start, &end)?;
    let new = Texts::of(&new, spans.len())?;
    let Some(mut rest) = found.get(skipped..) else { return Ok(false) };
    let mut done = 0;
    let mut taken = |text: &[u8]| match rest.strip_prefix(text) {
        Some(behind) => {
            rest = behind;
            true
        }
        None => false,
    };
    let all = each(py, spans.len(), |i| {
        let same = taken(&data[done..spans[i].start]) && taken(new.get(i));
        done = spans[i].end;
        same
    })?;
    Ok(all.into_iter().all(|same| same) && taken(&data[done..]) && rest.is_empty())
}

/// Cut spans out of a text, in ascending order: rows filled up with NUL, (m, w).
#[pyfunction]
pub fn cut<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyBytes>,
    start: Ints<'py>,
    end: Ints<'py>,
) -> PyResult<Bound<'py, PyArray2<u8>>> {
    let data = data.as_bytes();
    let spans = spans(data, &start, &end)?;
    let width = spans.iter().map(Range::len).max().unwrap_or(0).max(1);
    let mut out = vec![0_u8; width * spans.len()];
    each(py, spans.len(), |i| {
        let text = &data[spans[i].clone()];
        out[i * width..i * width + text.len()].copy_from_slice(text);
    })?;
    let out = Array2::from_shape_vec((spans.len(), width), out);
    Ok(out.expect("as many bytes as rows have").into_pyarray(py))
}
