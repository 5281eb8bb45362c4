//! Numbers in texts, read and written: `postproc.language.lexer` and `.rewrite`.

use std::io::Write;

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::rows::{each, flat, same_length};

const EXACT: usize = 15; // digits of a number that is exact as a float
const TENS: [f64; EXACT + 1] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// Drop the sign of a number and the blanks behind it.
fn unsigned(text: &[u8]) -> &[u8] {
    let skipped = |b: &u8| matches!(*b, b'-' | b'+' | 1..=32 | 127);
    &text[text.iter().take_while(|b| skipped(b)).count()..]
}

/// Return the value of a number as it is written, NaN where it is none.
pub fn value_of(text: &[u8]) -> f64 {
    let digits = unsigned(text);
    let size = plain(digits).unwrap_or_else(|| match digits {
        [b'0', b'x' | b'X', rest @ ..] => whole(rest, 16),
        [b'0', b'o' | b'O', rest @ ..] => whole(rest, 8),
        [b'0', b'b' | b'B', rest @ ..] => whole(rest, 2),
        [b'\'', b'h' | b'H', rest @ .., b'\''] => whole(rest, 16),
        [b'\'', b'b' | b'B', rest @ .., b'\''] => whole(rest, 2),
        _ => std::str::from_utf8(digits).ok().and_then(|d| d.parse().ok()).unwrap_or(f64::NAN),
    });
    if text.first() == Some(&b'-') {
        -size
    } else {
        size
    }
}

/// Read few digits with at most one dot: an exact integer by an exact power of ten.
fn plain(digits: &[u8]) -> Option<f64> {
    let (mut value, mut count, mut after) = (0_u64, 0, None);
    for byte in digits {
        match byte {
            b'0'..=b'9' => {
                value = value * 10 + u64::from(byte - b'0');
                count += 1;
                if count > EXACT {
                    return None;
                }
            }
            b'.' if after.is_none() => after = Some(count),
            _ => return None,
        }
    }
    (count > 0).then(|| value as f64 / TENS[count - after.unwrap_or(count)])
}

/// Read a whole number to another base, rounded to the nearest float.
fn whole(digits: &[u8], base: u32) -> f64 {
    let (mut value, mut bits, mut rest) = (0_u128, 0_i32, false);
    let step = base.trailing_zeros() as i32;
    for byte in digits {
        let Some(digit) = (*byte as char).to_digit(base) else { return f64::NAN };
        if value >> 120 == 0 {
            value = value << step | u128::from(digit);
        } else {
            (bits, rest) = (bits + step, rest || digit > 0); // only whether there is a rest
        }
    }
    let rounded = (value | u128::from(rest)) as f64;
    if digits.is_empty() {
        f64::NAN
    } else {
        rounded * 2_f64.powi(bits)
    }
}

/// Return how many decimals a number is written with.
fn decimals_of(text: &[u8]) -> i64 {
    let split = |at: u8| text.iter().position(|b| b.eq_ignore_ascii_case(&at));
    if split(b'x').is_some() || text.contains(&b'\'') {
        return 0;
    }
    let mantissa = &text[..split(b'e').unwrap_or(text.len())];
    let written = mantissa.iter().rev().take_while(|b| **b != b'.').count();
    let written = if mantissa.contains(&b'.') { written as i64 } else { 0 };
    let exponent = split(b'e').map_or(0, |e| {
        let text = std::str::from_utf8(&text[e + 1..]).unwrap_or("");
        let far = if text.starts_with('-') { -i64::from(i32::MAX) } else { i64::from(i32::MAX) };
        text.parse::<i32>().map_or(far, i64::from)
    });
    (written - exponent).max(0)
}

/// Numbers at places of a text.
struct Places<'a> {
    data: &'a [u8],
    start: &'a [i64],
    end: &'a [i64],
}

