//! A text that differs from one read before in numbers: `postproc.language.lexer`.

use std::ops::Range;

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::number::value_of;
use crate::rows::{detached, flat, on_cores};
use crate::spans::{Columns, Spans};
use crate::text::{Masked, Text, MARK};

/// Lines that are read between two looks at signals.
const AT_ONCE: usize = 1 << 16;
/// Lines that are worth a thread.
const LEAST: usize = 2000;

/// Lines of both texts, as they are read.
#[derive(Default)]
struct Pair {
    old: Masked,
    new: Masked,
}

impl Pair {
    /// Read two lines; tell whether they say the same but for what numbers are worth.
    fn same(&mut self, old: &[u8], new: &[u8]) -> bool {
        self.old.read(old)
            && self.new.read(new)
            && self.old.mask == self.new.mask
            && comment(&self.old, old) == comment(&self.new, new)
    }
}

/// Return the comment that a line ends with.
fn comment<'a>(line: &Masked, text: &'a [u8]) -> Option<&'a [u8]> {
    line.comment.map(|at| &text[at..])
}

/// What is read of some lines of the later text.
#[derive(Default)]
struct Found {
    places: Vec<Range<usize>>,
    value: Vec<f64>,
    changed: Vec<bool>,
}

impl Found {
    /// Take a line in that begins at an offset.
    fn take(&mut self, pair: &Pair, (old, new): (&[u8], &[u8]), at: usize) {
        for (was, now) in pair.old.numbers.iter().zip(&pair.new.numbers) {
            let text = &new[now.0..now.1];
            self.places.push(at + now.0..at + now.1);
            self.value.push(value_of(text));
            self.changed.push(&old[was.0..was.1] != text);
        }
    }
}

/// Two texts, the later of which may have one line of comment more.
struct Texts<'a> {
    before: Text<'a>,
    after: Text<'a>,
    added: Option<usize>,
}

impl Texts<'_> {
    /// Find the first of some lines of both that are not the same.
    fn first_other(&self, rows: Range<usize>) -> Option<usize> {
        let mut pair = Pair::default();
        rows.into_iter().find(|i| !pair.same(self.before.line(*i), self.after.line(*i)))
    }

    /// Find the line that was added; tell whether it is one of comment alone.
    fn find_added(&mut self, py: Python<'_>) -> PyResult<bool> {
        let mut added = self.before.len();
        for rows in blocks(self.before.len()) {
            py.check_signals()?;
            if let Some(other) = detached(py, || self.first_other(rows))? {
                added = other;
                break;
            }
        }
        self.added = Some(added);
        let mut line = Masked::default();
        Ok(line.read(self.after.line(added)) && line.mask.is_empty())
    }

    /// Read some lines of the earlier text again, None where one says something else.
    fn read(&self, rows: Range<usize>) -> Option<Found> {
        let (mut found, mut pair) = (Found::default(), Pair::default());
        for i in rows {
            let k = i + usize::from(self.added.is_some_and(|added| added <= i));
            let (old, new) = (self.before.line(i), self.after.line(k));
            if !pair.same(old, new) {
                return None;
            }
            found.take(&pair, (old, new), self.after.begin(k));
        }
        Some(found)
    }
}

/// Cut lines into blocks between which signals are heard.
fn blocks(n: usize) -> impl Iterator<Item = Range<usize>> {
    (0..n).step_by(AT_ONCE).map(move |first| first..n.min(first + AT_ONCE))
}

type Column<'py, T> = Bound<'py, PyArray1<T>>;

/// Scan a text that should differ from another in its numbers, and in one line of
/// comment that it may have more.
///
/// Arguments:
///     before, before_starts: The other text, and where its lines start.
///     after, after_starts: The text.
///     count: How many numbers the other one holds, (m).
///
/// Returns: which line is new (-1: none); where numbers stand, what they are worth, and
/// whether they are written otherwise, (m,). None where a line says something else, or
/// holds a string that does not end.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn rescan_lines<'py>(
    py: Python<'py>,
    before: &Bound<'py, PyBytes>,
    before_starts: PyReadonlyArray1<'py, i32>,
    after: &Bound<'py, PyBytes>,
    after_starts: PyReadonlyArray1<'py, i32>,
    count: usize,
) -> PyResult<Option<(i64, Columns<'py>, Column<'py, f64>, Column<'py, bool>)>> {
    let before = Text::new(before.as_bytes(), flat(&before_starts)?)?;
    let after = Text::new(after.as_bytes(), flat(&after_starts)?)?;
    let (n, more) = (before.len(), after.len().wrapping_sub(before.len()));
    let mut texts = Texts { before, after, added: None };
    if texts.before.data.starts_with(MARK) || more > 1 || (more == 1 && !texts.find_added(py)?) {
        return Ok(None);
    }
    let mut places = Spans::for_numbers(count);
    let (mut value, mut changed) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for rows in blocks(n) {
        py.check_signals()?;
        for part in detached(py, || on_cores(rows, LEAST, |rows| texts.read(rows)))? {
            let Some(mut found) = part else { return Ok(None) };
            found.places.iter().for_each(|place| places.push(place.start, place.end));
            value.append(&mut found.value);
            changed.append(&mut found.changed);
        }
    }
    let added = texts.added.map_or(-1, |added| added as i64);
    Ok(Some((added, places.into_arrays(py), value.into_pyarray(py), changed.into_pyarray(py))))
}
