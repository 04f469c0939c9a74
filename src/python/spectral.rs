//! `flurries.spectral`: tables, steps, whole frames, and films that repeat.

use numpy::ndarray::{Array, Dimension, Ix1};
use numpy::{
    PyArray4, PyReadonlyArray, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray4,
    PyReadwriteArray1, PyReadwriteArray2,
};
use pyo3::prelude::*;

use super::gate::{
    self, Plane, PlaneMut, alike, arrays, attribute, each_precision, from_attributes,
};
use crate::base::error::{Error, layout};
use crate::base::pool;
use crate::spectral::band::{Band, band_amplitude as band_kernel};
use crate::spectral::field::{Field, Lap, Window};
use crate::spectral::filter::{Alias, TemporalFilter, temporal_filter as filter_kernel};
use crate::spectral::grid::random_phase as random_kernel;
use crate::spectral::opacity::{Block, Lifted, Opacity};
use crate::spectral::stripes::Mapped;
use crate::spectral::tent::{self, Motion};
use crate::spectral::tiles::{Blend, Row, blend_tiles as blend_kernel};
use crate::spectral::transform::inverse_transform as transform_kernel;
use crate::spectral::volume::{Cells, Volume};

/// Rough nanoseconds for a pixel of a tiled frame on one thread; only decides who watches Ctrl-C.
const PIXEL: f64 = 3.0;

#[pyfunction]
#[pyo3(signature = (out, drift, repeat=None))]
pub fn tent_rate(mut out: PyReadwriteArray2<'_, f64>, drift: [f64; 2], repeat: Option<f64>) {
    tent::tent_rate(out.as_array_mut(), drift, repeat);
}

#[pyfunction]
pub fn band_amplitude(
    mut out: PyReadwriteArray2<'_, f64>,
    wavelengths: (f64, f64),
    exponent: f64,
) -> PyResult<()> {
    let band = Band { shortest: wavelengths.0, longest: wavelengths.1, exponent };
    Ok(band_kernel(out.as_array_mut(), band)?)
}

#[pyfunction]
pub fn random_phase(mut out: PyReadwriteArray2<'_, f64>, seed: i64, tile: (i64, i64)) {
    random_kernel(out.as_array_mut(), seed, tile);
}

#[pyfunction]
pub fn advance_phase(
    mut out: PyReadwriteArray2<'_, f64>,
    phase: PyReadonlyArray2<'_, f64>,
    drift: [f64; 2],
    shift: [f64; 2],
) {
    tent::advance_phase(out.as_array_mut(), phase.as_array(), Motion { drift, shift });
}

/// Amplitudes after the alias law and the shutter.
#[pyfunction]
pub fn temporal_filter(
    mut out: PyReadwriteArray2<'_, f64>,
    amplitude: PyReadonlyArray2<'_, f64>,
    drift: [f64; 2],
    shift: [f64; 2],
    alias: &str,
    soft_from: f64,
    shutter: f64,
    renormalise: bool,
) -> PyResult<()> {
    let filter = TemporalFilter { alias: Alias::named(alias)?, soft_from, shutter };
    let motion = Motion { drift, shift };
    Ok(filter_kernel(out.as_array_mut(), amplitude.as_array(), motion, filter, renormalise)?)
}

/// Fills `out` (n,) with what the alias law and the shutter leave of waves of these rates, cycles per
/// frame: factors of their amplitudes.
#[pyfunction]
pub fn temporal_gain(
    mut out: PyReadwriteArray1<'_, f64>,
    rate: PyReadonlyArray1<'_, f64>,
    alias: &str,
    soft_from: f64,
    shutter: f64,
) -> PyResult<()> {
    let filter = TemporalFilter { alias: Alias::named(alias)?, soft_from, shutter }.checked()?;
    let mut gains = out.as_array_mut();
    gains.iter_mut().zip(rate.as_array()).for_each(|(gain, &rate)| *gain = filter.gain(rate));
    Ok(())
}

/// The field of two tables.
#[pyfunction]
pub fn inverse_transform(
    py: Python<'_>,
    out: PlaneMut<'_>,
    amplitude: PyReadonlyArray2<'_, f64>,
    phase: PyReadonlyArray2<'_, f64>,
) -> PyResult<()> {
    let (amplitude, phase) = (amplitude.as_array(), phase.as_array());
    let work = amplitude.len() as f64 * 100.0;
    each_precision!(out, view => {
        gate::run(py, work, move |cancel| transform_kernel(view, amplitude, phase, cancel))
    })
}

/// How many tiles there are along one axis; they start at multiples of `tile - overlap`.
#[pyfunction]
pub fn tile_count(length: usize, tile: usize, overlap: usize) -> PyResult<usize> {
    Ok(Row { length, tile, overlap }.checked()?.count())
}

/// Fills `out` (length, tiles) with each tile's share of each pixel along one axis. A row sums to 1; a
/// tile's field is added with its share (linear) or with the share's root (power).
#[pyfunction]
pub fn tile_shares(
    mut out: PyReadwriteArray2<'_, f64>,
    tile: usize,
    overlap: usize,
    blend: &str,
) -> PyResult<()> {
    let out = out.as_array_mut();
    let row = Row { length: out.nrows(), tile, overlap }.checked()?;
    Ok(row.fill_shares(out, Blend::named(blend)?)?)
}

arrays! {
    /// Tiles of either precision.
    pub enum Tiles by try_readonly, PyArray4 as PyReadonlyArray4 { Single: f32, Double: f64 }
}

