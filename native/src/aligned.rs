//! Rows of a table whose columns stand below each other: `postproc.report.terminal`.

use std::collections::HashMap;
use std::ops::Range;

use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyBytes;

use crate::rows::{detached, in_threads, parts_of};
use crate::table::{concatenated, Cells, Column};

/// Rows that are written between two looks at signals.
const AT_ONCE: usize = 1 << 15;
/// Rows that are worth a thread.
const LEAST: usize = 2000;

/// The texts of a row that is given as such, and how many characters they are long.
type Given = HashMap<usize, Vec<(PyBackedBytes, usize)>>;

/// A table: its columns, on which side their cells stand, what is between them.
struct Table<'a> {
    columns: Vec<Column<'a>>,
    left: Vec<bool>,
    gap: &'a [u8],
    given: &'a Given,
}

/// The cells of some rows, one behind the other.
#[derive(Default)]
struct Written {
    text: Vec<u8>,
    /// Where every cell ends, and how many characters it has.
    cells: Vec<(usize, usize)>,
    /// The longest cell of every column.
    widest: Vec<usize>,
}

fn characters(text: &[u8]) -> usize {
    text.iter().filter(|byte| **byte & 0xc0 != 0x80).count()
}

impl Table<'_> {
    /// Write the cells of some rows. A last column on the left has no width.
    fn written(&self, rows: Range<usize>) -> Written {
        let many = self.columns.len();
        let mut out = Written { widest: vec![0; many], ..Written::default() };
        for row in rows {
            let given = self.given.get(&row);
            for (nth, column) in self.columns.iter().enumerate() {
                let begin = out.text.len();
                let mut length = match given {
                    Some(cells) => {
                        out.text.extend_from_slice(&cells[nth].0);
                        cells[nth].1
                    }
                    None => {
                        column.put(&mut out.text, row);
                        characters(&out.text[begin..])
                    }
                };
                length *= usize::from(nth + 1 < many || !self.left[nth]);
                out.cells.push((out.text.len(), length));
                out.widest[nth] = out.widest[nth].max(length);
            }
        }
        out
    }

    /// Put cells below each other: a column is as wide as what stands above.
    fn laid_out(&self, written: &Written, mut widths: Vec<usize>) -> Vec<u8> {
        let many = self.columns.len();
        let (mut out, mut begin) = (Vec::with_capacity(2 * written.text.len()), 0);
        for row in written.cells.chunks_exact(many) {
            for (nth, (end, length)) in row.iter().enumerate() {
                let cell = &written.text[begin..*end];
                let blanks = widths[nth].saturating_sub(*length);
                if nth > 0 {
                    out.extend_from_slice(self.gap);
                }
                if self.left[nth] {
                    out.extend_from_slice(cell);
                    out.resize(out.len() + blanks, b' ');
                } else {
                    out.resize(out.len() + blanks, b' ');
                    out.extend_from_slice(cell);
                }
                widths[nth] = widths[nth].max(*length);
                begin = *end;
            }
            out.truncate(out.iter().rposition(|byte| *byte != b' ').map_or(0, |last| last + 1));
            out.push(b'\n');
        }
        out
    }

    /// Write some rows, a part of them on every core; widen the columns.
    fn put(&self, rows: Range<usize>, widths: &mut [usize]) -> Vec<Vec<u8>> {
        let parts = parts_of(rows, LEAST);
        let written = in_threads(parts.len(), |part| self.written(parts[part].clone()));
        let mut before = Vec::new();
        for part in &written {
            before.push(widths.to_vec());
            widths.iter_mut().zip(&part.widest).for_each(|(w, widest)| *w = (*w).max(*widest));
        }
        in_threads(parts.len(), |part| self.laid_out(&written[part], before[part].clone()))
    }
}

/// Write rows below each other.
///
/// Arguments:
///     n: How many rows there are.
///     most: How many of them are written.
///     columns: Cells of all of them, a column each.
///     left: Whether the cells of a column stand on the left.
///     gap: What stands between two columns.
///     widths: How wide the columns are; a longer cell widens its column from the next
///     row on.
///     given: Rows whose cells are given as texts, with the number of their characters.
///
/// Returns: the text, and how wide the columns are behind it.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn aligned<'py>(
    py: Python<'py>,
    n: usize,
    most: usize,
    columns: Vec<Bound<'py, PyAny>>,
    left: Vec<bool>,
    gap: &[u8],
    mut widths: Vec<usize>,
    given: Given,
) -> PyResult<(Bound<'py, PyBytes>, Vec<usize>)> {
    let cells = columns.iter().map(|c| c.extract()).collect::<PyResult<Vec<Cells<'_>>>>()?;
    let columns = cells.iter().map(|c| Column::new(c, n)).collect::<PyResult<Vec<_>>>()?;
    let many = columns.len();
    if many == 0 || left.len() != many || widths.len() != many {
        return Err(PyValueError::new_err("a table needs a side and a width for every column"));
    }
    if given.iter().any(|(row, cells)| *row >= n || cells.len() != many) {
        return Err(PyIndexError::new_err("a row that is not there"));
    }
    let table = Table { columns, left, gap, given: &given };
    let mut parts = Vec::new();
    for first in (0..n.min(most)).step_by(AT_ONCE) {
        py.check_signals()?;
        let rows = first..n.min(most).min(first + AT_ONCE);
        parts.append(&mut detached(py, || table.put(rows, &mut widths))?);
    }
    Ok((concatenated(py, &parts)?, widths))
}
