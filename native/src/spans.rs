//! Where numbers stand in a text, in few bytes each: `postproc.language.source`.

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

/// Numbers whose places are told from that of the first of them.
pub const TOGETHER: usize = 16;

/// Whole numbers in as few bytes as the largest of them needs.
enum Narrow {
    One(Vec<u8>),
    Two(Vec<u16>),
    Four(Vec<u32>),
}

impl Default for Narrow {
    fn default() -> Self {
        Narrow::One(Vec::new())
    }
}

impl Narrow {
    fn len(&self) -> usize {
        match self {
            Narrow::One(own) => own.len(),
            Narrow::Two(own) => own.len(),
            Narrow::Four(own) => own.len(),
        }
    }

    fn reserve(&mut self, count: usize) {
        match self {
            Narrow::One(own) => own.reserve(count),
            Narrow::Two(own) => own.reserve(count),
            Narrow::Four(own) => own.reserve(count),
        }
    }

    fn push(&mut self, value: u32) {
        match self {
            Narrow::One(own) if value <= u8::MAX.into() => own.push(value as u8),
            Narrow::Two(own) if value <= u16::MAX.into() => own.push(value as u16),
            Narrow::Four(own) => own.push(value),
            _ => {
                self.widen(value);
                self.push(value);
            }
        }
    }

    /// Take so many bytes that a value fits.
    fn widen(&mut self, value: u32) {
        *self = match std::mem::take(self) {
            Narrow::One(own) if value <= u16::MAX.into() => {
                Narrow::Two(own.into_iter().map(u16::from).collect())
            }
            Narrow::One(own) => Narrow::Four(own.into_iter().map(u32::from).collect()),
            Narrow::Two(own) => Narrow::Four(own.into_iter().map(u32::from).collect()),
            wide => wide,
        }
    }

    fn into_array(self, py: Python<'_>) -> Bound<'_, PyAny> {
        match self {
            Narrow::One(own) => own.into_pyarray(py).into_any(),
            Narrow::Two(own) => own.into_pyarray(py).into_any(),
            Narrow::Four(own) => own.into_pyarray(py).into_any(),
        }
    }
}

/// Where numbers stand, in ascending order.
#[derive(Default)]
pub struct Spans {
    base: Vec<i32>,
    offset: Narrow,
    length: Narrow,
}

/// The offset of every sixteenth number, how far behind that each begins, its bytes.
pub type Columns<'py> = (Bound<'py, PyArray1<i32>>, Bound<'py, PyAny>, Bound<'py, PyAny>);

impl Spans {
    /// Make room for so many more.
    pub fn reserve(&mut self, count: usize) {
        self.base.reserve(count.div_ceil(TOGETHER));
        self.offset.reserve(count);
        self.length.reserve(count);
    }

    pub fn len(&self) -> usize {
        self.length.len()
    }

    /// Take one more number, by the offsets at which it begins and ends.
    pub fn push(&mut self, start: usize, end: usize) {
        let first = match self.base.last() {
            Some(base) if self.len() % TOGETHER != 0 => *base as usize,
            _ => {
                self.base.push(start as i32);
                start
            }
        };
        self.offset.push((start - first) as u32);
        self.length.push((end - start) as u32);
    }

    pub fn into_arrays(self, py: Python<'_>) -> Columns<'_> {
        let (offset, length) = (self.offset.into_array(py), self.length.into_array(py));
        (self.base.into_pyarray(py), offset, length)
    }
}
