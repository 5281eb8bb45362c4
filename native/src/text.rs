//! Lines of a file, but for their numbers and numbered names: `postproc.language.lexer`.
//!
//! `tests/reference/text.py` defines with regular expressions what is a number, a string,
//! a comment and a name, one line at a time.

use std::borrow::Cow;

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList};

use crate::interned::Interned;
use crate::names::NameColumn;
use crate::number::value_of;
use crate::rows::{detached, each, flat};
use crate::spans::{Columns, Spans};

pub const NUMBER: u8 = 0; // stands for a number, in a mask
pub const NAME: u8 = 1; // for a numbered name, in a form
pub const HIDDEN: u8 = b'\r'; // for that byte itself in a string, which no grammar reads then
pub const MARK: &[u8] = b"\xef\xbb\xbf"; // of UTF-8

// What a byte can be.
const BLANK: u16 = 1;
pub const DIGIT: u16 = 1 << 1;
const LETTER: u16 = 1 << 2; // of the alphabet, _ and $
pub const UNARY: u16 = 1 << 3; // before a sign that belongs to its number
const IDLE: u16 = 1 << 4; // before a blank that says nothing
const NO_POINT: u16 = 1 << 5; // before a dot that begins no number
pub const FIRST: u16 = 1 << 6; // of a name
pub const IN_NAME: u16 = 1 << 7; // a letter of any language, a digit or _
const WORD: u16 = DIGIT | LETTER;

const fn table() -> [u16; 256] {
    let mut out = [0; 256];
    let mut c = 0;
    while c < 256 {
        let b = c as u8;
        let (letter, digit) = (b.is_ascii_alphabetic(), b.is_ascii_digit());
        let mut kind = 0;
        if (c >= 1 && c <= 32 && b != b'\r' && b != b'\n') || c == 127 {
            kind |= BLANK;
        }
        if digit {
            kind |= DIGIT;
        }
        if letter || b == b'_' || b == b'$' {
            kind |= LETTER;
        }
        if letter || b == b'_' {
            kind |= FIRST;
        }
        let foreign = matches!(c, 0xaa | 0xb2 | 0xb3 | 0xb5 | 0xb9 | 0xba | 0xbc..=0xbe)
            || (c >= 0xc0 && c != 0xd7 && c != 0xf7);
        if letter || digit || b == b'_' || foreign {
            kind |= IN_NAME;
        }
        if matches!(
            b,
            b'(' | b','
                | b'{'
                | b'['
                | b'='
                | b'<'
                | b'>'
                | b'*'
                | b'/'
                | b':'
                | b'@'
                | b'#'
                | b'&'
                | b'+'
        ) {
            kind |= UNARY;
        }
        if matches!(b, b',' | b'(' | b'{') {
            kind |= IDLE;
        }
        if kind & WORD != 0 || matches!(b, b'.' | b']' | b')') {
            kind |= NO_POINT;
        }
        out[c] = kind;
        c += 1;
    }
    out
}

static KIND: [u16; 256] = table();

pub fn is(byte: u8, kind: u16) -> bool {
    KIND[byte as usize] & kind != 0
}

/// What a quote ends with: the next one that no backslash escapes, or just the next one.
#[derive(Clone, Copy, PartialEq)]
enum Strings {
    Escaped,
    Plain,
}

/// Return where a string ends that begins at a quote.
fn string_end(line: &[u8], at: usize, strings: Strings) -> Option<usize> {
    let quote = line[at];
    let mut i = at + 1;
    while i < line.len() {
        if line[i] == quote {
            return Some(i + 1);
        }
        i += if line[i] == b'\\' && strings == Strings::Escaped { 2 } else { 1 };
    }
    None
}

/// Take a token over; a string may hold the byte that stands for a name.
pub fn push_hidden(out: &mut Vec<u8>, token: &[u8]) {
    let from = out.len();
    out.extend_from_slice(token);
    if matches!(token[0], b'\'' | b'"') {
        out[from..].iter_mut().filter(|b| **b == NAME).for_each(|b| *b = HIDDEN);
    }
}

pub fn while_is(line: &[u8], mut at: usize, kind: u16) -> usize {
    while at < line.len() && is(line[at], kind) {
        at += 1;
    }
    at
}

