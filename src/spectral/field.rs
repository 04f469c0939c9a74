//! One whole frame of the field: tiles, their motion, their blend, and what is done with each row.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use ndarray::{ArrayView2, ArrayView4, Axis, s};

use super::band::Band;
use super::filter::TemporalFilter;
use super::parts::{Parts, parts};
use super::tent::Motion;
use super::tiles::{Blend, Row};
use crate::base::error::Error;
use crate::base::real::Real;

/// Vectors (x, y) for all tiles and rings: shape (rows or 1, cols or 1, rings or 1, 2).
pub type Vectors<'a> = ArrayView4<'a, f64>;

/// Everything that defines a frame of the field (api.md, `spectral.field`).
pub struct Field<'a> {
    /// Image size (H, W).
    pub shape: (usize, usize),
    /// Tile size (rows, cols).
    pub tile: (usize, usize),
    /// Pixels shared by neighbouring tiles.
    pub overlap: usize,
    /// How they are mixed.
    pub blend: Blend,
    /// Which waves, how strong.
    pub band: Band,
    /// Random seed.
    pub seed: i64,
    /// Whether tent directions are spread over the bin's cell.
    pub jitter: bool,
    /// Increasing wavelengths; rings + 1 of them, or none for one ring.
    pub ring_edges: &'a [f64],
    /// Relative amplitude of each ring; none leaves them as they are.
    pub ring_gains: &'a [f64],
    /// Displacement of the longest wave, pixels.
    pub drift: Vectors<'a>,
    /// Displacement of all waves alike, pixels.
    pub shift: Vectors<'a>,
    /// Drift per frame.
    pub velocity: Vectors<'a>,
    /// Shift per frame.
    pub shift_rate: Vectors<'a>,
    /// What sampling in time does to the waves.
    pub filter: TemporalFilter,
    /// Per tile, the wavelength up to which waves are left out.
    pub shortest: Option<ArrayView2<'a, f64>>,
    /// Of a film that begins again: how each wave is bent.
    pub lap: Option<Lap<'a>>,
}

/// A film that begins again: every wave turns by a whole number of cycles meanwhile.
#[derive(Clone, Copy)]
pub struct Lap<'a> {
    /// Drift over the whole film.
    pub drift: Vectors<'a>,
    /// Shift over the whole film.
    pub shift: Vectors<'a>,
    /// How much of the film has passed, 0 to 1.
    pub part: f64,
}

/// The part of the frame that is wanted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Window {
    /// Image rows.
    pub rows: Range<usize>,
    /// Image columns.
    pub cols: Range<usize>,
}

/// A field made ready: waves listed, transforms planned, weights computed.
pub struct Ready<'f, 'a, T: Real> {
    pub(super) field: &'f Field<'a>,
    pub(super) down: Row,
    pub(super) across: Row,
    pub(super) parts: Arc<Parts<T>>,
    pub(super) transformed: AtomicUsize,
}

impl<T: Real> Ready<'_, '_, T> {
    /// How many tiles with waves were made so far; those between two workers count twice.
    pub fn transformed(&self) -> usize {
        self.transformed.load(Ordering::Relaxed)
    }
}

impl<'a> Field<'a> {
    pub(super) fn rings(&self) -> usize {
        self.ring_edges.len().saturating_sub(1).max(1)
    }

    /// Whether the filter does the same to all tiles.
    pub(super) fn tiles_alike(&self) -> bool {
        let one = |v: &Vectors<'_>| {
            let first = v.slice(s![0, 0, .., ..]);
            v.lanes(Axis(3))
                .into_iter()
                .enumerate()
                .all(|(i, pair)| pair == first.row(i % first.nrows()))
        };
        !self.jitter && self.shortest.is_none() && one(&self.velocity) && one(&self.shift_rate)
    }

    /// The motions of one tile's rings from a drift and a shift.
    pub(super) fn motions(
        &self,
        drift: Vectors<'_>,
        shift: Vectors<'_>,
        at: (usize, usize),
        out: &mut [Motion],
    ) {
        // The drift is that of the longest wave; the tent wants it in cycles.
        let cycles = |pixels: f64| pixels / self.band.longest;
        let pick = |v: &Vectors<'_>, ring: usize| {
            let place =
                |index: usize, axis: usize| if v.len_of(Axis(axis)) == 1 { 0 } else { index };
            let (row, col, ring) = (place(at.0, 0), place(at.1, 1), place(ring, 2));
            [v[(row, col, ring, 0)], v[(row, col, ring, 1)]]
        };
        for (ring, motion) in out.iter_mut().enumerate() {
            *motion = Motion { drift: pick(&drift, ring).map(cycles), shift: pick(&shift, ring) };
        }
    }

    /// Checks what the parts cannot check alone, and makes them ready.
    pub fn ready<T: Real>(&self) -> Result<Ready<'_, 'a, T>, Error> {
        let down =
            Row { length: self.shape.0, tile: self.tile.0, overlap: self.overlap }.checked()?;
        let across =
            Row { length: self.shape.1, tile: self.tile.1, overlap: self.overlap }.checked()?;
        self.filter.checked()?;
        if self.ring_edges.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(Error::invalid("ring_edges", "must increase"));
        }
        let grid = (down.count(), across.count());
        let sizes = [
            ("drift", &self.drift),
            ("shift", &self.shift),
            ("velocity", &self.velocity),
            ("shift_rate", &self.shift_rate),
        ];
        let whole = self.lap.as_ref().map(|lap| [("lap_drift", &lap.drift), ("shift", &lap.shift)]);
        for (name, vectors) in sizes.into_iter().chain(whole.into_iter().flatten()) {
            let (rows, cols, rings, pair) = vectors.dim();
            let fits = |n: usize, all: usize| n == 1 || n == all;
            // A shift is that of all waves.
            let most = if name.starts_with("shift") { 1 } else { self.rings() };
            if !(fits(rows, grid.0) && fits(cols, grid.1) && fits(rings, most) && pair == 2) {
                let message = format!(
                    "this frame has {} x {} tiles and {} rings, got vectors for {rows} x {cols} and {rings}",
                    grid.0,
                    grid.1,
                    self.rings()
                );
                return Err(Error::invalid(name, message));
            }
        }
        if let Some(shortest) = self.shortest.as_ref().filter(|map| map.dim() != grid) {
            let message = format!("must have shape {grid:?}, got {:?}", shortest.dim());
            return Err(Error::invalid("shortest", message));
        }
        let parts = parts::<T>(self, down, across)?;
        Ok(Ready { field: self, down, across, parts, transformed: AtomicUsize::new(0) })
    }
}
