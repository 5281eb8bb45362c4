//! Words of a text, in letters of any size: `postproc.batch.tree`, `.language.marks`.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::rows::detached;

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

/// Bytes that are looked at between two looks at signals.
const BYTES: usize = 1 << 26;

/// Tell whether a text holds a word.
///
/// Arguments:
///     word: In small letters, not empty; that of the text may be of any size.
#[pyfunction]
pub fn holds(py: Python<'_>, data: &Bound<'_, PyBytes>, word: &[u8]) -> PyResult<bool> {
    let text = data.as_bytes();
    let &[small, ..] = word else {
        return Err(PyValueError::new_err("an empty word"));
    };
    let (large, rest) = (small.to_ascii_uppercase(), word.len() - 1);
    for first in (0..text.len()).step_by(BYTES) {
        py.check_signals()?;
        let some = &text[first..text.len().min(first + BYTES + rest)];
        let found = detached(py, || {
            some.windows(word.len())
                .any(|own| (own[0] == small || own[0] == large) && own.eq_ignore_ascii_case(word))
        })?;
        if found {
            return Ok(true);
        }
    }
    Ok(false)
}
