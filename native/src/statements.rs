//! Statements, but for their numbers and numbered names: `postproc.language.statement_table`.
//!
//! `tests/reference/statements.py` defines with regular expressions where a statement of
//! RAPID ends, `tests/reference/krl_lines.py` where one of KRL does.

use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList};

use crate::interned::Interned;
use crate::names::NameColumn;
use crate::number::value_of;
use crate::rows::detached;
use crate::spans::{Columns, Spans};
use crate::text::{
    is, number_end, push_hidden, while_is, Masked, DIGIT, FIRST, IN_NAME, MARK, NAME, NUMBER, UNARY,
};

/// Words that begin a statement, wherever they stand: what came before has no end.
const BEGINNING: [&[u8]; 26] = [
    b"MODULE",
    b"ENDMODULE",
    b"PROC",
    b"ENDPROC",
    b"FUNC",
    b"ENDFUNC",
    b"TRAP",
    b"ENDTRAP",
    b"RECORD",
    b"ENDRECORD",
    b"ALIAS",
    b"CONST",
    b"LOCAL",
    b"TASK",
    b"ELSEIF",
    b"ELSE",
    b"ENDIF",
    b"ENDFOR",
    b"ENDWHILE",
    b"TEST",
    b"CASE",
    b"DEFAULT",
    b"ENDTEST",
    b"ERROR",
    b"UNDO",
    b"BACKWARD",
];
/// Words that are a statement.
const ALONE: [&[u8]; 12] = [
    b"ENDMODULE",
    b"ENDPROC",
    b"ENDFUNC",
    b"ENDTRAP",
    b"ENDRECORD",
    b"ELSE",
    b"ENDIF",
    b"ENDFOR",
    b"ENDWHILE",
    b"ENDTEST",
    b"UNDO",
    b"BACKWARD",
];
/// Statements of so many words, and what stands in brackets behind them.
const HEADS: [(&[u8], usize); 6] =
    [(b"MODULE", 2), (b"PROC", 2), (b"FUNC", 3), (b"TRAP", 2), (b"RECORD", 2), (b"ERROR", 1)];
const HEADER: &[u8] = b"%%%";

fn one_of(word: &[u8], words: &[&[u8]]) -> bool {
    words.iter().any(|known| known.eq_ignore_ascii_case(word))
}

fn is_word(word: &[u8], known: &str) -> bool {
    word.eq_ignore_ascii_case(known.as_bytes())
}

fn is_space(byte: u8) -> bool {
    (1..=32).contains(&byte) || byte == 127
}

/// Cuts a text into statements.
trait Cutting {
    /// Read the next statement; tell whether there is one.
    fn read(&mut self, out: &mut Statement) -> bool;
}

/// One statement.
#[derive(Default)]
struct Statement {
    form: Vec<u8>,
    /// Where names begin and end that are taken out.
    names: Vec<(usize, usize)>,
    /// Where numbers begin, their sign included, and end.
    numbers: Vec<(usize, usize)>,
    begin: usize,
    end: usize,
    /// Where a string or a header begins that does not end.
    open: Option<usize>,
}

impl Statement {
    fn clear(&mut self, at: usize) {
        self.form.clear();
        self.names.clear();
        self.numbers.clear();
        self.open = None;
        (self.begin, self.end) = (at, at);
    }

    /// Take a token over; a blank tells words and numbers apart.
    fn push(&mut self, text: &[u8], end: usize) {
        let wordy = |b: u8| b <= NAME || b == b'"' || is(b, IN_NAME);
        if self.form.last().is_some_and(|last| wordy(*last) && wordy(text[0])) {
            self.form.push(b' ');
        }
        push_hidden(&mut self.form, text);
        self.end = end;
    }
}

/// What is known of the statement that is being read.
#[derive(Default)]
struct Progress {
    words: usize,
    tokens: usize,
    /// Its first word, but for LOCAL and TASK: begin and end.
    head: (usize, usize),
    /// LOCAL or TASK, and nothing else, came before.
    scoped: bool,
    depth: usize,
    before: u8,
    sign: Option<(usize, usize)>,
}

