//! Pixels as files hold them: half floats, and the rows of a PNG.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::gate;
use crate::base::error::Error;
use crate::encode::{half, png};

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

/// A chunk of a PNG with rows of bytes, and the checksum of all rows so far.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "one call of a wrapper that names them all")]
pub fn png_chunk<'py>(
    py: Python<'py>,
    rows: PyReadonlyArray2<'py, u8>,
    above: PyReadonlyArray1<'py, u8>,
    pixel: usize,
    wide: bool,
    checksum: u32,
    last: bool,
) -> PyResult<(Bound<'py, PyBytes>, u32)> {
    let above = above.as_slice().map_err(|_| scattered())?;
    let rows = png::Rows { rows: rows.as_array(), above, pixel, wide };
    let work = 15.0 * rows.rows.len() as f64;
    let (data, checksum) =
        gate::run(py, work, move |cancel| png::chunk(rows, checksum, last, cancel))?;
    Ok((PyBytes::new(py, &data), checksum))
}
