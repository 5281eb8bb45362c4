//! Memory that is not used any more: `postproc.arrays.give_back`.

use pyo3::prelude::*;

use crate::rows::detached;

/// Give the system back what was freed and what the C library would keep for later.
#[pyfunction]
pub fn give_back(py: Python<'_>) -> PyResult<()> {
    detached(py, gnu::trim)
}

/// Let columns of long programs go back to the system as soon as they are freed.
///
/// By itself the C library stops doing so with what is as long as anything that was freed
/// before, up to 32 MiB, and holes between columns stay.
pub fn map_long_columns() {
    gnu::map_from(4 << 20);
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod gnu {
    const MMAP_THRESHOLD: i32 = -3; // M_MMAP_THRESHOLD of malloc.h

    extern "C" {
        fn malloc_trim(pad: usize) -> i32;
        fn mallopt(parameter: i32, value: i32) -> i32;
    }

    pub fn trim() {
        // SAFETY: it takes a number and may be called at any time from any thread.
        unsafe { malloc_trim(0) };
    }

    pub fn map_from(bytes: i32) {
        // SAFETY: as above.
        unsafe { mallopt(MMAP_THRESHOLD, bytes) };
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
mod gnu {
    pub fn trim() {}
    pub fn map_from(_bytes: i32) {}
}
