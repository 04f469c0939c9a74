//! Thread count, the reproducible mode, and the forced panic that the tests send through the gate.

use pyo3::prelude::*;

use super::gate;
use crate::scope::Scope;
use crate::{pool, simd};

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

/// Panics inside a kernel, on a worker of the pool, so that the tests can see what Python gets.
#[pyfunction]
pub fn panic_for_test(py: Python<'_>) -> PyResult<()> {
    gate::run(py, 0.0, |_| {
        pool::for_each(vec![0, 1], |i| {
            assert!(i == 0, "forced by a test");
            Ok(())
        })
    })
}
