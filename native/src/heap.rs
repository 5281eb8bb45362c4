//! Memory that is not used any more: `postproc.arrays.release_memory`.

use pyo3::prelude::*;

use crate::rows::detached;

/// Give the system back what was freed and what the C library would keep for later.
#[pyfunction]
pub fn give_back(py: Python<'_>) -> PyResult<()> {
    detached(py, trim)
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn trim() {
    extern "C" {
        fn malloc_trim(pad: usize) -> i32;
    }
    // SAFETY: it takes a number and may be called at any time from any thread.
    unsafe { malloc_trim(0) };
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn trim() {}