/// Return where a number ends that may begin at a digit or dot.
pub fn number_end(line: &[u8], at: usize) -> Option<usize> {
    let next = |i: usize| line.get(i).copied().unwrap_or(0);
    let mut end = at;
    if line[at] == b'0' {
        let digits: fn(u8) -> bool = match next(at + 1) {
            b'x' | b'X' => |b| b.is_ascii_hexdigit(),
            b'o' | b'O' => |b| (b'0'..=b'7').contains(&b),
            b'b' | b'B' => |b| b == b'0' || b == b'1',
            _ => |_| false,
        };
        let count = line[at + 1..].iter().skip(1).take_while(|b| digits(**b)).count();
        if count > 0 {
            return Some(at + 2 + count);
        }
    }
    if line[at] == b'.' {
        if (at > 0 && is(line[at - 1], NO_POINT)) || !is(next(at + 1), DIGIT) {
            return None;
        }
        end = while_is(line, at + 1, DIGIT);
    } else {
        end = while_is(line, end, DIGIT);
        if next(end) == b'.' && next(end + 1) != b'.' {
            end = while_is(line, end + 1, DIGIT);
        }
    }
    if matches!(next(end), b'e' | b'E') {
        let signed = end + 1 + usize::from(matches!(next(end + 1), b'-' | b'+'));
        if is(next(signed), DIGIT) {
            end = while_is(line, signed, DIGIT);
        }
    }
    Some(end)
}

/// One physical line with its numbers masked.
#[derive(Default)]
pub struct Masked {
    pub mask: Vec<u8>,
    /// Where numbers begin, their sign included, and end.
    pub numbers: Vec<(usize, usize)>,
    pub comment: Option<usize>,
}

impl Masked {
    /// Mask a line; tell whether all of its strings end.
    pub fn read(&mut self, line: &[u8]) -> bool {
        self.read_with(line, Strings::Escaped)
            || (line.contains(&b'\\') && self.read_with(line, Strings::Plain))
    }

    fn read_with(&mut self, line: &[u8], strings: Strings) -> bool {
        self.mask.clear();
        self.numbers.clear();
        self.comment = None;
        let mut before = 0_u8; // last byte of code, as its mask has it
        let mut begun = false; // there is code before
        let mut sign: Option<(usize, usize)> = None; // that awaits a number: line, mask
        let mut idle = true; // a blank here says nothing
        let mut at = 0;
        while at < line.len() {
            let byte = line[at];
            let kind = KIND[byte as usize];
            if kind & BLANK != 0 {
                if !idle {
                    self.mask.push(b' ');
                }
                idle = true;
                at = while_is(line, at, BLANK);
                continue;
            }
            if byte == b'-' && line.get(at + 1) == Some(&b'-') {
                self.comment = Some(at);
                return true;
            }
            let number =
                if kind & DIGIT != 0 || byte == b'.' { number_end(line, at) } else { None };
            if let Some(end) = number {
                let (start, length) = sign.take().unwrap_or((at, self.mask.len()));
                self.mask.truncate(length);
                self.mask.push(NUMBER);
                self.numbers.push((start, end));
                (before, idle, at) = (NUMBER, false, end);
            } else {
                let end = match byte {
                    b'\'' => match string_end(line, at, strings) {
                        Some(end) => end,
                        None => return self.unterminated(),
                    },
                    b'"' => match string_end(line, at, Strings::Escaped) {
                        Some(end) => end,
                        None => return self.unterminated(),
                    },
                    _ if kind & WORD != 0 => while_is(line, at, WORD),
                    _ => at + 1,
                };
                let unary = !begun || is(before, UNARY);
                let is_sign = matches!(byte, b'-' | b'+') && unary;
                sign = is_sign.then_some((at, self.mask.len()));
                push_hidden(&mut self.mask, &line[at..end]);
                before = line[end - 1];
                idle = end == at + 1 && kind & IDLE != 0;
                at = end;
            }
            begun = true;
        }
        true
    }

    fn unterminated(&mut self) -> bool {
        self.mask.clear();
        self.numbers.clear();
        false
    }

    /// Take the numbered names out of the mask.
    pub fn form(&self, form: &mut Vec<u8>, mut name: impl FnMut(&[u8])) {
        let mask = &self.mask[..];
        form.clear();
        let mut at = 0;
        while at < mask.len() {
            let byte = mask[at];
            let mut end = at + 1;
            if byte == b'\'' {
                end = string_end(mask, at, Strings::Escaped)
                    .or_else(|| string_end(mask, at, Strings::Plain))
                    .unwrap_or(end);
            } else if byte == b'"' {
                end = string_end(mask, at, Strings::Plain).unwrap_or(end);
            } else if is(byte, IN_NAME) {
                end = while_is(mask, at, IN_NAME);
                let free = at == 0 || mask[at - 1] != b'$';
                let numbered = mask[at..end].iter().any(u8::is_ascii_digit);
                if is(byte, FIRST) && free && numbered && !is_label(mask, end) {
                    name(&mask[at..end]);
                    form.push(NAME);
                    at = end;
                    continue;
                }
            }
            form.extend_from_slice(&mask[at..end]);
            at = end;
        }
    }
}

/// Tell whether a name that ends here is a label.
fn is_label(mask: &[u8], end: usize) -> bool {
    let behind = mask[end..].iter().position(|b| *b != b' ').map_or(mask.len(), |k| end + k);
    mask[behind..].starts_with(b"::")
}

pub fn latin_1(text: &[u8]) -> String {
    text.iter().map(|b| *b as char).collect()
}

