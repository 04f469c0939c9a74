//! One whole frame of the field: tiles, their motion, their blend, and what is done with each row.

use std::any::{Any, TypeId};
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use ndarray::{Array2, Array4, Axis, s};

use super::band::Band;
use super::filter::TemporalFilter;
use super::tent::Motion;
use super::tile::Plan;
use super::tiles::{Blend, Row};
use super::waves::Waves;
use crate::base::error::Error;
use crate::base::real::Real;
use crate::base::simd::reproducible;

/// Vectors (x, y) for all tiles and rings: shape (rows or 1, cols or 1, rings or 1, 2).
pub type Vectors = Array4<f64>;

/// Everything that defines a frame of the field (api.md, `spectral.field`).
pub struct Field {
    /// (H, W).
    pub shape: (usize, usize),
    /// Tile size (rows, cols).
    pub tile: (usize, usize),
    /// Pixels shared by neighbouring tiles.
    pub overlap: usize,
    pub blend: Blend,
    pub band: Band,
    pub seed: i64,
    /// Whether tent directions are spread over the bin's cell.
    pub jitter: bool,
    /// Increasing wavelengths; rings + 1 of them, or none for one ring.
    pub ring_edges: Vec<f64>,
    /// Relative amplitude of each ring; none leaves them as they are.
    pub ring_gains: Vec<f64>,
    /// Displacement of the longest wave, pixels.
    pub drift: Vectors,
    /// Displacement of all waves alike, pixels.
    pub shift: Vectors,
    pub velocity: Vectors,
    pub shift_rate: Vectors,
    pub filter: TemporalFilter,
    /// Per tile, the wavelength up to which waves are left out.
    pub shortest: Option<Array2<f64>>,
    /// Of a film that begins again: how each wave is bent.
    pub lap: Option<Lap>,
}

/// A film that begins again: every wave turns by a whole number of cycles meanwhile.
pub struct Lap {
    /// Drift over the whole film.
    pub drift: Vectors,
    /// Shift over the whole film.
    pub shift: Vectors,
    /// How much of the film has passed, 0 to 1.
    pub part: f64,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Window {
    pub rows: Range<usize>,
    pub cols: Range<usize>,
}

/// A field made ready: waves listed, transforms planned, weights computed.
pub struct Ready<'f, T: Real> {
    pub field: &'f Field,
    pub down: Row,
    pub across: Row,
    pub parts: Arc<Parts<T>>,
    pub transformed: AtomicUsize,
}

impl<T: Real> Ready<'_, T> {
    /// How many tiles with waves were made so far; those between two workers count twice.
    pub fn transformed(&self) -> usize {
        self.transformed.load(Ordering::Relaxed)
    }
}

impl Field {
    pub fn rings(&self) -> usize {
        self.ring_edges.len().saturating_sub(1).max(1)
    }

    /// Whether the filter does the same to all tiles.
    pub fn tiles_alike(&self) -> bool {
        let one = |v: &Vectors| {
            let first = v.slice(s![0, 0, .., ..]);
            v.lanes(Axis(3))
                .into_iter()
                .enumerate()
                .all(|(i, pair)| pair == first.row(i % first.nrows()))
        };
        !self.jitter && self.shortest.is_none() && one(&self.velocity) && one(&self.shift_rate)
    }

    /// The motions of one tile's rings from a drift and a shift.
    pub fn motions(
        &self,
        drift: &Vectors,
        shift: &Vectors,
        at: (usize, usize),
        out: &mut [Motion],
    ) {
        // The drift is that of the longest wave; the tent wants it in cycles.
        let cycles = |pixels: f64| pixels / self.band.longest;
        let pick = |v: &Vectors, ring: usize| {
            let place =
                |index: usize, axis: usize| if v.len_of(Axis(axis)) == 1 { 0 } else { index };
            let (row, col, ring) = (place(at.0, 0), place(at.1, 1), place(ring, 2));
            [v[(row, col, ring, 0)], v[(row, col, ring, 1)]]
        };
        for (ring, motion) in out.iter_mut().enumerate() {
            *motion = Motion { drift: pick(drift, ring).map(cycles), shift: pick(shift, ring) };
        }
    }

    /// Checks what the parts cannot check alone, and makes them ready.
    pub fn ready<T: Real>(&self) -> Result<Ready<'_, T>, Error> {
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
                let ((down, across), own) = (grid, self.rings());
                let message = format!(
                    "this frame has {down} x {across} tiles and {own} rings, got vectors for {rows} x {cols} and {rings}"
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

// What frames of one look share, the planned transform and the weights, is kept from call to call: planning takes a
// tenth of a small frame's time. The lock is only ever tried: after a fork it may be held for ever by a thread that no
// longer exists, and then a plan is made anew.

/// Plans kept, and waves of all of them, some 20 MB. The one that was not used for longest goes.
const KEPT: usize = 32;
const KEPT_WAVES: usize = 150_000;

/// Bands of more waves are planned anew each time: their plans take many megabytes, their frames long.
/// A tile of rain has 85,000 waves.
const MOST_WAVES: usize = 100_000;

/// The transform and the weights (down, across) of a frame.
pub struct Parts<T: Real> {
    pub plan: Plan<T>,
    pub weights: (Vec<T>, Vec<T>),
}

#[derive(PartialEq)]
struct Key {
    pixel: TypeId,
    /// Plans of the reproducible mode are others.
    plain: bool,
    rows: (Row, Row),
    blend: Blend,
    /// Shortest and longest wavelength, exponent and ring edges, and the rings' gains, as bits: NaN
    /// is no one's key.
    band: Vec<u64>,
    gains: Vec<u64>,
}

/// With how many waves each has; the last one used stands last.
type Kept = Vec<(Key, usize, Arc<dyn Any + Send + Sync>)>;

static KEPT_PARTS: Mutex<Kept> = Mutex::new(Vec::new());

/// The parts of a field's frame, from the store or made.
fn parts<T: Real>(field: &Field, down: Row, across: Row) -> Result<Arc<Parts<T>>, Error> {
    let band = [field.band.shortest, field.band.longest, field.band.exponent];
    let plain = reproducible();
    let key = Key {
        pixel: TypeId::of::<T>(),
        plain,
        rows: (down, across),
        blend: field.blend,
        band: band.iter().chain(&field.ring_edges).map(|value| value.to_bits()).collect(),
        gains: field.ring_gains.iter().map(|value| value.to_bits()).collect(),
    };
    if let Ok(mut kept) = KEPT_PARTS.try_lock()
        && let Some(at) = kept.iter().position(|(known, _, _)| *known == key)
    {
        kept[at..].rotate_left(1);
        if let Some(Ok(parts)) = kept.last().map(|(_, _, parts)| Arc::clone(parts).downcast()) {
            return Ok(parts);
        }
    }
    let waves =
        Waves::new(field.tile, field.band, &field.ring_edges)?.weighted(&field.ring_gains)?;
    let made = Arc::new(Parts {
        plan: Plan::new(&waves, plain)?,
        weights: (down.weights(field.blend)?, across.weights(field.blend)?),
    });
    if waves.list.len() <= MOST_WAVES
        && let Ok(mut kept) = KEPT_PARTS.try_lock()
    {
        let count = waves.list.len();
        while kept.len() >= KEPT
            || kept.iter().map(|(_, waves, _)| waves).sum::<usize>() + count > KEPT_WAVES
        {
            kept.remove(0);
        }
        kept.push((key, count, made.clone()));
    }
    Ok(made)
}
