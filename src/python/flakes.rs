//! The texture of flakes: the choices of tiles, frames.

use std::sync::Arc;

use ndarray::{ArrayView2, ArrayViewMut2};
use numpy::{
    PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArray4, PyReadwriteArray3,
    PyReadwriteArray4,
};
use pyo3::prelude::*;

use super::gate::{self, Plane, PlaneMut, alike};
use super::patterns::{Either, PreparedFlakes};
use crate::base::error::{Cancel, Error};
use crate::base::normal::Normal;
use crate::spectral::field::Window;
use crate::spectral::flakes::bands::Bands;
use crate::spectral::flakes::choice::{choice, place};
use crate::spectral::flakes::footprint::FINE;
use crate::spectral::flakes::frame::{Finish, Frame, Terms};
use crate::spectral::flakes::prepared::Prepared;
use crate::spectral::flakes::wall::Wall;

/// Rough nanoseconds for a pixel of a tile and each of its terms.
const PIXEL: f64 = 3.0;

/// What each tile takes by `seed`: `pattern` (rows, cols, layers) of `patterns` for each layer,
/// `shift` (rows, cols, layers, 2) in a tile of so many pixels. `moved` (rows, cols, layers, 2), or
/// (1, 1, ..) for all tiles, is added to the shifts. With `placed` patterns stand
/// at places within a pixel, as [`flake_population`] makes them, and the shift is what is left. With
/// `layer` the arrays hold terms of these layers in place of one of each.
#[pyfunction]
#[pyo3(signature = (pattern, shift, seed, patterns, tile, generation=None, moved=None, placed=false, layer=None))]
#[expect(clippy::too_many_arguments, reason = "arrays of one request")]
pub fn flake_choices(
    mut pattern: PyReadwriteArray3<'_, i32>,
    mut shift: PyReadwriteArray4<'_, f64>,
    seed: i64,
    patterns: usize,
    tile: usize,
    generation: Option<PyReadonlyArray3<'_, i64>>,
    moved: Option<PyReadonlyArray4<'_, f64>>,
    placed: bool,
    layer: Option<Vec<usize>>,
) -> PyResult<()> {
    let (mut pattern, mut shift) = (pattern.as_array_mut(), shift.as_array_mut());
    let generation = generation.as_ref().map(|generation| generation.as_array());
    let (rows, cols, layers) = pattern.dim();
    let layer = layer.unwrap_or_else(|| (0..layers).collect());
    let alike = layer.len() == layers && shift.dim() == (rows, cols, layers, 2);
    if !alike || generation.is_some_and(|array| array.dim() != pattern.dim()) || patterns == 0 {
        return Err(Error::invalid("pattern", "must have the shape of the others").into());
    }
    let moved = moved.as_ref().map(|moved| moved.as_array());
    let one = moved.is_some_and(|moved| moved.dim() == (1, 1, layers, 2));
    if moved.is_some_and(|moved| moved.dim() != shift.dim()) && !one {
        return Err(Error::invalid("moved", "must have the shape of `shift`").into());
    }
    for ((row, col, term), index) in pattern.indexed_iter_mut() {
        let generation = generation.map_or(0, |array| array[(row, col, term)]);
        let found = choice(seed, layer[term], (row, col), generation, patterns, tile);
        let at = if one { (0, 0) } else { (row, col) };
        let along = |axis| moved.map_or(0.0, |moved| moved[(at.0, at.1, term, axis)]);
        let mut place_of = (0, [found.shift[0] + along(0), found.shift[1] + along(1)]);
        let mut number = layer[term] * patterns + found.pattern;
        if placed {
            place_of = place(place_of.1);
            number = number * FINE * FINE + place_of.0;
        }
        *index = number as i32;
        shift[(row, col, term, 0)] = place_of.1[0];
        shift[(row, col, term, 1)] = place_of.1[1];
    }
    Ok(())
}

/// A frame of the texture as the Python layer has settled it; the attributes of its request.
#[derive(FromPyObject)]
pub struct FlakeRequest<'py> {
    shape: (usize, usize),
    overlap: usize,
    pattern: PyReadonlyArray3<'py, i32>,
    gain: PyReadonlyArray3<'py, f64>,
    shift: PyReadonlyArray4<'py, f64>,
    streak: Option<PyReadonlyArray4<'py, f64>>,
    mean: PyReadonlyArray2<'py, f64>,
    window: (usize, usize, usize, usize),
    before: Option<WallRequest<'py>>,
}

/// A scene before which the texture lies; the attributes of its request.
#[derive(FromPyObject)]
pub struct WallRequest<'py> {
    depth: PyReadonlyArray2<'py, f32>,
    group: PyReadonlyArray1<'py, i32>,
    edges: PyReadonlyArray1<'py, f64>,
    shares: PyReadonlyArray2<'py, f64>,
    mean: PyReadonlyArray3<'py, f64>,
}

impl WallRequest<'_> {
    fn wall(&self) -> Wall<'_> {
        Wall {
            depth: self.depth.as_array(),
            group: self.group.as_array(),
            edges: self.edges.as_array(),
            shares: self.shares.as_array(),
            mean: self.mean.as_array(),
        }
    }
}

