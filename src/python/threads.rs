//! Thread count and the reproducible mode.

use pyo3::prelude::*;

use crate::base::{pool, simd};

/// Sets how many threads the kernels use.
#[pyfunction]
pub fn set_threads(n: usize) -> PyResult<()> {
    Ok(pool::set_threads(n)?)
}

/// How many threads the kernels use.
#[pyfunction]
pub fn threads() -> usize {
    pool::threads()
}

/// Turns the mode on or off in which all vector levels give the same bits.
#[pyfunction]
pub fn set_reproducible(on: bool) {
    simd::set_reproducible(on);
}

/// Whether it is on.
#[pyfunction]
pub fn reproducible() -> bool {
    simd::reproducible()
}