/// The blend of a grid of tiles; both arrays of one precision.
#[pyfunction]
pub fn blend_tiles(
    py: Python<'_>,
    out: PlaneMut<'_>,
    tiles: Tiles<'_>,
    overlap: usize,
    blend: &str,
) -> PyResult<()> {
    let blend = Blend::named(blend)?;
    alike!([Single, Double] PlaneMut mut out = out, Tiles tiles = tiles => {
        let (out, tiles) = (out.as_array_mut(), tiles.as_array());
        gate::run(py, 0.0, move |_| blend_kernel(out, tiles, overlap, blend))
    }, else Error::invalid("out", "must have the dtype of the tiles"))
}

/// The opacity of a field; both arrays of one precision.
#[pyfunction]
pub fn opacity(
    py: Python<'_>,
    out: PlaneMut<'_>,
    field: Plane<'_>,
    map: (f64, f64, f64, f64),
) -> PyResult<()> {
    let map = opacity_map(map).checked("exponent")?;
    alike!([Single, Double] PlaneMut mut out = out, Plane field = field =>
        {
            let (mut out, field) = (out.as_array_mut(), field.as_array());
            gate::run(py, field.len() as f64, |_| {
                pool::for_each(out.outer_iter_mut().zip(field.outer_iter()), |(mut out, field)| {
                    let (cols, out) = (out.len(), out.as_slice_mut().ok_or_else(layout)?);
                    let field = (field.as_slice().ok_or_else(layout)?, cols);
                    map.map_block(Block { rows: 1, cols, field, out: (out, cols) }, Lifted::None);
                    Ok(())
                })
            })
        },
        else Error::invalid("out", "must have the dtype of the field"))
}

/// The map of (mean, spread, power, amount).
const fn opacity_map((mean, spread, power, amount): (f64, f64, f64, f64)) -> Opacity {
    Opacity { mean, spread, power, amount }
}

/// A band, from the attributes of a request.
fn band(request: Borrowed<'_, '_, PyAny>) -> PyResult<Band> {
    let (shortest, longest) = attribute!(request, wavelengths);
    Ok(Band { shortest, longest, exponent: attribute!(request, exponent) })
}

/// A filter likewise.
fn filter(request: Borrowed<'_, '_, PyAny>) -> PyResult<TemporalFilter> {
    Ok(TemporalFilter {
        alias: Alias::named(&attribute!(request, alias: String))?,
        soft_from: attribute!(request, soft_from),
        shutter: attribute!(request, shutter),
    })
}

/// An array that the kernels keep.
fn owned<D: Dimension>(array: PyReadonlyArray<'_, f64, D>) -> Array<f64, D> {
    array.as_array().to_owned()
}

from_attributes!(Field {
    shape, tile, overlap, seed, jitter;
    blend: Blend::named(&attribute!(field, blend: String))?,
    band: band(field)?,
    ring_edges: owned::<Ix1>(attribute!(field, ring_edges)).to_vec(),
    ring_gains: owned::<Ix1>(attribute!(field, ring_gains)).to_vec(),
    drift: owned(attribute!(field, drift)),
    shift: owned(attribute!(field, shift)),
    velocity: owned(attribute!(field, velocity)),
    shift_rate: owned(attribute!(field, shift_rate)),
    filter: filter(field)?,
    shortest: attribute!(field, shortest: Option<_>).map(owned),
    lap: attribute!(field, lap: Option<_>)
        .map(|(drift, shift, part)| Lap { drift: owned(drift), shift: owned(shift), part }),
} of field);

/// One frame of the field, or of its opacity when `map` = (mean, spread, power, amount) is given;
/// returns how many tiles were transformed.
#[pyfunction]
#[pyo3(signature = (out, request, map=None, preserve_mean=false))]
pub fn field(
    py: Python<'_>,
    out: PlaneMut<'_>,
    request: &Bound<'_, PyAny>,
    map: Option<(f64, f64, f64, f64)>,
    preserve_mean: bool,
) -> PyResult<usize> {
    let map = map.map(|map| opacity_map(map).checked("power")).transpose()?;
    let field: Field = request.extract()?;
    let (top, bottom, left, right) = attribute!(request, window);
    let window = Window { rows: top..bottom, cols: left..right };
    let mapped = map.map(|map| Mapped { map, preserve_mean });
    each_precision!(out, view => gate::run(py, estimate(&field, &window), |cancel| {
        let ready = field.ready()?;
        ready.render(&window, view, mapped, cancel)?;
        Ok(ready.transformed())
    }))
}

/// Rough nanoseconds of a frame: all pixels of all tiles, many times the frame's where they overlap a
/// lot.
fn estimate(field: &Field, window: &Window) -> f64 {
    let tiles = |length: usize, tile: usize| {
        1.0 + length as f64 / tile.saturating_sub(field.overlap).max(1) as f64
    };
    tiles(window.rows.len(), field.tile.0)
        * tiles(window.cols.len(), field.tile.1)
        * (field.tile.0 * field.tile.1) as f64
        * PIXEL
}

from_attributes!(Volume {
    frames, shape, seed, jitter;
    band: band(film)?,
    velocity: Motion { drift: attribute!(film, drift), shift: [0.0; 2] },
    filter: filter(film)?,
    cells: Cells::named(&attribute!(film, cells: String))?,
} of film);

/// The frames of a film at the given times, one below the other; returns the number of cells.
#[pyfunction]
pub fn volume(
    py: Python<'_>,
    out: PlaneMut<'_>,
    film: Volume,
    times: PyReadonlyArray1<'_, f64>,
) -> PyResult<usize> {
    let times = times.as_slice()?;
    let work = times.len() as f64 * (film.shape.0 * film.shape.1) as f64 * 10.0;
    each_precision!(out, view => gate::run(py, work, |cancel| {
        let spectrum = film.spectrum()?;
        spectrum.render(view, times, cancel)?;
        Ok(spectrum.len())
    }))
}
