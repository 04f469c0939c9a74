//! The texture of flakes: patterns, the choices of tiles, frames.

use num_complex::Complex;
use numpy::{
    PyArray3, PyArray4, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArray4,
    PyReadwriteArray3, PyReadwriteArray4,
};
use pyo3::prelude::*;

use super::gate::{self, PlaneMut, arrays, each_precision, either};
use crate::base::error::Error;
use crate::spectral::flakes::frame::{Frame, Layers, choice};
use crate::spectral::flakes::pattern::{Law, patterns};
use crate::spectral::flakes::prepared::Prepared;

/// Rough nanoseconds for a flake of a pattern, and for a pixel of a tile and each of its layers.
const FLAKE: f64 = 2000.0;
const PIXEL: f64 = 3.0;

arrays! {
    /// Spectra of either precision, to be written.
    pub enum SpectraMut by try_readwrite, PyArray4 as PyReadwriteArray4 {
        Single: Complex<f32>, Double: Complex<f64>
    }
}

arrays! {
    /// Spectra of either precision.
    pub enum Spectra by try_readonly, PyArray3 as PyReadonlyArray3 {
        Single: Complex<f32>, Double: Complex<f64>
    }
}

/// Patterns of layers; `law` is (shear, opacity, seed).
#[pyfunction]
pub fn flake_patterns(
    py: Python<'_>,
    out: SpectraMut<'_>,
    counts: PyReadonlyArray1<'_, f64>,
    diameters: PyReadonlyArray2<'_, f64>,
    law: (f64, f64, i64),
) -> PyResult<()> {
    let counts = counts.as_slice()?;
    let (diameters, (shear, opacity, seed)) = (diameters.as_array(), law);
    either!(SpectraMut mut out = out => {
        let out = out.as_array_mut();
        let (_, number, tile, _) = out.dim();
        let work = counts.iter().sum::<f64>() * number as f64 * FLAKE;
        let law = Law { tile, shear, opacity, seed };
        gate::run(py, work, move |cancel| patterns(out, counts, diameters, law, cancel))
    })
}

/// What each tile takes by `seed`: `pattern` (rows, cols, layers) of `patterns` for each layer,
/// `shift` (rows, cols, layers, 2) in a tile of so many pixels.
#[pyfunction]
pub fn flake_choices(
    mut pattern: PyReadwriteArray3<'_, i32>,
    mut shift: PyReadwriteArray4<'_, f64>,
    seed: i64,
    patterns: usize,
    tile: usize,
) -> PyResult<()> {
    let (mut pattern, mut shift) = (pattern.as_array_mut(), shift.as_array_mut());
    let (rows, cols, layers) = pattern.dim();
    if shift.dim() != (rows, cols, layers, 2) || patterns == 0 {
        return Err(Error::invalid("pattern", "must have the shape of `shift`").into());
    }
    for ((row, col, layer), index) in pattern.indexed_iter_mut() {
        let (found, by) = choice(seed, layer, (row, col), patterns, tile);
        *index = (layer * patterns + found) as i32;
        for axis in 0..2 {
            shift[(row, col, layer, axis)] = by[axis];
        }
    }
    Ok(())
}

/// A frame of the texture as the Python layer has settled it; the attributes of its request.
#[derive(FromPyObject)]
pub struct FlakeRequest<'py> {
    overlap: usize,
    shear: f64,
    pattern: PyReadonlyArray3<'py, i32>,
    shift: PyReadonlyArray4<'py, f64>,
    streak: Option<PyReadonlyArray4<'py, f64>>,
    gain: PyReadonlyArray1<'py, f64>,
    mean: f64,
}

/// The optical depth of a frame, of patterns (n, M, M/2 + 1).
#[pyfunction]
pub fn flake_frame(
    py: Python<'_>,
    out: PlaneMut<'_>,
    spectra: Spectra<'_>,
    request: FlakeRequest<'_>,
) -> PyResult<()> {
    let FlakeRequest { overlap, shear, mean, .. } = request;
    let layers = Layers {
        pattern: request.pattern.as_array(),
        shift: request.shift.as_array(),
        streak: request.streak.as_ref().map(|streak| streak.as_array()),
        gain: request.gain.as_array(),
        mean,
    };
    each_precision!(out, out => either!(Spectra spectra = &spectra => {
        let (spectra, shape) = (spectra.as_array(), out.dim());
        let tile = spectra.dim().1;
        // Overlapping tiles are many times the picture.
        let step = tile.saturating_sub(overlap).max(1) as f64;
        let tiles = |length: usize| 1.0 + length as f64 / step;
        let each = (tile * tile) as f64 * (tile + layers.gain.len()) as f64 / 16.0 * PIXEL;
        gate::run(py, tiles(shape.0) * tiles(shape.1) * each, |cancel| {
            let patterns = Prepared::new(spectra, shear)?;
            Frame::new(shape, overlap, &patterns, &layers)?.render(out, cancel)
        })
    }))
}
