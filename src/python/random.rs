//! Counter-based numbers for the Python layers.

use numpy::PyReadwriteArray1;
use pyo3::prelude::*;

use crate::base::error::Error;
use crate::base::random;

/// Uniform numbers in [0, 1), one for each index of a stream.
#[pyfunction]
pub fn uniform(mut out: PyReadwriteArray1<'_, f64>, seed: i64, stream: i64) -> PyResult<()> {
    let out = out.as_slice_mut().map_err(|_| Error::invalid("out", "must be contiguous"))?;
    random::uniform(out, seed, stream);
    Ok(())
}