impl<'a> Places<'a> {
    fn new(data: &'a [u8], start: &'a [i64], end: &'a [i64]) -> PyResult<Self> {
        same_length(&[start.len(), end.len()])?;
        let inside = |(a, b): (&i64, &i64)| 0 <= *a && a <= b && *b <= data.len() as i64;
        if !start.iter().zip(end).all(inside) {
            return Err(PyIndexError::new_err("a number that is not there"));
        }
        Ok(Places { data, start, end })
    }

    fn text(&self, i: usize) -> &'a [u8] {
        &self.data[self.start[i] as usize..self.end[i] as usize]
    }
}

type Column<'py, T> = Bound<'py, PyArray1<T>>;

/// Return a number times a power of ten as a whole number, and its sign; None where that is
/// not sure to be the nearest, or too large.
fn scaled(value: f64, decimals: usize) -> Option<(bool, u64)> {
    let far = value.abs() * TENS.get(decimals)?;
    let whole = far as u64; // cut off, 0 for NaN
    let rest = far - whole as f64;
    // The product is off by 2^-53 of itself at most.
    let clear = match far {
        far if far < 1e12 => 1e-3,
        far if far < 4e14 => 0.1,
        _ => return None,
    };
    let sure = (rest - 0.5).abs() > clear;
    sure.then_some((value.is_sign_negative(), whole + u64::from(rest > 0.5)))
}

/// Write digits, zeros before them up to so many.
fn put_digits(out: &mut Vec<u8>, mut value: u64, least: usize) {
    let (mut digits, mut at) = ([b'0'; 20], 20);
    while value > 0 {
        at -= 1;
        digits[at] = b'0' + (value % 10) as u8;
        value /= 10;
    }
    out.extend_from_slice(&digits[at.min(20 - least)..]);
}

/// Write a whole number.
pub fn put_whole(out: &mut Vec<u8>, value: i64) {
    if value < 0 {
        out.push(b'-');
    }
    put_digits(out, value.unsigned_abs(), 1);
}

/// Write a number with so many decimals, as ``%.3f`` does.
pub fn put_fixed(out: &mut Vec<u8>, value: f64, decimals: usize) {
    let Some((negative, size)) = scaled(value, decimals) else {
        return write!(out, "{value:.decimals$}").expect("a vector takes all");
    };
    if negative {
        out.push(b'-');
    }
    let one = TENS[decimals] as u64;
    put_digits(out, size / one, 1);
    if decimals > 0 {
        out.push(b'.');
        put_digits(out, size % one, decimals);
    }
}

/// Texts one behind the other.
#[derive(Default)]
struct Texts {
    all: Vec<u8>,
    ends: Vec<usize>,
}

impl Texts {
    /// Give texts to Python, each in a row filled up with NUL, (n, w).
    fn rows<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u8>> {
        let begins = || std::iter::once(&0).chain(&self.ends);
        let spans = || begins().zip(&self.ends).map(|(a, b)| &self.all[*a..*b]);
        let width = spans().map(<[u8]>::len).max().unwrap_or(0).max(1);
        let mut out = vec![0_u8; width * self.ends.len()];
        for (row, text) in out.chunks_exact_mut(width).zip(spans()) {
            row[..text.len()].copy_from_slice(text);
        }
        Array2::from_shape_vec((self.ends.len(), width), out)
            .expect("as many bytes as rows have")
            .into_pyarray(py)
    }
}

/// Decimals that are tried before the search for the fewest digits.
const USUAL: usize = 9;
/// Least of them that is not written with an exponent: 0.0001.
const LEAST: u64 = 100_000;

/// Write a number as `repr` of Python does: with an exponent where it is far from one.
///
/// A decimal of 15 digits has a float of its own, which no shorter one has.
pub fn put_shortest(out: &mut Vec<u8>, value: f64, rounded: Option<usize>) {
    let decimals = rounded.unwrap_or(USUAL).min(USUAL);
    let told = scaled(value, decimals).and_then(|(negative, size)| {
        let more = 10_u64.pow((USUAL - decimals) as u32);
        let same = rounded.is_some() || size as f64 / TENS[decimals] == value.abs();
        let size = size.checked_mul(more)?;
        let usual = same && !(1..LEAST).contains(&size) && rounded.is_none_or(|d| d <= USUAL);
        usual.then_some((negative, size))
    });
    let Some((negative, size)) = told else {
        return put_searched(out, rounded.map_or(value, |most| nearest(value, most)));
    };
    if negative {
        out.push(b'-');
    }
    let one = TENS[USUAL] as u64;
    put_digits(out, size / one, 1);
    out.push(b'.');
    let begin = out.len() + 1;
    put_digits(out, size % one, USUAL);
    while out.len() > begin && out.ends_with(b"0") {
        out.pop();
    }
}

