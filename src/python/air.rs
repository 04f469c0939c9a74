//! The wind's waves.

use numpy::{PyReadonlyArray2, PyReadwriteArray2};
use pyo3::prelude::*;

use super::gate;
use crate::air::waves;

/// Fills `out` (n, c) with sums of plane waves at points (n, 3).
#[pyfunction]
pub fn wind_waves(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f64>,
    points: PyReadonlyArray2<'_, f64>,
    k: PyReadonlyArray2<'_, f64>,
    weights: PyReadonlyArray2<'_, f64>,
) -> PyResult<()> {
    let (out, points) = (out.as_array_mut(), points.as_array());
    let (k, weights) = (k.as_array(), weights.as_array());
    let work = 5.0 * out.nrows() as f64 * k.nrows() as f64;
    gate::run(py, work, move |cancel| waves::sum(out, points, k, weights, cancel))
}
