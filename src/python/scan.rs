//! Checks of whole arrays.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use super::gate::{self, arrays};
use crate::base::error::Error;
use crate::base::real::Real;
use crate::base::scan;

arrays! {
    /// A flat array of either precision.
    pub enum Flat by try_readonly, PyArray1 as PyReadonlyArray1 { Single: f32, Double: f64 }
}

/// Whether all numbers are finite.
#[pyfunction]
pub fn all_finite(py: Python<'_>, values: Flat<'_>) -> PyResult<bool> {
    match values {
        Flat::Single(values) => within(py, &values, f32::MIN, f32::MAX),
        Flat::Double(values) => within(py, &values, f64::MIN, f64::MAX),
    }
}

/// Whether all numbers are from `low` to `high`.
#[pyfunction]
pub fn all_within(py: Python<'_>, values: Flat<'_>, low: f64, high: f64) -> PyResult<bool> {
    match values {
        Flat::Single(values) => within(py, &values, low as f32, high as f32),
        Flat::Double(values) => within(py, &values, low, high),
    }
}

fn within<T: Real + numpy::Element>(
    py: Python<'_>,
    values: &PyReadonlyArray1<'_, T>,
    low: T,
    high: T,
) -> PyResult<bool> {
    let values = values.as_slice().map_err(|_| Error::Internal("not contiguous".into()))?;
    // About a nanosecond for a few numbers.
    gate::run(py, 0.2 * values.len() as f64, move |_| scan::all_within(values, low, high))
}
