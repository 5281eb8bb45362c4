//! Texts by number, in the order in which they are met first.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::rows::{each, flat};

/// A place of the table that holds none.
const FREE: u32 = u32::MAX;
/// Of the hash: an odd number without a pattern, 2^64 through the golden ratio.
const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;

/// Texts, one behind the other, and a table, half of it free, to find them.
#[derive(Default)]
pub struct Interned {
    bytes: Vec<u8>,
    ends: Vec<u32>,
    /// Hash and number of a text at the first free place from its hash on; empty where
    /// there is no table (yet).
    table: Vec<(u32, u32)>,
}

impl Interned {
    /// Return the number of a text, which becomes one of these where it is not yet.
    pub fn of(&mut self, text: &[u8]) -> i32 {
        if self.table.len() < 2 * (self.ends.len() + 1) {
            self.grow();
        }
        let own = hash(text);
        let at = self.place(own, text);
        if self.table[at].1 == FREE {
            self.table[at] = (own, self.ends.len() as u32);
            self.push(text);
        }
        self.table[at].1 as i32
    }

    /// Return the number of a text, -1 where it is none of these or there is no table.
    pub fn find(&self, text: &[u8]) -> i32 {
        if self.table.is_empty() {
            return -1;
        }
        self.table[self.place(hash(text), text)].1 as i32
    }

    /// Put a text behind the others; no table finds it.
    pub fn push(&mut self, text: &[u8]) {
        self.bytes.extend_from_slice(text);
        self.ends.push(u32::try_from(self.bytes.len()).expect("texts of less than 4 GiB"));
    }

    /// Begin a table where there is none; return how many texts are to enter it.
    pub fn begin_table(&mut self) -> usize {
        if !self.table.is_empty() {
            return 0;
        }
        let places = (2 * (self.ends.len() + 1)).next_power_of_two().max(64);
        self.table = vec![(0, FREE); places];
        self.ends.len()
    }

    /// Enter a text into the table; of equal ones it finds the first.
    pub fn enter(&mut self, number: usize) {
        let own = hash(self.text(number));
        let at = self.place(own, self.text(number));
        if self.table[at].1 == FREE {
            self.table[at] = (own, number as u32);
        }
    }

    /// Make a larger table, from the hashes that the old one holds.
    fn grow(&mut self) {
        let old = std::mem::take(&mut self.table);
        let texts = self.begin_table();
        if old.is_empty() {
            (0..texts).for_each(|number| self.enter(number));
        }
        let last = self.table.len() - 1;
        for (own, number) in old.into_iter().filter(|(_, number)| *number != FREE) {
            let mut at = own as usize & last;
            while self.table[at].1 != FREE {
                at = (at + 1) & last;
            }
            self.table[at] = (own, number);
        }
    }

    /// Let go of the table.
    pub fn forget_table(&mut self) {
        self.table = Vec::new();
    }

    /// Let go of the table and of room for more texts.
    pub fn settle(&mut self) {
        self.forget_table();
        self.bytes.shrink_to_fit();
        self.ends.shrink_to_fit();
    }

    /// Tell whether others are the same texts in the same order.
    pub fn same(&self, other: &Interned) -> bool {
        self.ends == other.ends && self.bytes == other.bytes
    }

    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Return all texts, one behind the other.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Go through the texts by their numbers.
    pub fn texts(&self) -> impl ExactSizeIterator<Item = &[u8]> {
        (0..self.ends.len()).map(|number| self.text(number))
    }

    pub fn text(&self, number: usize) -> &[u8] {
        let begin = number.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.bytes[begin as usize..self.ends[number] as usize]
    }

    /// Return the place of a text in the table, a free one where it is not in it.
    fn place(&self, own: u32, text: &[u8]) -> usize {
        let mut at = own as usize;
        loop {
            at &= self.table.len() - 1;
            let (hash, number) = self.table[at];
            if number == FREE || (hash == own && self.text(number as usize) == text) {
                return at;
            }
            at += 1;
        }
    }
}

/// Hash a text, eight bytes at a time.
fn hash(text: &[u8]) -> u32 {
    let mut hash = text.len() as u64;
    for eight in text.chunks(8) {
        let mut word = [0; 8];
        word[..eight.len()].copy_from_slice(eight);
        hash = (hash.rotate_left(23) ^ u64::from_le_bytes(word)).wrapping_mul(FACTOR);
    }
    (hash >> 32) as u32
}

type Longs<'py> = PyReadonlyArray1<'py, i64>;
type Found<'py> = Bound<'py, PyArray1<i64>>;

/// See whole numbers as bytes.
fn bytes_of(values: &[i64]) -> &[u8] {
    // SAFETY: the bytes of whole numbers lie behind each other, and any is a byte.
    unsafe { std::slice::from_raw_parts(values.as_ptr().cast(), size_of_val(values)) }
}

/// Number sequences of whole numbers, (k,), in the order in which they are met first.
///
/// `ends`: where each of them begins and ends; without, each number is one.
///
/// Returns: the number of every sequence, (k,), and the first sequence of every number.
#[pyfunction]
pub fn number_in_order<'py>(
    py: Python<'py>,
    values: Longs<'py>,
    ends: Option<(Longs<'py>, Longs<'py>)>,
) -> PyResult<(Found<'py>, Found<'py>)> {
    let values = flat(&values)?;
    let ends = match &ends {
        Some((first, last)) => Some((flat(first)?, flat(last)?)),
        None => None,
    };
    let (mut found, mut example) = (Interned::default(), Vec::new());
    let count = ends.map_or(values.len(), |(first, last)| first.len().min(last.len()));
    let numbers = each(py, count, |i| {
        let (from, to) = ends.map_or((i, i + 1), |(a, b)| (a[i] as usize, b[i] as usize));
        let number = found.of(bytes_of(&values[from..to]));
        if number as usize == example.len() {
            example.push(i as i64);
        }
        i64::from(number)
    })?;
    Ok((numbers.into_pyarray(py), example.into_pyarray(py)))
}