struct Reader<'a> {
    data: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    /// Pass blanks, line ends and comments; tell whether a line has ended.
    fn pass(&mut self) -> bool {
        let mut ended = false;
        while let Some(byte) = self.data.get(self.at).copied() {
            if byte == b'!' {
                let rest = &self.data[self.at..];
                self.at +=
                    rest.iter().position(|b| matches!(b, b'\r' | b'\n')).unwrap_or(rest.len());
            } else if is_space(byte) {
                ended |= matches!(byte, b'\r' | b'\n');
                self.at += 1;
            } else {
                break;
            }
        }
        ended
    }

    /// Read the lines between two `%%%`.
    fn header(&mut self, out: &mut Statement) {
        let inside = &self.data[self.at + HEADER.len()..];
        let found = inside.windows(HEADER.len()).position(|three| three == HEADER);
        if found.is_none() {
            out.open = Some(self.at);
        }
        let length = found.map_or(inside.len(), |k| k + HEADER.len());
        self.at += HEADER.len() + length;
        out.end = self.at;
        out.form.extend_from_slice(HEADER);
    }

    /// Read one token of a statement; tell whether more belongs to it.
    fn token(&mut self, out: &mut Statement, now: &mut Progress) -> bool {
        let line_ended = self.pass();
        let Some(byte) = self.data.get(self.at).copied() else { return false };
        let at = self.at;
        let end = if is(byte, DIGIT) || byte == b'.' { number_end(self.data, at) } else { None };
        if let Some(end) = end {
            let (start, length) = now.sign.take().unwrap_or((at, out.form.len()));
            out.form.truncate(length);
            self.push(out, now, &[NUMBER], end);
            out.numbers.push((start, end));
            now.scoped = false;
            return true;
        }
        if is(byte, IN_NAME) {
            return self.word(out, now, line_ended);
        }
        (now.sign, now.scoped) = (None, false);
        match byte {
            b'"' => {
                let end = self.string_end(out);
                let text = &self.data[at..end];
                self.push(out, now, text, end);
                true
            }
            b';' => {
                self.push(out, now, b";", at + 1);
                false
            }
            b':' if self.data.get(at + 1) == Some(&b'=') => {
                self.push(out, now, b":=", at + 2);
                true
            }
            _ => {
                if matches!(byte, b'-' | b'+') && is(now.before, UNARY) {
                    now.sign = Some((at, out.form.len()));
                }
                now.depth += usize::from(byte == b'(');
                self.push(out, now, &[byte], at + 1);
                self.goes_on(byte, now)
            }
        }
    }

    /// Tell whether a statement goes on behind a bracket or a colon.
    fn goes_on(&self, byte: u8, now: &mut Progress) -> bool {
        let head = &self.data[now.head.0..now.head.1];
        match byte {
            b')' => {
                now.depth = now.depth.saturating_sub(1);
                now.depth > 0 || !HEADS.iter().any(|(word, _)| word.eq_ignore_ascii_case(head))
            }
            b':' => {
                let label = now.words == 1 && now.tokens == 2;
                !label && !is_word(head, "CASE") && !is_word(head, "DEFAULT")
            }
            _ => true,
        }
    }

    fn word(&mut self, out: &mut Statement, now: &mut Progress, line_ended: bool) -> bool {
        let (at, data) = (self.at, self.data);
        let end = while_is(data, at, IN_NAME);
        let word = &data[at..end];
        let free = !matches!(now.before, b'\\' | b'.');
        let begins = one_of(word, &BEGINNING)
            || (line_ended && ["IF", "FOR", "WHILE"].iter().any(|known| is_word(word, known)));
        if now.tokens > 0 && free && begins && !now.scoped {
            return false;
        }
        now.sign = None;
        let numbered = is(word[0], FIRST) && word.iter().any(u8::is_ascii_digit);
        if numbered {
            self.push(out, now, &[NAME], end);
            out.names.push((at, end));
        } else {
            self.push(out, now, word, end);
        }
        if now.tokens == 1 || now.scoped {
            now.head = (at, end);
        }
        now.scoped =
            (now.tokens == 1 || now.scoped) && (is_word(word, "LOCAL") || is_word(word, "TASK"));
        now.words += usize::from(!now.scoped);
        if !free || now.scoped {
            return true;
        }
        let head = &data[now.head.0..now.head.1];
        if (now.head == (at, end) && one_of(word, &ALONE))
            || is_word(word, "THEN")
            || is_word(word, "DO")
        {
            return false;
        }
        match HEADS.iter().find(|(known, _)| known.eq_ignore_ascii_case(head)) {
            Some((_, words)) if now.words == *words => self.bracket_follows(),
            _ => true,
        }
    }

    fn bracket_follows(&self) -> bool {
        let mut ahead = Reader { data: self.data, at: self.at };
        ahead.pass();
        self.data.get(ahead.at) == Some(&b'(')
    }

    /// Return where a string ends: two quotes are one inside of it, no line ends in it.
    fn string_end(&self, out: &mut Statement) -> usize {
        let mut at = self.at + 1;
        while let Some(byte) = self.data.get(at).copied() {
            match byte {
                b'"' if self.data.get(at + 1) == Some(&b'"') => at += 2,
                b'"' => return at + 1,
                b'\r' | b'\n' => break,
                _ => at += 1,
            }
        }
        out.open.get_or_insert(self.at);
        at
    }

    /// Take a token over.
    fn push(&mut self, out: &mut Statement, now: &mut Progress, text: &[u8], end: usize) {
        out.push(text, end);
        now.before = text[text.len() - 1];
        now.tokens += 1;
        self.at = end;
    }
}

