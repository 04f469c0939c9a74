//! NumPy's own functions, looked up while the module is imported.
//!
//! The binding would look them up at the first array that it is handed, by an import, and panics if
//! that fails: so it does if Ctrl-C is pressed just then.

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;

use crate::base::error::Error;

/// Finds NumPy's functions, and the table of borrowed arrays, on another thread: Python hears Ctrl-C on
/// the main thread alone.
pub fn look_up(py: Python<'_>) -> PyResult<()> {
    // Where NumPy is missing or Ctrl-C is pressed in its import, this is an error like any other.
    py.import("numpy")?;
    let found = py.detach(|| {
        let thread = std::thread::Builder::new().spawn(|| {
            Python::attach(|py| PyArray1::<f64>::zeros(py, 1, false).try_readwrite().is_ok())
        });
        thread.is_ok_and(|thread| thread.join().unwrap_or(false))
    });
    if found { Ok(()) } else { Err(Error::Internal("NumPy cannot be reached".into()).into()) }
}