/// Bytes that are looked at together for the end of a line.
const ENDLESS: usize = 32;

/// Tell whether another line begins behind a byte.
fn ends_line(data: &[u8], i: usize) -> bool {
    let Some(next) = data.get(i + 1) else { return false };
    data[i] == b'\n' || (data[i] == b'\r' && *next != b'\n')
}

/// Find where lines start, (n,): CR, LF and CRLF end a line.
#[pyfunction]
pub fn line_starts<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyBytes>,
) -> PyResult<Bound<'py, PyArray1<i32>>> {
    let data = data.as_bytes();
    let starts = detached(py, || {
        let mut starts = vec![0_i32];
        for (nth, block) in data.chunks(ENDLESS).enumerate() {
            // Without a branch for every byte: most blocks hold no end of a line.
            if block.iter().fold(false, |found, b| found | (*b == b'\n') | (*b == b'\r')) {
                let first = nth * ENDLESS;
                let ends = (first..first + block.len()).filter(|i| ends_line(data, *i));
                starts.extend(ends.map(|i| i as i32 + 1));
            }
        }
        starts
    })?;
    Ok(starts.into_pyarray(py))
}

type Column<'py, T> = Bound<'py, PyArray1<T>>;

/// A text and where its lines begin.
pub struct Text<'a> {
    pub data: &'a [u8],
    starts: &'a [i32],
}

impl<'a> Text<'a> {
    /// Take where lines start, or refuse it; offsets are told in 31 bits.
    pub fn new(data: &'a [u8], starts: &'a [i32]) -> PyResult<Self> {
        let last = starts.last().map_or(0, |at| *at as usize);
        let falls = starts.windows(2).any(|two| two[0] > two[1]);
        let negative = starts.first().is_some_and(|at| *at < 0);
        if falls || negative || last > data.len() || data.len() > i32::MAX as usize {
            return Err(PyIndexError::new_err("lines that are not there"));
        }
        Ok(Text { data, starts })
    }

    pub fn len(&self) -> usize {
        self.starts.len()
    }

    /// Return where a line begins; behind the last one, where the text ends.
    pub fn begin(&self, i: usize) -> usize {
        self.starts.get(i).map_or(self.data.len(), |at| *at as usize)
    }

    /// Return the first line without its end, and blanks for a byte order mark.
    pub fn unmarked(&self) -> Cow<'a, [u8]> {
        let line = if self.len() == 0 { b"" } else { self.line(0) };
        match line.strip_prefix(MARK) {
            Some(rest) => Cow::Owned([b"   ", rest].concat()),
            None => Cow::Borrowed(line),
        }
    }

    /// Return a line without its end.
    pub fn line(&self, i: usize) -> &'a [u8] {
        without_end(&self.data[self.begin(i)..self.begin(i + 1)])
    }
}

/// Return a line without its end.
fn without_end(mut line: &[u8]) -> &[u8] {
    while let [rest @ .., b'\r' | b'\n'] = line {
        line = rest;
    }
    line
}

/// Scan the physical lines of a text, given where they start, (n,).
///
/// Returns: the distinct masks; of every line its mask, where its comment starts (-1:
/// nowhere), and from which number and name on those are its own, (n + 1,); where numbers
/// stand and what they are worth, (m,); the distinct names and those of the lines,
/// (p,); the lines (from 0) with a string that does not end.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn scan_lines<'py>(
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
    let (mut masks, mut names) = (Interned::default(), Interned::default());
    let (mut mask, mut comment) = (Vec::new(), Vec::new());
    let (mut first, mut name_first) = (vec![0_i32], vec![0_i32]);
    let (mut places, mut value) = (Spans::default(), Vec::new());
    let (mut name, mut open) = (Vec::new(), Vec::new());
    let (mut line, mut form) = (Masked::default(), Vec::new());
    let first_line = lines.unmarked();
    each(py, lines.len(), |i| {
        let at = lines.begin(i);
        let text = if i == 0 { &first_line[..] } else { lines.line(i) };
        if !line.read(text) {
            open.push(i);
        }
        line.form(&mut form, |text| name.push(names.of(text)));
        mask.push(masks.of(&form));
        comment.push(line.comment.map_or(-1, |c| (at + c) as i32));
        for (from, to) in &line.numbers {
            places.push(at + from, at + to);
            value.push(value_of(&text[*from..*to]));
        }
        first.push(places.len() as i32);
        name_first.push(name.len() as i32);
    })?;
    let texts = masks.texts().map(|text| PyBytes::new(py, text));
    Ok((
        PyList::new(py, texts)?,
        (
            mask.into_pyarray(py),
            comment.into_pyarray(py),
            first.into_pyarray(py),
            name_first.into_pyarray(py),
        ),
        (places.into_arrays(py), value.into_pyarray(py)),
        (NameColumn::of_latin_1(names), name.into_pyarray(py)),
        open,
    ))
}
