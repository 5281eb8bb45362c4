//! Statements of RAPID, but for their numbers and numbered names: `postproc.language.rapid`.
//!
//! `tests/reference/statements.py` defines with regular expressions where a statement ends.

use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList};

use crate::number::value_of;
use crate::rows::detached;
use crate::text::{
    is, latin_1, number_end, while_is, Interned, DIGIT, FIRST, IN_NAME, MARK, NAME, NUMBER, UNARY,
    WHOLE,
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

    /// Read the next statement; tell whether there is one.
    fn read(&mut self, out: &mut Statement) -> bool {
        out.form.clear();
        out.names.clear();
        out.numbers.clear();
        out.open = None;
        self.pass();
        out.begin = self.at;
        out.end = self.at;
        if self.at == self.data.len() {
            return false;
        }
        if self.data[self.at..].starts_with(HEADER) {
            self.header(out);
        } else {
            let mut now = Progress::default();
            while self.token(out, &mut now) {}
        }
        if self.data[out.begin..out.end].iter().any(|b| matches!(*b, NUMBER | NAME)) {
            out.form.clear();
            out.names.clear();
            out.numbers.clear();
            out.form.push(WHOLE);
            out.form.extend_from_slice(&self.data[out.begin..out.end]);
        }
        true
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

    /// Take a token over; a blank tells words and numbers apart.
    fn push(&mut self, out: &mut Statement, now: &mut Progress, text: &[u8], end: usize) {
        let wordy = |b: u8| b <= NAME || b == b'"' || is(b, IN_NAME);
        if out.form.last().is_some_and(|last| wordy(*last) && wordy(text[0])) {
            out.form.push(b' ');
        }
        out.form.extend_from_slice(text);
        now.before = text[text.len() - 1];
        now.tokens += 1;
        self.at = end;
        out.end = end;
    }
}

type Column<'py, T> = Bound<'py, PyArray1<T>>;

/// Statements that are read between two looks at signals.
const AT_ONCE: usize = 4096;

/// Read the statements of a text.
///
/// Returns: the distinct forms; of every statement its form, where it begins and ends, and
/// from which number and name on those are its own, (n + 1,); where numbers start and end
/// and what they are worth, (m,); the distinct names and those of the statements, (p,);
/// where strings and headers begin that do not end.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn scan_statements<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyBytes>,
) -> PyResult<(
    Bound<'py, PyList>,
    (Column<'py, i32>, Column<'py, i32>, Column<'py, i32>, Column<'py, i32>, Column<'py, i32>),
    (Column<'py, i32>, Column<'py, i32>, Column<'py, f64>),
    (Vec<String>, Column<'py, i32>),
    Vec<usize>,
)> {
    let data = data.as_bytes();
    if data.len() > i32::MAX as usize {
        return Err(PyIndexError::new_err("a text of more than 2 GB"));
    }
    let (mut forms, mut names) = (Interned::default(), Interned::default());
    let (mut form, mut begin, mut finish) = (Vec::new(), Vec::new(), Vec::new());
    let (mut first, mut name_first) = (vec![0_i32], vec![0_i32]);
    let (mut start, mut end, mut value) = (Vec::new(), Vec::new(), Vec::new());
    let (mut name, mut open) = (Vec::new(), Vec::new());
    let mut reader = Reader { data, at: if data.starts_with(MARK) { MARK.len() } else { 0 } };
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
                    start.push(*from as i32);
                    end.push(*to as i32);
                    value.push(value_of(&data[*from..*to]));
                }
                name.extend(one.names.iter().map(|(from, to)| names.of(&data[*from..*to])));
                first.push(start.len() as i32);
                name_first.push(name.len() as i32);
                open.extend(one.open);
            }
            true
        })?;
    }
    let texts = forms.texts.iter().map(|text| PyBytes::new(py, text));
    Ok((
        PyList::new(py, texts)?,
        (
            form.into_pyarray(py),
            begin.into_pyarray(py),
            finish.into_pyarray(py),
            first.into_pyarray(py),
            name_first.into_pyarray(py),
        ),
        (start.into_pyarray(py), end.into_pyarray(py), value.into_pyarray(py)),
        (names.texts.iter().map(|text| latin_1(text)).collect(), name.into_pyarray(py)),
        open,
    ))
}