impl Cutting for Reader<'_> {
    fn read(&mut self, out: &mut Statement) -> bool {
        self.pass();
        out.clear(self.at);
        if self.at == self.data.len() {
            return false;
        }
        if self.data[self.at..].starts_with(HEADER) {
            self.header(out);
        } else {
            let mut now = Progress::default();
            while self.token(out, &mut now) {}
        }
        true
    }
}

/// Words of KRL that hold a digit and are no names of a user's.
const KRL_WORDS: [&[u8]; 15] = [
    b"E6POS", b"E6AXIS", b"A1", b"A2", b"A3", b"A4", b"A5", b"A6", b"E1", b"E2", b"E3", b"E4",
    b"E5", b"E6", b"STOOL2",
];

/// Reads KRL, where a statement ends with its line.
struct KrlReader<'a> {
    data: &'a [u8],
    at: usize,
    /// Brackets that are open.
    open: Vec<u8>,
    /// The last token is the name of a component in an aggregate.
    component: bool,
    before: u8,
    sign: Option<(usize, usize)>,
}

impl<'a> KrlReader<'a> {
    fn new(data: &'a [u8], at: usize) -> Self {
        KrlReader { data, at, open: Vec::new(), component: false, before: 0, sign: None }
    }
}

impl KrlReader<'_> {
    /// Pass blanks and comments, and line ends between statements.
    fn pass(&mut self, lines: bool) {
        while let Some(byte) = self.data.get(self.at).copied() {
            let ends = matches!(byte, b'\r' | b'\n');
            if byte == b';' {
                self.pass_line();
            } else if (is_space(byte) && !ends) || (ends && lines) {
                self.at += 1;
            } else {
                break;
            }
        }
    }

    fn pass_line(&mut self) {
        let rest = &self.data[self.at..];
        self.at += rest.iter().position(|b| matches!(b, b'\r' | b'\n')).unwrap_or(rest.len());
    }

    fn push(&mut self, out: &mut Statement, text: &[u8], end: usize) {
        out.push(text, end);
        self.before = text[text.len() - 1];
        self.at = end;
    }

    /// Read one token of a statement; tell whether there was one.
    fn token(&mut self, out: &mut Statement) -> bool {
        self.pass(false);
        let Some(byte) = self.data.get(self.at).copied() else { return false };
        if matches!(byte, b'\r' | b'\n') {
            return false;
        }
        let at = self.at;
        if let Some(end) = self.number(byte) {
            let (start, length) = self.sign.take().unwrap_or((at, out.form.len()));
            out.form.truncate(length);
            self.push(out, &[NUMBER], end);
            out.numbers.push((start, end));
            self.component = false;
        } else if is(byte, IN_NAME) {
            self.word(out);
        } else {
            self.other(out, byte);
        }
        true
    }

    /// Return where a number ends, quoted ones (`'B010'`, `'HFF'`) included.
    fn number(&self, byte: u8) -> Option<usize> {
        if is(byte, DIGIT) || byte == b'.' {
            return number_end(self.data, self.at);
        }
        let inside = self.data[self.at..].strip_prefix(b"'")?;
        let length = inside.iter().position(|b| !b.is_ascii_hexdigit() && !b"hH".contains(b))?;
        let whole = &self.data[self.at..self.at + length + 1];
        let closed = inside[length] == b'\'' && !value_of(&[whole, b"'"].concat()).is_nan();
        closed.then_some(self.at + length + 2)
    }

    fn word(&mut self, out: &mut Statement) {
        let (at, data) = (self.at, self.data);
        let end = while_is(data, at, IN_NAME);
        let word = &data[at..end];
        let named = matches!(self.before, b'{' | b',' | b':') && self.open.last() == Some(&b'{');
        let numbered =
            is(word[0], FIRST) && word.iter().any(u8::is_ascii_digit) && !one_of(word, &KRL_WORDS);
        if numbered {
            self.push(out, &[NAME], end);
            out.names.push((at, end));
        } else {
            self.push(out, word, end);
        }
        (self.sign, self.component) = (None, named);
    }

    fn other(&mut self, out: &mut Statement, byte: u8) {
        let at = self.at;
        let signs = matches!(byte, b'-' | b'+') && (self.component || is(self.before, UNARY));
        self.sign = signs.then_some((at, out.form.len()));
        match byte {
            b'{' | b'[' | b'(' => self.open.push(byte),
            b'}' | b']' | b')' => drop(self.open.pop()),
            _ => {}
        }
        let inside = &self.data[at + 1..];
        let end = match byte {
            b'"' => inside.iter().position(|b| matches!(b, b'"' | b'\r' | b'\n')),
            _ => None,
        };
        let closed = end.is_some_and(|k| inside[k] == b'"');
        let end = match (byte, end) {
            (b'"', Some(k)) => at + 1 + k + usize::from(closed),
            (b'"', None) => self.data.len(),
            _ => at + 1,
        };
        if byte == b'"' && !closed {
            out.open.get_or_insert(at);
        }
        let text = &self.data[at..end];
        self.push(out, text, end);
        self.component = false;
    }
}

