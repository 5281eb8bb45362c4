//! Two texts line by line: which numbers differ, or what more (`postproc.report.diff`).

use std::ops::Range;

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::number::value_of;
use crate::rows::{detached, flat, on_cores, same_length};
use crate::statements::mask_krl_line;
use crate::text::Masked;

/// Lines that are compared between two looks at signals.
const AT_ONCE: usize = 1 << 17;
/// Lines that are worth a thread.
const LEAST: usize = 2000;

/// Lines without their endings: line k stands from first[k] to the byte before
/// first[k + 1].
struct Lines<'a> {
    data: &'a [u8],
    first: &'a [i32],
}

impl<'a> Lines<'a> {
    fn new(data: &'a [u8], first: &'a [i32]) -> PyResult<Self> {
        let fits = first.windows(2).all(|two| 0 <= two[0] && two[0] < two[1])
            && first.last().is_none_or(|end| i64::from(*end) <= data.len() as i64 + 1);
        match fits {
            true => Ok(Lines { data, first }),
            false => Err(PyIndexError::new_err("lines that are not there")),
        }
    }

    fn line(&self, k: usize) -> &'a [u8] {
        &self.data[self.first[k] as usize..self.first[k + 1] as usize - 1]
    }
}

/// The lines that differ, and the numbers of those that differ in numbers alone.
#[derive(Default)]
struct Found {
    row: Vec<i64>,
    first: Vec<i64>,
    old: Vec<f64>,
    new: Vec<f64>,
    /// Where the first number stands in a line, -1 without numbers that differ.
    begin: Vec<i64>,
    braced: Vec<bool>,
}

impl Found {
    fn append(&mut self, mut other: Found) {
        let shift = self.old.len() as i64;
        self.first.extend(other.first.iter().map(|first| first + shift));
        self.row.append(&mut other.row);
        self.old.append(&mut other.old);
        self.new.append(&mut other.new);
        self.begin.append(&mut other.begin);
        self.braced.append(&mut other.braced);
    }
}

/// Compares lines one after the other.
struct Comparison {
    masked: [Masked; 2],
    found: Found,
    /// Names stand before the numbers of positions, in braces, as KRL has them.
    named: bool,
}

impl Comparison {
    fn take(&mut self, row: usize, before: &[u8], after: &[u8]) {
        if before == after {
            return;
        }
        let begin = self.numbers(before, after);
        self.found.row.push(row as i64);
        self.found.begin.push(begin.map_or(-1, |at| at as i64));
        self.found.braced.push(!self.named && before.contains(&b'{'));
        self.found.first.push(self.found.old.len() as i64);
    }

    /// Take the numbers of two lines, if some differ and nothing else does; tell where
    /// the first one stands.
    fn numbers(&mut self, before: &[u8], after: &[u8]) -> Option<usize> {
        let [a, b] = &mut self.masked;
        if self.named {
            mask_krl_line(before, a);
            mask_krl_line(after, b);
        } else if !(a.read(before) && b.read(after)) {
            return None;
        }
        if a.mask != b.mask || (self.named && !drop_subscripts(before, a, after, b)) {
            return None;
        }
        let comment = |line: &Masked, text: &[u8]| line.comment.map(|at| text[at..].to_vec());
        if comment(a, before) != comment(b, after) || a.numbers.len() != b.numbers.len() {
            return None;
        }
        let had = self.found.old.len();
        let value = |text: &[u8], (from, to): &(usize, usize)| value_of(&text[*from..*to]);
        self.found.old.extend(a.numbers.iter().map(|span| value(before, span)));
        self.found.new.extend(b.numbers.iter().map(|span| value(after, span)));
        if self.found.old[had..] == self.found.new[had..] {
            self.found.old.truncate(had);
            self.found.new.truncate(had);
            return None;
        }
        a.numbers.first().map(|(from, _)| *from)
    }
}

/// Drop the numbers in front of a brace; tell whether they are the same.
fn drop_subscripts(before: &[u8], a: &mut Masked, after: &[u8], b: &mut Masked) -> bool {
    let brace = |line: &[u8]| line.iter().position(|byte| *byte == b'{');
    let (Some(one), Some(two)) = (brace(before), brace(after)) else { return true };
    a.numbers.retain(|(from, _)| *from > one);
    b.numbers.retain(|(from, _)| *from > two);
    before[..one] == after[..two]
}

/// Compare some lines.
fn compared(before: &Lines<'_>, after: &Lines<'_>, rows: Range<usize>, named: bool) -> Found {
    let mut work = Comparison { masked: Default::default(), found: Found::default(), named };
    for row in rows {
        work.take(row, before.line(row), after.line(row));
    }
    work.found
}

/// Tell which of some lines begin with the same bytes as the one before them.
fn begin_alike(before: &Lines<'_>, found: &Found) -> Vec<bool> {
    let begin = |k: usize| -> Option<&[u8]> {
        let length = usize::try_from(found.begin[k]).ok()?;
        Some(&before.line(found.row[k] as usize)[..length])
    };
    (0..found.row.len()).map(|k| k > 0 && begin(k) == begin(k - 1)).collect()
}

type Column<'py, T> = Bound<'py, PyArray1<T>>;

/// Compare equally many lines of two texts.
///
/// Arguments:
///     `before_first`, `after_first`: Where lines begin, and one more behind the byte that
///     ends the last one, (n + 1,).
///     `named`: The language names the numbers of positions, in braces.
///
/// Returns: the lines (from 0) that differ, (k,), and of each: where its numbers begin,
/// (k + 1,), which are none where more than numbers differs; where the first one stands,
/// -1 without; whether what stands before it is the same as in the line before; whether
/// there is a brace. Then the numbers of both texts, (m,).
#[pyfunction]
#[pyo3(signature = (before, before_first, after, after_first, named=false))]
#[allow(clippy::type_complexity)]
pub fn compare_lines<'py>(
    py: Python<'py>,
    before: &Bound<'py, PyBytes>,
    before_first: PyReadonlyArray1<'py, i32>,
    after: &Bound<'py, PyBytes>,
    after_first: PyReadonlyArray1<'py, i32>,
    named: bool,
) -> PyResult<(
    (Column<'py, i64>, Column<'py, i64>, Column<'py, i64>, Column<'py, bool>, Column<'py, bool>),
    (Column<'py, f64>, Column<'py, f64>),
)> {
    let (before, after) = (
        Lines::new(before.as_bytes(), flat(&before_first)?)?,
        Lines::new(after.as_bytes(), flat(&after_first)?)?,
    );
    let n = same_length(&[before.first.len(), after.first.len()])?.saturating_sub(1);
    let mut found = Found { first: vec![0], ..Found::default() };
    for first in (0..n).step_by(AT_ONCE) {
        py.check_signals()?;
        let rows = first..n.min(first + AT_ONCE);
        detached(py, || {
            let parts = on_cores(rows, LEAST, |rows| compared(&before, &after, rows, named));
            parts.into_iter().for_each(|part| found.append(part));
        })?;
    }
    let alike = detached(py, || begin_alike(&before, &found))?;
    Ok((
        (
            found.row.into_pyarray(py),
            found.first.into_pyarray(py),
            found.begin.into_pyarray(py),
            alike.into_pyarray(py),
            found.braced.into_pyarray(py),
        ),
        (found.old.into_pyarray(py), found.new.into_pyarray(py)),
    ))
}
