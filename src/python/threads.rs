//! Thread count and the reproducible mode.

use pyo3::prelude::*;

use super::gate;
use crate::base::scope::Scope;
use crate::base::{pool, simd};

/// Sets how many threads the kernels use.
#[pyfunction]
pub fn set_threads(n: usize) -> PyResult<()> {
    Ok(pool::set_threads(n)?)
}

/// How many threads the kernels use.
#[pyfunction]
pub fn threads() -> PyResult<usize> {
    gate::environment()?;
    Ok(pool::threads())
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

/// Sets threads and mode for the calls of this thread alone; returns what they were. None leaves one to
/// the process.
#[pyfunction]
#[pyo3(signature = (threads, reproducible))]
pub fn set_scope(
    threads: Option<usize>,
    reproducible: Option<bool>,
) -> (Option<usize>, Option<bool>) {
    let old = Scope { threads, reproducible }.swap();
    (old.threads, old.reproducible)
}
