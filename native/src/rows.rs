//! Rows of arrays, in and out.

use std::ops::Range;
use std::panic::{catch_unwind, AssertUnwindSafe};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{available_parallelism, scope};

use numpy::ndarray::{Array2, Array3, Dimension};
use numpy::{
    Element, IntoPyArray, PyArray2, PyArray3, PyReadonlyArray, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

/// Joint angles of one pose [rad].
pub type Six = [f64; 6];
/// A place [m].
pub type Three = [f64; 3];

/// Rows that are worked on side by side.
pub const SIDE: usize = 8;
/// A number for each of them.
pub type Lanes = [f64; SIDE];

/// See an array as it lies in memory: row behind row, or it is refused.
pub fn flat<'a, T: Element, D: Dimension>(
    array: &'a PyReadonlyArray<'_, T, D>,
) -> PyResult<&'a [T]> {
    if !array.is_c_contiguous() {
        return Err(PyValueError::new_err("an array whose rows do not lie one behind the other"));
    }
    Ok(array.as_slice()?)
}

/// See a C-contiguous array (n, K) as rows.
pub fn rows<'a, const K: usize>(array: &'a PyReadonlyArray2<'_, f64>) -> PyResult<&'a [[f64; K]]> {
    let given = array.shape()[1];
    if given != K {
        return Err(PyValueError::new_err(format!("rows of {given}, not of {K}")));
    }
    Ok(groups(flat(array)?))
}

/// See values as groups of K; what is left over is not seen.
pub fn groups<T, const K: usize>(values: &[T]) -> &[[T; K]] {
    // SAFETY: K values that lie behind each other are an array of K, and as many groups as
    // are seen lie within the values.
    unsafe { std::slice::from_raw_parts(values.as_ptr().cast(), values.len() / K) }
}

/// Rows that are worked on between two looks at signals: well below half a second.
const BLOCK: usize = 4096;

/// Work on rows one after the other, without the interpreter's lock.
///
/// Between blocks of them a signal that has arrived is heard; what Python makes of it, or
/// a panic, ends the work.
pub fn each<T: Send>(
    py: Python<'_>,
    n: usize,
    mut row: impl FnMut(usize) -> T + Send,
) -> PyResult<Vec<T>> {
    let mut out = Vec::with_capacity(n);
    for first in (0..n).step_by(BLOCK) {
        py.check_signals()?;
        detached(py, || at_best(|| out.extend((first..n.min(first + BLOCK)).map(&mut row))))?;
    }
    Ok(out)
}

/// Do something with the widest registers of this machine; the numbers are the same.
///
/// Only what is inlined into the work gains by it: large loops have functions of their own.
#[inline(always)]
pub fn at_best<T>(work: impl FnOnce() -> T) -> T {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        unsafe fn wide<T>(work: impl FnOnce() -> T) -> T {
            work()
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: this machine has what the function is compiled for.
            return unsafe { wide(work) };
        }
    }
    work()
}

/// Do something without the interpreter's lock; a panic becomes an exception.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    py.detach(|| catch_unwind(AssertUnwindSafe(work)))
        .map_err(|_| PyRuntimeError::new_err("the native core has failed"))
}

/// Cores that rows are worked on by at the most; 0: all that there are.
static MOST: AtomicUsize = AtomicUsize::new(0);

/// Let rows be worked on by so many cores at the most, 0 for all: other processes work
/// on the others.
#[pyfunction]
pub fn use_cores(most: usize) {
    MOST.store(most, Ordering::Relaxed);
}

/// Cut rows into a part for every core, as far as so many rows are worth a thread.
pub fn parts_of(rows: Range<usize>, least: usize) -> Vec<Range<usize>> {
    let mut cores = available_parallelism().map_or(1, usize::from);
    if let most @ 1.. = MOST.load(Ordering::Relaxed) {
        cores = cores.min(most);
    }
    let parts = cores.min(rows.len() / least).max(1);
    let end = |part: usize| rows.start + rows.len() * part / parts;
    (0..parts).map(|part| end(part)..end(part + 1)).collect()
}

/// Do some parts of a work, each on a thread of its own.
pub fn in_threads<T: Send>(parts: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    if parts == 1 {
        return vec![work(0)];
    }
    let work = &work;
    scope(|crowd| {
        let working: Vec<_> = (0..parts).map(|part| crowd.spawn(move || work(part))).collect();
        working.into_iter().map(|part| part.join().expect("a part of the rows")).collect()
    })
}

/// Do a work on some rows, a part of them on every core.
pub fn on_cores<T: Send>(
    rows: Range<usize>,
    least: usize,
    work: impl Fn(Range<usize>) -> T + Sync,
) -> Vec<T> {
    let parts = parts_of(rows, least);
    in_threads(parts.len(), |part| work(parts[part].clone()))
}

/// Rows of a model or of inverse kinematics that are worth a thread.
pub const WORTH: usize = 512;

/// Rows between two looks at signals, of work on every core.
const BLOCKS: usize = 1 << 16;

/// Work on parts of the rows on every core, of which `least` rows are worth a thread:
/// without the interpreter's lock; signals are heard as in `each`.
pub fn in_parts<T: Send>(
    py: Python<'_>,
    n: usize,
    least: usize,
    part: impl Fn(Range<usize>) -> Vec<T> + Sync,
) -> PyResult<Vec<T>> {
    let mut out = Vec::with_capacity(n);
    for first in (0..n).step_by(BLOCKS) {
        py.check_signals()?;
        let rows = first..n.min(first + BLOCKS);
        for mut found in detached(py, || on_cores(rows, least, &part))? {
            out.append(&mut found);
        }
    }
    Ok(out)
}

/// Give rows to Python as an array (n, K).
pub fn array<const K: usize>(py: Python<'_>, rows: Vec<[f64; K]>) -> Bound<'_, PyArray2<f64>> {
    let shape = (rows.len(), K);
    Array2::from_shape_vec(shape, rows.into_flattened())
        .expect("as many values as rows have")
        .into_pyarray(py)
}

/// See an array (6,) as a row.
pub fn row(array: &PyReadonlyArray1<'_, f64>) -> PyResult<Six> {
    let given = flat(array)?;
    given.try_into().map_err(|_| PyValueError::new_err(format!("{} values, not 6", given.len())))
}

/// Give values to Python as n blocks (n, a, b).
pub fn blocks<'py>(
    py: Python<'py>,
    n: usize,
    (a, b): (usize, usize),
    values: Vec<f64>,
) -> Bound<'py, PyArray3<f64>> {
    Array3::from_shape_vec((n, a, b), values)
        .expect("as many values as blocks have")
        .into_pyarray(py)
}

/// Refuse columns that are not of one length.
pub fn same_length(lengths: &[usize]) -> PyResult<usize> {
    match lengths.iter().all(|n| *n == lengths[0]) {
        true => Ok(lengths[0]),
        false => Err(PyValueError::new_err(format!("columns of {lengths:?} rows"))),
    }
}

pub fn minus(a: &Three, b: &Three) -> Three {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn dot(a: &Three, b: &Three) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
