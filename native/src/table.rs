//! Rows of reports and records as text: `postproc.arrays.Cells`.

use std::collections::HashMap;
use std::io::Write;
use std::ops::Range;

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyBytes;

use crate::number::{put_fixed, put_shortest, put_whole};
use crate::rows::{flat, in_parts};

/// Rows that are worth a thread.
const LEAST: usize = 2000;

/// `Cells` of the package.
#[derive(FromPyObject)]
pub struct Cells<'py> {
    before: PyBackedBytes,
    numbers: Option<PyReadonlyArray2<'py, f64>>,
    whole: Option<PyReadonlyArray2<'py, i64>>,
    names: Vec<PyBackedBytes>,
    index: Option<PyReadonlyArray2<'py, i64>>,
    quoted: Option<PyReadonlyArray2<'py, u8>>,
    first: Option<PyReadonlyArray1<'py, i64>>,
    fixed: Option<usize>,
    rounded: Option<usize>,
    between: (PyBackedBytes, PyBackedBytes, PyBackedBytes),
    left: Option<PyReadonlyArray1<'py, bool>>,
    instead: PyBackedBytes,
}

/// What the values of a column are.
enum Values<'a> {
    None,
    Numbers(&'a [f64]),
    Whole(&'a [i64]),
    Names(&'a [i64]),
    /// Latin-1, filled up with NUL, so many bytes each.
    Quoted(&'a [u8], usize),
}

/// A column as the bytes and numbers that it is made of.
pub struct Column<'a> {
    before: &'a [u8],
    values: Values<'a>,
    names: Vec<&'a [u8]>,
    fixed: Option<usize>,
    rounded: Option<usize>,
    between: [&'a [u8]; 3],
    instead: &'a [u8],
    /// Values of a row, where there are as many in all of them.
    width: usize,
    first: Option<&'a [i64]>,
    left: Option<&'a [bool]>,
}

impl<'a> Column<'a> {
    /// Look whether the arrays fit n rows and each other.
    pub fn new(cells: &'a Cells<'_>, n: usize) -> PyResult<Self> {
        let (values, rows, width) = match cells {
            Cells { numbers: Some(a), .. } => {
                (Values::Numbers(flat(a)?), a.shape()[0], a.shape()[1])
            }
            Cells { whole: Some(a), .. } => (Values::Whole(flat(a)?), a.shape()[0], a.shape()[1]),
            Cells { index: Some(a), .. } => (Values::Names(flat(a)?), a.shape()[0], a.shape()[1]),
            Cells { quoted: Some(a), .. } => {
                (Values::Quoted(flat(a)?, a.shape()[1]), a.shape()[0], 1)
            }
            _ => (Values::None, n, 0),
        };
        let names: Vec<&[u8]> = cells.names.iter().map(|name| &name[..]).collect();
        if let Values::Names(index) = values {
            if index.iter().any(|k| *k < 0 || *k >= names.len() as i64) {
                return Err(PyIndexError::new_err("a text that is not there"));
            }
        }
        let first = cells.first.as_ref().map(flat).transpose()?;
        let left = cells.left.as_ref().map(flat).transpose()?;
        let fits = match first {
            None => rows == n,
            Some(first) => {
                width == 1
                    && first.len() == n + 1
                    && first.windows(2).all(|pair| 0 <= pair[0] && pair[0] <= pair[1])
                    && first[n] <= rows as i64
            }
        };
        if !fits || left.is_some_and(|left| left.len() != n) {
            return Err(PyValueError::new_err("columns of other lengths"));
        }
        let (open, between, close) = &cells.between;
        Ok(Column {
            before: &cells.before,
            values,
            names,
            fixed: cells.fixed,
            rounded: cells.rounded,
            between: [open, between, close],
            instead: &cells.instead,
            width,
            first,
            left,
        })
    }

    pub fn put(&self, out: &mut Vec<u8>, row: usize) {
        out.extend_from_slice(self.before);
        if self.left.is_some_and(|left| left[row]) {
            out.extend_from_slice(self.instead);
            return;
        }
        let [open, between, close] = self.between;
        let span = match self.first {
            None => row * self.width..(row + 1) * self.width,
            Some(first) => first[row] as usize..first[row + 1] as usize,
        };
        out.extend_from_slice(open);
        for (nth, k) in span.enumerate() {
            if nth > 0 {
                out.extend_from_slice(between);
            }
            self.put_value(out, k);
        }
        out.extend_from_slice(close);
    }

    fn put_value(&self, out: &mut Vec<u8>, k: usize) {
        match self.values {
            Values::None => {}
            Values::Whole(values) => put_whole(out, values[k]),
            Values::Quoted(texts, most) => put_quoted(out, &texts[k * most..(k + 1) * most]),
            Values::Names(index) => out.extend_from_slice(self.names[index[k] as usize]),
            Values::Numbers(values) if values[k].is_nan() => out.extend_from_slice(b"null"),
            Values::Numbers(values) => match self.fixed {
                Some(decimals) => put_fixed(out, values[k], decimals),
                None => put_shortest(out, values[k], self.rounded),
            },
        }
    }
}

/// Write a text of Latin-1 as a string of JSON, in ASCII.
fn put_quoted(out: &mut Vec<u8>, text: &[u8]) {
    let end = text.iter().rposition(|b| *b != 0).map_or(0, |last| last + 1);
    out.push(b'"');
    for byte in &text[..end] {
        match byte {
            b'"' | b'\\' => out.extend_from_slice(&[b'\\', *byte]),
            b'\n' => out.extend_from_slice(b"\\n"),
            b'\r' => out.extend_from_slice(b"\\r"),
            b'\t' => out.extend_from_slice(b"\\t"),
            8 => out.extend_from_slice(b"\\b"),
            12 => out.extend_from_slice(b"\\f"),
            32..=126 => out.push(*byte),
            _ => write!(out, "\\u{byte:04x}").expect("a vector takes all"),
        }
    }
    out.push(b'"');
}

/// Rows that are given as texts instead.
type Given = HashMap<usize, PyBackedBytes>;

/// Write some rows, one behind the other, column by column.
fn put_rows(columns: &[Column<'_>], given: &Given, rows: Range<usize>) -> Vec<u8> {
    let (mut out, many) = (Vec::new(), rows.len());
    for (nth, row) in rows.enumerate() {
        match given.get(&row) {
            Some(text) => out.extend_from_slice(text),
            None => columns.iter().for_each(|column| column.put(&mut out, row)),
        }
        if nth == 0 {
            out.reserve(many * (out.len() + 8)); // rows are about as long as each other
        }
    }
    out
}

/// Write n rows, one behind the other, column by column.
///
/// Arguments:
///     columns: What the rows are made of.
///     given: Rows that are given as texts instead.
#[pyfunction]
pub fn table<'py>(
    py: Python<'py>,
    n: usize,
    columns: Vec<Bound<'py, PyAny>>,
    given: Given,
) -> PyResult<Bound<'py, PyBytes>> {
    let cells = columns.iter().map(|c| c.extract()).collect::<PyResult<Vec<Cells<'_>>>>()?;
    let columns = cells.iter().map(|c| Column::new(c, n)).collect::<PyResult<Vec<_>>>()?;
    let put = |rows| vec![put_rows(&columns, &given, rows)];
    concatenated(py, &in_parts(py, n, LEAST, put)?)
}

/// Give texts to Python as one.
pub fn concatenated<'py>(py: Python<'py>, parts: &[Vec<u8>]) -> PyResult<Bound<'py, PyBytes>> {
    PyBytes::new_with(py, parts.iter().map(Vec::len).sum(), |mut out| {
        for part in parts {
            let (here, behind) = out.split_at_mut(part.len());
            here.copy_from_slice(part);
            out = behind;
        }
        Ok(())
    })
}
