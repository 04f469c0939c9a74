//! What falls before a picture by itself.

use numpy::{PyReadonlyArray2, PyReadwriteArray2};
use pyo3::prelude::*;

use super::gate;
use crate::frame::sheet::{Falling, Sheet, fall};

/// Rough nanoseconds for a pixel.
const PIXEL: f64 = 1.0;

/// A sheet as the Python layer has it: values, (row, column) of the first pixel, whether each is read
/// backwards, optical depths of 1 and of 0, and a mask.
type Asked<'py> = (
    PyReadonlyArray2<'py, i16>,
    [usize; 2],
    [bool; 2],
    (f32, f32),
    Option<PyReadonlyArray2<'py, f32>>,
);

/// Opacity of sheets, of what is drawn with how often its copies are squared, and of a veil.
#[pyfunction]
#[pyo3(signature = (out, sheets, drawn=None, veil=None, haze=0.0))]
pub fn sheet_fall(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f32>,
    sheets: Vec<Asked<'_>>,
    drawn: Option<(PyReadonlyArray2<'_, f32>, u32)>,
    veil: Option<PyReadonlyArray2<'_, f32>>,
    haze: f32,
) -> PyResult<()> {
    let out = out.as_array_mut();
    let law = Falling {
        sheets: sheets
            .iter()
            .map(|(values, place, back, (unit, mean), mask)| Sheet {
                values: values.as_array(),
                place: *place,
                back: *back,
                unit: *unit,
                mean: *mean,
                mask: mask.as_ref().map(PyReadonlyArray2::as_array),
            })
            .collect(),
        drawn: drawn.as_ref().map(|(plane, times)| (plane.as_array(), *times)),
        veil: veil.as_ref().map(PyReadonlyArray2::as_array),
        haze,
    };
    gate::run(py, PIXEL * out.len() as f64, move |cancel| fall(out, &law, cancel))
}
