//! Logical lines of PDL2, which statements may go on over, and which may open a block
//! behind another one: `postproc.language.text.statement_table`.
//!
//! `tests/reference/logical.py` defines both with regular expressions.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList};

use crate::interned::Interned;
use crate::names::NameColumn;
use crate::number::value_of;
use crate::rows::{each, flat};
use crate::spans::{Columns, Spans};
use crate::text::{Masked, Text, NAME, NUMBER};

const BLOCKS: [&str; 5] = ["IF", "SELECT", "FOR", "WHILE", "CONDITION"];
const CLOSED: [&str; 5] = ["ENDIF", "ENDSELECT", "ENDFOR", "ENDWHILE", "ENDCONDITION"];
const CLAUSES: [&str; 7] = ["WITH", "ADVANCE", "TIL", "VIA", "SYNCMOVE", "CONDITION", "$"];

fn in_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_'
}

fn skip(text: &[u8]) -> &[u8] {
    let blanks = text.iter().take_while(|b| **b == b' ').count();
    &text[blanks..]
}

/// Return what stands behind some letters, in any case, that a text begins with.
fn behind<'a>(text: &'a [u8], letters: &str) -> Option<&'a [u8]> {
    let head = text.get(..letters.len())?;
    head.eq_ignore_ascii_case(letters.as_bytes()).then(|| &text[letters.len()..])
}

/// Tell whether a text begins with one of some words.
fn begins(text: &[u8], words: &[&str]) -> bool {
    let ends = |rest: &[u8]| !rest.first().is_some_and(|b| in_word(*b));
    words.iter().any(|word| behind(text, word).is_some_and(ends))
}

/// Tell whether a line may go on in the next one: a move, or OPEN, up to a comma.
fn opens(line: &[u8]) -> bool {
    const WORDS: [&str; 3] = ["MOVE", "MOVEFLY", "OPEN"];
    let letters = line.iter().take_while(|b| in_word(**b)).count();
    let labelled = skip(&line[letters..]).strip_prefix(b"::").map(skip);
    let own = letters > 0 && labelled.is_some_and(|rest| begins(rest, &WORDS));
    line.ends_with(b",") && (own || begins(line, &WORDS))
}

/// Return what stands behind round brackets, which may hold strings and others.
fn behind_brackets(text: &[u8]) -> Option<&[u8]> {
    let mut rest = text.strip_prefix(b"(")?;
    loop {
        let (byte, inside) = rest.split_first()?;
        rest = match byte {
            b')' => return Some(inside),
            b'\'' => &inside[inside.iter().position(|b| *b == b'\'')? + 1..],
            b'(' => {
                let end = inside.iter().position(|b| matches!(b, b'(' | b')'))?;
                inside[end..].strip_prefix(b")")?
            }
            _ => inside,
        };
    }
}

/// Find where CASE or ELSE ends, and where the block begins that opens behind it.
fn divide(line: &[u8]) -> Option<(usize, usize)> {
    let head = match behind(line, "CASE") {
        Some(rest) => behind_brackets(skip(rest))?,
        None => behind(line, "ELSE")?,
    };
    let rest = skip(head).strip_prefix(b":")?;
    let block = skip(rest);
    let repeats = behind(block, "REPEAT").is_some_and(|r| matches!(skip(r), b"" | b";"));
    let closed = (0..block.len())
        .any(|i| (i == 0 || !in_word(block[i - 1])) && begins(&block[i..], &CLOSED));
    let found = (repeats || begins(block, &BLOCKS)) && !closed;
    found.then(|| (line.len() - rest.len(), line.len() - block.len()))
}

/// A statement, as far as its lines have been read.
#[derive(Default)]
struct Statement {
    form: Vec<u8>,
    line: i32,
    number: usize,
    name: usize,
    /// The next line may belong to it.
    open: bool,
}

