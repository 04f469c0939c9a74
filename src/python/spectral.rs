//! `flurries.spectral`: tables, steps and whole frames.

use numpy::{
    PyArray4, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray4, PyReadwriteArray1,
    PyReadwriteArray2,
};
use pyo3::prelude::*;

use super::gate::{self, Plane, PlaneMut, alike, arrays, each_precision};
use crate::base::error::Error;
use crate::base::pool;
use crate::base::real::Real;
use crate::spectral::band::{Band, band_amplitude as band_kernel};
use crate::spectral::field::{Field, Lap, Window};
use crate::spectral::filter::{Alias, TemporalFilter, temporal_filter as filter_kernel};
use crate::spectral::opacity::Opacity;
use crate::spectral::phase::random_phase as random_kernel;
use crate::spectral::stripes::Mapped;
use crate::spectral::tent::{self, Motion};
use crate::spectral::tiles::{Blend, Row, blend_tiles as blend_kernel};
use crate::spectral::transform::inverse_transform as transform_kernel;

/// Rough nanoseconds for a pixel of a tiled frame on one thread; only decides who watches Ctrl-C.
const PIXEL: f64 = 3.0;

/// Temporal frequency of every bin.
#[pyfunction]
#[pyo3(signature = (out, drift, repeat=None))]
pub fn tent_rate(mut out: PyReadwriteArray2<'_, f64>, drift: [f64; 2], repeat: Option<f64>) {
    tent::tent_rate(out.as_array_mut(), drift, repeat);
}

/// Amplitude of every bin.
#[pyfunction]
pub fn band_amplitude(
    mut out: PyReadwriteArray2<'_, f64>,
    wavelengths: (f64, f64),
    exponent: f64,
) -> PyResult<()> {
    let band = Band { shortest: wavelengths.0, longest: wavelengths.1, exponent };
    Ok(band_kernel(out.as_array_mut(), band)?)
}

/// Random phases of a tile.
#[pyfunction]
pub fn random_phase(mut out: PyReadwriteArray2<'_, f64>, seed: i64, tile: (i64, i64)) {
    random_kernel(out.as_array_mut(), seed, tile);
}

/// Phases moved by a drift and a shift.
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
    gate::each(&mut out, &rate, |rate| filter.gain(rate))
}

/// Fills `out` (n,) with the depths that these wavelengths stand for, or the wavelengths that stand for
/// these depths, where the longest wave stands for `near`.
#[pyfunction]
pub fn wave_depth(
    mut out: PyReadwriteArray1<'_, f64>,
    wavelength: PyReadonlyArray1<'_, f64>,
    near: f64,
    longest: f64,
) -> PyResult<()> {
    gate::each(&mut out, &wavelength, |wavelength| tent::depth_of(wavelength, near, longest))
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
                    let layout = || Error::Internal("rows are not contiguous".into());
                    let out = out.as_slice_mut().ok_or_else(layout)?;
                    map.map_row(field.as_slice().ok_or_else(layout)?, out);
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

/// A frame of the field as the Python layer has settled it; the attributes of its request.
#[derive(FromPyObject)]
pub struct Request<'py> {
    shape: (usize, usize),
    tile: (usize, usize),
    overlap: usize,
    blend: String,
    wavelengths: (f64, f64),
    exponent: f64,
    seed: i64,
    jitter: bool,
    ring_edges: PyReadonlyArray1<'py, f64>,
    ring_gains: PyReadonlyArray1<'py, f64>,
    drift: PyReadonlyArray4<'py, f64>,
    shift: PyReadonlyArray4<'py, f64>,
    velocity: PyReadonlyArray4<'py, f64>,
    shift_rate: PyReadonlyArray4<'py, f64>,
    alias: String,
    soft_from: f64,
    shutter: f64,
    shortest: Option<PyReadonlyArray2<'py, f64>>,
    window: (usize, usize, usize, usize),
    lap: Option<(PyReadonlyArray4<'py, f64>, PyReadonlyArray4<'py, f64>, f64)>,
}

impl Request<'_> {
    /// The request as the kernels take it.
    fn with_field<R>(
        &self,
        use_it: impl FnOnce(&Field<'_>, &Window) -> PyResult<R>,
    ) -> PyResult<R> {
        let edges = self
            .ring_edges
            .as_slice()
            .map_err(|_| Error::invalid("ring_edges", "must be contiguous"))?;
        let gains = self
            .ring_gains
            .as_slice()
            .map_err(|_| Error::invalid("ring_gains", "must be contiguous"))?;
        let field = Field {
            shape: self.shape,
            tile: self.tile,
            overlap: self.overlap,
            blend: Blend::named(&self.blend)?,
            band: Band {
                shortest: self.wavelengths.0,
                longest: self.wavelengths.1,
                exponent: self.exponent,
            },
            seed: self.seed,
            jitter: self.jitter,
            ring_edges: edges,
            ring_gains: gains,
            drift: self.drift.as_array(),
            shift: self.shift.as_array(),
            velocity: self.velocity.as_array(),
            shift_rate: self.shift_rate.as_array(),
            filter: TemporalFilter {
                alias: Alias::named(&self.alias)?,
                soft_from: self.soft_from,
                shutter: self.shutter,
            },
            shortest: self.shortest.as_ref().map(|map| map.as_array()),
            lap: self.lap.as_ref().map(|(drift, shift, part)| Lap {
                drift: drift.as_array(),
                shift: shift.as_array(),
                part: *part,
            }),
        };
        let (top, bottom, left, right) = self.window;
        use_it(&field, &Window { rows: top..bottom, cols: left..right })
    }
}

/// One frame of the field, or of its opacity when `map` = (mean, spread, power, amount) is given;
/// returns how many tiles were transformed.
#[pyfunction]
#[pyo3(signature = (out, request, map=None, preserve_mean=false))]
pub fn field(
    py: Python<'_>,
    out: PlaneMut<'_>,
    request: Request<'_>,
    map: Option<(f64, f64, f64, f64)>,
    preserve_mean: bool,
) -> PyResult<usize> {
    let map = map.map(|map| opacity_map(map).checked("power")).transpose()?;
    request.with_field(|field, window| {
        each_precision!(out, view => render(py, view, field, window, map, preserve_mean))
    })
}

/// Rough nanoseconds of a frame: all pixels of all tiles, many times the frame's where they overlap a
/// lot.
fn estimate(field: &Field<'_>, window: &Window) -> f64 {
    let tiles = |length: usize, tile: usize| {
        1.0 + length as f64 / tile.saturating_sub(field.overlap).max(1) as f64
    };
    tiles(window.rows.len(), field.tile.0)
        * tiles(window.cols.len(), field.tile.1)
        * (field.tile.0 * field.tile.1) as f64
        * PIXEL
}

fn render<T: Real>(
    py: Python<'_>,
    out: ndarray::ArrayViewMut2<'_, T>,
    field: &Field<'_>,
    window: &Window,
    map: Option<Opacity>,
    preserve_mean: bool,
) -> PyResult<usize> {
    gate::run(py, estimate(field, window), move |cancel| {
        let ready = field.ready::<T>()?;
        ready.render(window, out, map.map(|map| Mapped { map, preserve_mean }), cancel)?;
        Ok(ready.transformed())
    })
}
