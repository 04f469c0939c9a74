//! Texture, flakes and veil over a picture in one pass.

use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use super::frame::{Picture, PictureMut};
use super::gate::{self, alike};
use super::particles::SortedFlakes;
use super::spectral::{Request, estimate, opacity_map};
use crate::base::error::Error;
use crate::frame::onepass::{Drawn, Snowfall};

/// Flakes, drawn or to be drawn.
#[derive(FromPyObject)]
pub enum Flakes<'py> {
    /// Of the frame.
    Sorted(Py<SortedFlakes>),
    /// Opacities over the window.
    Plane(PyReadonlyArray2<'py, f32>),
}

/// Snow of one color over a picture, from the request of its texture, its map (mean, spread, power,
/// amount), flakes or the opacity of drawn ones, and a veil; returns how many tiles were transformed.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one flat call from the effect")]
#[pyo3(signature = (out, background, request, map, preserve_mean, haze, intensity, flakes=None))]
pub fn snowfall(
    py: Python<'_>,
    out: PictureMut<'_>,
    background: Picture<'_>,
    request: Request<'_>,
    map: (f64, f64, f64, f64),
    preserve_mean: bool,
    haze: f64,
    intensity: Vec<f64>,
    flakes: Option<Flakes<'_>>,
) -> PyResult<usize> {
    let map = opacity_map(map).checked("power")?;
    let (drawn, more) = match &flakes {
        None => (Drawn::Nothing, 0.0),
        Some(Flakes::Plane(plane)) => (Drawn::Plane(plane.as_array()), 0.0),
        Some(Flakes::Sorted(sorted)) => {
            let sorted = sorted.get();
            (Drawn::Sorted(&sorted.sorted), sorted.nanoseconds)
        }
    };
    alike!([Byte, Word, Single, Double] PictureMut mut out = out, Picture back = background => {
        let (out, back) = (out.as_array_mut(), back.as_array());
        request.with_field(|field, window| {
            gate::run(py, estimate(field, window) + more, |cancel| {
                let (texture, intensity) = (&field.ready::<f32>()?, &intensity[..]);
                let snowfall =
                    Snowfall { texture, window, map, preserve_mean, flakes: drawn, haze, intensity };
                snowfall.over(out, back, cancel)?;
                Ok(texture.transformed())
            })
        })
    }, else Error::invalid("out", "must have the dtype of the background"))
}