impl Statement {
    /// Take a line over if it belongs to the statement.
    fn take(&mut self, line: &[u8]) -> bool {
        let closes = begins(line, &["ENDMOVE", "ENDOPEN"]);
        let goes_on = if self.form.ends_with(b",") {
            CLAUSES.iter().any(|clause| behind(line, clause).is_some())
        } else {
            begins(line, &["WITH", "SYNCMOVE", "SYNCMOVEFLY"])
        };
        if !(self.open && (closes || goes_on)) {
            return false;
        }
        self.form.push(b' ');
        self.form.extend_from_slice(line);
        self.open = !closes;
        true
    }
}

/// The rows that statements are.
#[derive(Default)]
struct Rows {
    forms: Interned,
    form: Vec<i32>,
    line: Vec<i32>,
    first: Vec<i32>,
    name: Vec<i32>,
}

impl Rows {
    /// Enter a statement: one row, or two where a block opens behind CASE or ELSE.
    fn enter(&mut self, one: &Statement) {
        if one.form.is_empty() {
            return;
        }
        let (end, block) = divide(&one.form).unwrap_or((one.form.len(), one.form.len()));
        let count = |mark: u8| one.form[..end].iter().filter(|b| **b == mark).count();
        self.push(&one.form[..end], one.line, one.number, one.name);
        if block < one.form.len() {
            let (number, name) = (one.number + count(NUMBER), one.name + count(NAME));
            self.push(&one.form[block..], one.line, number, name);
        }
    }

    fn push(&mut self, form: &[u8], line: i32, number: usize, name: usize) {
        self.form.push(self.forms.of(form));
        self.line.push(line);
        self.first.push(number as i32);
        self.name.push(name as i32);
    }
}

type Column<'py, T> = Bound<'py, PyArray1<T>>;

/// Read the logical lines of a text, given where its physical lines start, (n,).
///
/// Returns: the distinct forms; of every logical line its form, its physical line from 1
/// on, and its first name, (k,), and its first number, (k + 1,); where numbers stand and
/// what they are worth, (m,); the distinct names and those of the lines, (p,); the
/// physical lines (from 0) with a string that does not end.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn scan_logical_lines<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyBytes>,
    starts: PyReadonlyArray1<'py, i32>,
) -> PyResult<(
    Bound<'py, PyList>,
    (Column<'py, i32>, Column<'py, i32>, Column<'py, i32>, Column<'py, i32>),
    (Columns<'py>, Column<'py, f64>),
    (NameColumn, Column<'py, i32>),
    Vec<usize>,
)> {
    let lines = Text::new(data.as_bytes(), flat(&starts)?)?;
    let (mut rows, mut one) = (Rows::default(), Statement::default());
    let (mut places, mut value) = (Spans::default(), Vec::new());
    let (mut names, mut name) = (Interned::default(), Vec::new());
    let (mut line, mut form, mut open) = (Masked::default(), Vec::new(), Vec::new());
    let first_line = lines.unmarked();
    each(py, lines.len(), |i| {
        let text = if i == 0 { &first_line[..] } else { lines.line(i) };
        if !line.read(text) {
            open.push(i);
        }
        let before = (places.len(), name.len());
        line.form(&mut form, |text| name.push(names.of(text)));
        for (from, to) in &line.numbers {
            places.push(lines.begin(i) + from, lines.begin(i) + to);
            value.push(value_of(&text[*from..*to]));
        }
        let code = form.strip_suffix(b" ").unwrap_or(&form);
        if code.is_empty() || one.take(code) {
            return;
        }
        rows.enter(&one);
        let (number, name) = before;
        one =
            Statement { form: code.to_vec(), line: i as i32 + 1, number, name, open: opens(code) };
    })?;
    rows.enter(&one);
    rows.first.push(places.len() as i32);
    let texts = rows.forms.texts().map(|text| PyBytes::new(py, text));
    Ok((
        PyList::new(py, texts)?,
        (
            rows.form.into_pyarray(py),
            rows.line.into_pyarray(py),
            rows.name.into_pyarray(py),
            rows.first.into_pyarray(py),
        ),
        (places.into_arrays(py), value.into_pyarray(py)),
        (NameColumn::of_latin_1(names), name.into_pyarray(py)),
        open,
    ))
}