impl Cutting for KrlReader<'_> {
    fn read(&mut self, out: &mut Statement) -> bool {
        self.pass(true);
        out.clear(self.at);
        let Some(byte) = self.data.get(self.at).copied() else { return false };
        self.open.clear();
        (self.component, self.before, self.sign) = (false, 0, None);
        if byte == b'&' {
            self.pass_line();
            out.form.push(b'&');
            out.end = self.at;
        } else {
            while self.token(out) {}
        }
        true
    }
}

type Column<'py, T> = Bound<'py, PyArray1<T>>;

/// Statements that are read between two looks at signals.
const AT_ONCE: usize = 4096;

/// Mask the numbers of one line of KRL, and nothing else of it.
pub fn mask_krl_line(line: &[u8], masked: &mut Masked) {
    let mut one = Statement::default();
    KrlReader::new(line, 0).read(&mut one);
    masked.mask.clear();
    masked.comment = None;
    let mut at = 0;
    for (from, to) in &one.numbers {
        masked.mask.extend_from_slice(&line[at..*from]);
        masked.mask.push(NUMBER);
        at = *to;
    }
    masked.mask.extend_from_slice(&line[at..]);
    masked.numbers = one.numbers;
}

type Scanned<'py> = (
    Bound<'py, PyList>,
    (Column<'py, i32>, Column<'py, i32>, Column<'py, i32>, Column<'py, i32>, Column<'py, i32>),
    (Columns<'py>, Column<'py, f64>),
    (NameColumn, Column<'py, i32>),
    Vec<usize>,
);

/// Read the statements of a text in RAPID.
///
/// Returns: the distinct forms; of every statement its form, where it begins and ends, and
/// from which number and name on those are its own, (n + 1,); where numbers stand and what
/// they are worth, (m,); the distinct names and those of the statements, (p,); where
/// strings and headers begin that do not end.
#[pyfunction]
pub fn scan_statements<'py>(py: Python<'py>, data: &Bound<'py, PyBytes>) -> PyResult<Scanned<'py>> {
    let data = data.as_bytes();
    scanned(py, data, Reader { data, at: after_mark(data) })
}

/// Read the statements of a text in KRL; as `scan_statements`.
#[pyfunction]
pub fn scan_krl<'py>(py: Python<'py>, data: &Bound<'py, PyBytes>) -> PyResult<Scanned<'py>> {
    let data = data.as_bytes();
    scanned(py, data, KrlReader::new(data, after_mark(data)))
}

fn after_mark(data: &[u8]) -> usize {
    if data.starts_with(MARK) {
        MARK.len()
    } else {
        0
    }
}

fn scanned<'py, R: Cutting + Send>(
    py: Python<'py>,
    data: &[u8],
    mut reader: R,
) -> PyResult<Scanned<'py>> {
    if data.len() > i32::MAX as usize {
        return Err(PyIndexError::new_err("a text of more than 2 GB"));
    }
    let (mut forms, mut names) = (Interned::default(), Interned::default());
    let (mut form, mut begin, mut finish) = (Vec::new(), Vec::new(), Vec::new());
    let (mut first, mut name_first) = (vec![0_i32], vec![0_i32]);
    let (mut places, mut value) = (Spans::default(), Vec::new());
    let (mut name, mut open) = (Vec::new(), Vec::new());
    let mut one = Statement::default();
    let mut more = true;
    while more {
        py.check_signals()?;
        more = detached(py, || {
            for _ in 0..AT_ONCE {
                if !reader.read(&mut one) {
                    return false;
                }
                form.push(forms.of(&one.form));
                begin.push(one.begin as i32);
                finish.push(one.end as i32);
                for (from, to) in &one.numbers {
                    places.push(*from, *to);
                    value.push(value_of(&data[*from..*to]));
                }
                name.extend(one.names.iter().map(|(from, to)| names.of(&data[*from..*to])));
                first.push(places.len() as i32);
                name_first.push(name.len() as i32);
                open.extend(one.open);
            }
            true
        })?;
        if more && form.len() == AT_ONCE {
            // Of all that is still to come at once: what grows by and by leaves holes.
            let room = |length: usize| length * (data.len() - one.end) / one.end;
            let statements = room(form.len());
            for own in [&mut form, &mut begin, &mut finish, &mut first, &mut name_first] {
                own.reserve(statements);
            }
            places.reserve(room(value.len()));
            value.reserve(room(value.len()));
            name.reserve(room(name.len()));
        }
    }
    let texts = forms.texts().map(|text| PyBytes::new(py, text));
    Ok((
        PyList::new(py, texts)?,
        (
            form.into_pyarray(py),
            begin.into_pyarray(py),
            finish.into_pyarray(py),
            first.into_pyarray(py),
            name_first.into_pyarray(py),
        ),
        (places.into_arrays(py), value.into_pyarray(py)),
        (NameColumn::of_latin_1(names), name.into_pyarray(py)),
        open,
    ))
}