impl FlakeRequest<'_> {
    fn terms(&self) -> Terms<'_> {
        Terms {
            pattern: self.pattern.as_array(),
            gain: self.gain.as_array(),
            shift: self.shift.as_array(),
            streak: self.streak.as_ref().map(|streak| streak.as_array()),
            mean: self.mean.as_array(),
        }
    }

    fn window(&self) -> Window {
        let (top, bottom, left, right) = self.window;
        Window { rows: top..bottom, cols: left..right }
    }

    /// Rough nanoseconds for so many pixels: overlapping tiles are many times the picture.
    fn estimate(&self, tile: usize, (height, width): (usize, usize)) -> f64 {
        let step = tile.saturating_sub(self.overlap).max(1) as f64;
        let tiles = |length: usize| 1.0 + length as f64 / step;
        let terms = self.pattern.as_array().dim().2 as f64;
        let each = (tile * tile) as f64 * (tile as f64 + terms) / 16.0 * PIXEL;
        tiles(height) * tiles(width) * each
    }
}

/// The request's window of optical depth, or of opacity. The depth is multiplied by `mask` and added to
/// what `out` holds, if these are asked for.
#[pyfunction]
#[pyo3(signature = (out, patterns, request, opacity, add=false, mask=None))]
pub fn flake_frame(
    py: Python<'_>,
    out: PlaneMut<'_>,
    patterns: &PreparedFlakes,
    request: FlakeRequest<'_>,
    opacity: bool,
    add: bool,
    mask: Option<Plane<'_>>,
) -> PyResult<()> {
    let finish = Finish { opacity, add };
    let other = || Error::invalid("mask", "must have the dtype of `out`");
    match (out, &patterns.patterns) {
        (PlaneMut::Single(mut out), Either::Single(patterns)) => {
            let mask = match &mask {
                Some(Plane::Single(mask)) => Some(mask.as_array()),
                Some(Plane::Double(_)) => return Err(other().into()),
                None => None,
            };
            render(py, out.as_array_mut(), mask, patterns, &request, finish)
        }
        (PlaneMut::Double(mut out), Either::Double(patterns)) => {
            let mask = match &mask {
                Some(Plane::Double(mask)) => Some(mask.as_array()),
                Some(Plane::Single(_)) => return Err(other().into()),
                None => None,
            };
            render(py, out.as_array_mut(), mask, patterns, &request, finish)
        }
        _ => Err(Error::invalid("out", "must have the dtype that the patterns are for").into()),
    }
}

fn render<T: Normal>(
    py: Python<'_>,
    out: ArrayViewMut2<'_, T>,
    mask: Option<ArrayView2<'_, T>>,
    patterns: &Prepared<T>,
    request: &FlakeRequest<'_>,
    finish: Finish,
) -> PyResult<()> {
    let (terms, window) = (&request.terms(), request.window());
    let (shape, overlap) = (request.shape, request.overlap);
    let work = request.estimate(patterns.tile, (window.rows.len(), window.cols.len()));
    let wall = request.before.as_ref().map(WallRequest::wall);
    gate::run(py, work, move |cancel| {
        let frame = Frame::new(shape, overlap, patterns, terms, finish)?;
        let frame = match wall {
            Some(wall) => frame.before(wall)?,
            None => frame,
        };
        frame.render(&window, out, mask, cancel)
    })
}

/// The rows of a request's window from the top down, to be taken band by band.
#[pyclass(module = "flurries._core")]
pub struct FlakeBands {
    bands: EitherBands,
    /// A rough estimate of a row, and of how many rows a row of tiles finishes.
    nanoseconds: f64,
    least: f64,
}

enum EitherBands {
    Single(Bands<f32>),
    Double(Bands<f64>),
}

/// Begins a request's window of optical depth or opacity that is taken band by band.
#[pyfunction]
pub fn flake_bands(
    py: Python<'_>,
    patterns: &PreparedFlakes,
    request: FlakeRequest<'_>,
    opacity: bool,
) -> PyResult<FlakeBands> {
    let (terms, window) = (&request.terms(), &request.window());
    let (shape, overlap) = (request.shape, request.overlap);
    let (bands, tile) = match &patterns.patterns {
        Either::Single(patterns) => {
            let (all, tile) = (Arc::clone(patterns), patterns.tile);
            let new = move |_: &Cancel| Bands::new(shape, overlap, all, terms, opacity, window);
            (EitherBands::Single(gate::run(py, 0.0, new)?), tile)
        }
        Either::Double(patterns) => {
            let (all, tile) = (Arc::clone(patterns), patterns.tile);
            let new = move |_: &Cancel| Bands::new(shape, overlap, all, terms, opacity, window);
            (EitherBands::Double(gate::run(py, 0.0, new)?), tile)
        }
    };
    let nanoseconds = request.estimate(tile, (tile, window.cols.len())) / tile as f64;
    Ok(FlakeBands { bands, nanoseconds, least: tile as f64 })
}

/// Writes rows from `first` on into `out` (h, w), those before it are skipped.
#[pyfunction]
pub fn flake_take(
    py: Python<'_>,
    bands: &mut FlakeBands,
    out: PlaneMut<'_>,
    first: usize,
) -> PyResult<()> {
    let FlakeBands { bands, nanoseconds, least } = bands;
    let work = |rows: usize| (rows as f64).max(*least) * *nanoseconds;
    alike!([Single, Double] PlaneMut mut out = out, EitherBands bands = bands => {
        let out = out.as_array_mut();
        gate::run(py, work(out.nrows()), |cancel| bands.take(first, out, cancel))
    }, else Error::invalid("out", "must have the dtype of the patterns' frames"))
}
