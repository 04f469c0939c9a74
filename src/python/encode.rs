//! Pixels as files hold them: half floats.

use numpy::{PyReadonlyArray1, PyReadwriteArray1};
use pyo3::prelude::*;

use super::gate;
use crate::base::error::Error;
use crate::encode::half;

fn scattered() -> Error {
    Error::Internal("not contiguous".into())
}

/// Single floats as the bits of the nearest half floats, within what is finite.
#[pyfunction]
pub fn to_half(
    py: Python<'_>,
    mut out: PyReadwriteArray1<'_, u16>,
    values: PyReadonlyArray1<'_, f32>,
) -> PyResult<()> {
    let out = out.as_slice_mut().map_err(|_| scattered())?;
    let values = values.as_slice().map_err(|_| scattered())?;
    gate::run(py, values.len() as f64, move |cancel| half::to_half(out, values, cancel))
}
