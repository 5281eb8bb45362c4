//! Edits of texts: `postproc.language.source`.

use std::ops::Range;

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::rows::{detached, each, flat, same_length};

type Ints<'py> = PyReadonlyArray1<'py, i32>;

/// Spans of a text in ascending order.
struct Spans<'a> {
    start: &'a [i32],
    end: &'a [i32],
}

impl<'a> Spans<'a> {
    /// See two columns as spans, or refuse them.
    fn new(data: &[u8], start: &'a Ints<'_>, end: &'a Ints<'_>) -> PyResult<Self> {
        let (start, end) = (flat(start)?, flat(end)?);
        same_length(&[start.len(), end.len()])?;
        let mut done = 0_i32;
        for (a, b) in start.iter().zip(end) {
            if *a < done || b < a || *b as usize > data.len() {
                return Err(PyValueError::new_err("an edit lies outside"));
            }
            done = *b;
        }
        Ok(Spans { start, end })
    }

    fn len(&self) -> usize {
        self.start.len()
    }

    fn at(&self, i: usize) -> Range<usize> {
        self.start[i] as usize..self.end[i] as usize
    }
}

/// Spans of a text, and the rows, filled up with NUL, of what replaces them.
struct Edits<'a> {
    data: &'a [u8],
    spans: Spans<'a>,
    rows: &'a [u8],
    width: usize,
}

impl<'a> Edits<'a> {
    fn new(
        data: &'a Bound<'_, PyBytes>,
        (start, end): (&'a Ints<'_>, &'a Ints<'_>),
        new: &'a PyReadonlyArray2<'_, u8>,
    ) -> PyResult<Self> {
        let spans = Spans::new(data.as_bytes(), start, end)?;
        same_length(&[new.shape()[0], spans.len()])?;
        Ok(Edits { data: data.as_bytes(), spans, rows: flat(new)?, width: new.shape()[1] })
    }

    fn text(&self, i: usize) -> &'a [u8] {
        let row = &self.rows[i * self.width..(i + 1) * self.width];
        &row[..row.iter().rposition(|b| *b != 0).map_or(0, |last| last + 1)]
    }

    /// Pass all pieces of the text with its edits made.
    fn pass(&self, py: Python<'_>, mut piece: impl FnMut(&[u8]) + Send) -> PyResult<()> {
        let mut done = 0;
        each(py, self.spans.len(), |i| {
            let span = self.spans.at(i);
            piece(&self.data[done..span.start]);
            piece(self.text(i));
            done = span.end;
        })?;
        detached(py, || piece(&self.data[done..]))
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
    let edits = Edits::new(data, (&start, &end), &new)?;
    let mut length = 0;
    edits.pass(py, |text| length += text.len())?;
    PyBytes::new_with(py, length, |out| {
        let mut at = 0;
        edits.pass(py, |text| {
            out[at..at + text.len()].copy_from_slice(text);
            at += text.len();
        })
    })
}

/// Tell whether a text, without the bytes of a stamp, is another one with spans replaced.
#[pyfunction]
pub fn is_woven<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyBytes>,
    start: Ints<'py>,
    end: Ints<'py>,
    new: PyReadonlyArray2<'py, u8>,
    found: &Bound<'py, PyBytes>,
    stamp: (usize, usize),
) -> PyResult<bool> {
    let edits = Edits::new(data, (&start, &end), &new)?;
    let found = found.as_bytes();
    let (Some(mut head), Some(mut rest)) = (found.get(..stamp.0), found.get(stamp.1..)) else {
        return Ok(false);
    };
    let mut same = true;
    edits.pass(py, |text| {
        let (first, second) = text.split_at(text.len().min(head.len()));
        same = same && head.starts_with(first) && rest.starts_with(second);
        if same {
            (head, rest) = (&head[first.len()..], &rest[second.len()..]);
        }
    })?;
    Ok(same && head.is_empty() && rest.is_empty())
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
    let spans = Spans::new(data, &start, &end)?;
    let width = (0..spans.len()).map(|i| spans.at(i).len()).max().unwrap_or(0).max(1);
    let mut out = vec![0_u8; width * spans.len()];
    each(py, spans.len(), |i| {
        let text = &data[spans.at(i)];
        out[i * width..i * width + text.len()].copy_from_slice(text);
    })?;
    let out = Array2::from_shape_vec((spans.len(), width), out);
    Ok(out.expect("as many bytes as rows have").into_pyarray(py))
}
