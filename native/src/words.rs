//! Words of a text, in letters of any size: `postproc.batch.tree`, `.language.marks`.

use std::ops::Range;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::rows::{at_best, detached, on_cores};

/// Lines that are looked at between two looks at signals.
const AT_ONCE: usize = 1 << 20;

/// Find the lines that begin, behind blanks and tabs, with one of some words.
///
/// Arguments:
///     words: In small letters; those of the text may be of any size.
///
/// Returns: 1-based lines and their texts.
#[pyfunction]
pub fn lines_beginning<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyBytes>,
    words: Vec<Vec<u8>>,
) -> PyResult<Vec<(usize, Bound<'py, PyBytes>)>> {
    let text = data.as_bytes();
    let mut lines = text.split_inclusive(|b| *b == b'\n').enumerate();
    let (mut found, mut more) = (Vec::new(), true);
    while more {
        py.check_signals()?;
        more = detached(py, || {
            let mut seen = 0;
            for (number, line) in lines.by_ref().take(AT_ONCE) {
                seen += 1;
                if begins(line, &words) {
                    found.push((number + 1, line));
                }
            }
            seen == AT_ONCE
        })?;
    }
    Ok(found.into_iter().map(|(number, line)| (number, PyBytes::new(py, line))).collect())
}

fn begins(line: &[u8], words: &[Vec<u8>]) -> bool {
    let at = line.iter().position(|b| !matches!(b, b' ' | b'\t')).unwrap_or(line.len());
    let begin = |word: &[u8]| line.get(at..at + word.len());
    words.iter().any(|word| begin(word).is_some_and(|b| b.eq_ignore_ascii_case(word)))
}

/// Bytes that are looked at between two looks at signals, that are worth a thread, and
/// that are looked at side by side.
const BYTES: usize = 1 << 26;
const LARGE: usize = 1 << 22;
const SIDE: usize = 64;

/// Tell whether a text holds a word.
///
/// Arguments:
///     word: In small letters, not empty; that of the text may be of any size.
#[pyfunction]
pub fn holds(py: Python<'_>, data: &Bound<'_, PyBytes>, word: &[u8]) -> PyResult<bool> {
    let text = data.as_bytes();
    let Some(rest) = word.len().checked_sub(1) else {
        return Err(PyValueError::new_err("an empty word"));
    };
    for first in (0..text.len()).step_by(BYTES) {
        py.check_signals()?;
        let places = first..text.len().min(first + BYTES);
        let part = |own: Range<usize>| {
            let some = &text[own.start..text.len().min(own.end + rest)];
            at_best(|| is_in(some, word))
        };
        if detached(py, || on_cores(places, LARGE, part))?.contains(&true) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Look where both ends of a word may stand, many places at once, and read it there.
#[inline(always)]
fn is_in(text: &[u8], word: &[u8]) -> bool {
    let (first, last) = (word[0] | CASE, word[word.len() - 1] | CASE);
    let places = (text.len() + 1).saturating_sub(word.len());
    (0..places).step_by(SIDE).any(|at| {
        let end = places.min(at + SIDE);
        let (begins, ends) = (&text[at..end], &text[at + word.len() - 1..]);
        let pairs = begins.iter().zip(ends);
        pairs.fold(false, |any, (a, b)| any | ((a | CASE == first) & (b | CASE == last)))
            && text[at..end + word.len() - 1]
                .windows(word.len())
                .any(|own| own.eq_ignore_ascii_case(word))
    })
}

/// The bit that tells small letters from large ones.
const CASE: u8 = 0x20;