/// Round to so many decimals, as `round` of Python does.
fn nearest(value: f64, decimals: usize) -> f64 {
    format!("{value:.decimals$}").parse().unwrap_or(value)
}

/// Of two decimals that are equally near (of multiples of a small power of two), Python writes the
/// even one; this does not look.
fn put_searched(out: &mut Vec<u8>, value: f64) {
    let far = value != 0.0 && !(1e-4..1e16).contains(&value.abs());
    if !far || !value.is_finite() {
        // Rust has an exponent from 1e16 on and below 1e-5 only.
        let text = match value.is_finite() {
            true => format!("{value:?}"),
            false => format!("{value}"),
        };
        return out.extend_from_slice(text.as_bytes());
    }
    let text = format!("{value:e}");
    let (digits, exponent) = text.split_once('e').expect("an exponent");
    let exponent: i32 = exponent.parse().expect("a number");
    let sign = if exponent < 0 { '-' } else { '+' };
    write!(out, "{digits}e{sign}{:02}", exponent.abs()).expect("a vector takes all");
}

/// Count the decimals of numbers that stand at places of a text, (k,).
#[pyfunction]
pub fn count_decimals<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyBytes>,
    start: PyReadonlyArray1<'py, i64>,
    end: PyReadonlyArray1<'py, i64>,
) -> PyResult<Column<'py, i64>> {
    let places = Places::new(data.as_bytes(), flat(&start)?, flat(&end)?)?;
    let found = each(py, places.start.len(), |i| decimals_of(places.text(i)))?;
    Ok(found.into_pyarray(py))
}

/// Write new values over numbers that stand at places of a text.
///
/// A number changes where its value does by more than half of its last digit as it will be
/// written: with the decimals it had, or so many at least. A plus that it began with stays.
///
/// Returns: which numbers change, (k,), and their new texts: rows filled up with NUL.
#[pyfunction]
pub fn rewrite_numbers<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyBytes>,
    start: PyReadonlyArray1<'py, i64>,
    end: PyReadonlyArray1<'py, i64>,
    values: PyReadonlyArray1<'py, f64>,
    least: PyReadonlyArray1<'py, i64>,
) -> PyResult<(Column<'py, i64>, Bound<'py, PyArray2<u8>>)> {
    let places = Places::new(data.as_bytes(), flat(&start)?, flat(&end)?)?;
    let (values, least) = (flat(&values)?, flat(&least)?);
    let n = same_length(&[places.start.len(), values.len(), least.len()])?;
    let (mut texts, mut rows) = (Texts::default(), Vec::new());
    each(py, n, |i| {
        let (old, new) = (places.text(i), values[i]);
        let before = value_of(old);
        let decimals = decimals_of(old).max(least[i]);
        if (new - before).abs() <= 0.5 * 10_f64.powi(-(decimals as i32)) {
            return;
        }
        let begin = texts.all.len();
        put_fixed(&mut texts.all, new, decimals as usize);
        let zero = !texts.all[begin..].iter().any(|b| (b'1'..=b'9').contains(b));
        if zero && texts.all[begin] == b'-' {
            texts.all.remove(begin);
        }
        if value_of(&texts.all[begin..]) == before {
            texts.all.truncate(begin);
            return;
        }
        if old.first() == Some(&b'+') && texts.all[begin] != b'-' {
            texts.all.insert(begin, b'+');
        }
        texts.ends.push(texts.all.len());
        rows.push(i as i64);
    })?;
    Ok((rows.into_pyarray(py), texts.rows(py)))
}
