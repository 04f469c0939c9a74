//! `flurries.composite`: Eq. 7, over, and the joint opacity of layers.

use numpy::{PyArray3, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray2, PyReadwriteArray3};
use pyo3::prelude::*;

use super::gate::{self, Plane, PlaneMut, alike, arrays, either};
use crate::base::error::Error;
use crate::frame::composite;
use crate::frame::veil::{self as fog, Patches};

/// Rough nanoseconds for a value.
const VALUE: f64 = 0.3;

arrays! {
    /// A background of any supported dtype.
    pub enum Picture by try_readonly, PyArray3 as PyReadonlyArray3 {
        Byte: u8, Word: u16, Single: f32, Double: f64
    }
}

arrays! {
    /// An output of the same dtypes.
    pub enum PictureMut by try_readwrite, PyArray3 as PyReadwriteArray3 {
        Byte: u8, Word: u16, Single: f32, Double: f64
    }
}

arrays! {
    /// RGBA of either precision.
    pub enum Layer by try_readonly, PyArray3 as PyReadonlyArray3 { Single: f32, Double: f64 }
}

fn mismatch() -> PyErr {
    Error::invalid("out", "must have the dtype of the background").into()
}

/// Snow of one color over a background.
#[pyfunction]
pub fn snow(
    py: Python<'_>,
    out: PictureMut<'_>,
    background: Picture<'_>,
    alpha: Plane<'_>,
    intensity: Vec<f64>,
) -> PyResult<()> {
    alike!([Byte, Word, Single, Double] PictureMut mut out = out, Picture back = background =>
        either!(Plane alpha = &alpha => {
            let (out, back, alpha) = (out.as_array_mut(), back.as_array(), alpha.as_array());
            let work = VALUE * out.len() as f64;
            gate::run(py, work, |cancel| composite::snow(out, back, alpha, &intensity, cancel))
        }), else mismatch())
}

/// A premultiplied layer over a background.
#[pyfunction]
pub fn over(
    py: Python<'_>,
    out: PictureMut<'_>,
    background: Picture<'_>,
    layer: Layer<'_>,
) -> PyResult<()> {
    alike!([Byte, Word, Single, Double] PictureMut mut out = out, Picture back = background =>
        either!(Layer layer = &layer => {
            let (out, back, layer) = (out.as_array_mut(), back.as_array(), layer.as_array());
            let work = VALUE * out.len() as f64;
            gate::run(py, work, |cancel| composite::over(out, back, layer, cancel))
        }), else mismatch())
}

/// Joint opacity of layers of one color.
#[pyfunction]
#[pyo3(signature = (out, layers, haze, matte=None))]
pub fn join(
    py: Python<'_>,
    out: PlaneMut<'_>,
    layers: Vec<Plane<'_>>,
    haze: f64,
    matte: Option<Plane<'_>>,
) -> PyResult<()> {
    let differ = || PyErr::from(Error::invalid("layers", "must have the dtype of out"));
    macro_rules! of {
        ($variant:ident, $out:expr) => {{
            let pick = |plane| match plane {
                &Plane::$variant(ref array) => Ok(array.as_array()),
                _ => Err(differ()),
            };
            let planes = layers.iter().map(pick).collect::<PyResult<Vec<_>>>()?;
            let matte = matte.as_ref().map(pick).transpose()?;
            let out = $out.as_array_mut();
            let work = VALUE * out.len() as f64;
            gate::run(py, work, |cancel| composite::join(out, &planes, haze, matte, cancel))
        }};
    }
    match out {
        PlaneMut::Single(mut out) => of!(Single, out),
        PlaneMut::Double(mut out) => of!(Double, out),
    }
}

/// Opacity of a veil: `patches` is a coarse field, the pixels between its points, and its strength.
#[pyfunction]
pub fn veil(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f32>,
    way: PyReadonlyArray2<'_, f32>,
    extinction: f64,
    patches: Option<(PyReadonlyArray2<'_, f32>, f64, f64)>,
) -> PyResult<()> {
    let (out, way) = (out.as_array_mut(), way.as_array());
    let patches = patches.as_ref().map(|(field, cell, strength)| Patches {
        field: field.as_array(),
        cell: *cell,
        strength: *strength,
    });
    let work = 2.0 * out.len() as f64;
    gate::run(py, work, move |cancel| fog::veil(out, way, extinction, patches, cancel))
}
