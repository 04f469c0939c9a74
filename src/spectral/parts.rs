//! What frames of one look share: the planned transform and the weights, kept from call to call.
//!
//! Planning takes a tenth of a small frame's time. The last few plans are kept for all threads. The
//! lock is only ever tried: after a fork it may be held for ever by a thread that no longer exists,
//! and then a plan is made anew.

use std::any::{Any, TypeId};
use std::sync::{Arc, Mutex};

use super::field::Field;
use super::tile::Plan;
use super::tiles::{Blend, Row};
use super::waves::Waves;
use crate::base::error::Error;
use crate::base::real::Real;
use crate::base::simd::reproducible;

/// Plans kept, and waves of all of them, some 20 MB. The one that was not used for longest goes.
const KEPT: usize = 32;
const KEPT_WAVES: usize = 150_000;

/// Bands of more waves are planned anew each time: their plans take many megabytes, their frames long.
/// A tile of rain has 85,000 waves.
const MOST_WAVES: usize = 100_000;

/// The transform and the weights (down, across) of a frame.
pub struct Parts<T: Real> {
    pub(super) plan: Plan<T>,
    pub(super) weights: (Vec<T>, Vec<T>),
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
pub fn parts<T: Real>(field: &Field<'_>, down: Row, across: Row) -> Result<Arc<Parts<T>>, Error> {
    let band = [field.band.shortest, field.band.longest, field.band.exponent];
    let plain = reproducible();
    let key = Key {
        pixel: TypeId::of::<T>(),
        plain,
        rows: (down, across),
        blend: field.blend,
        band: band.iter().chain(field.ring_edges).map(|value| value.to_bits()).collect(),
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
    let waves = Waves::new(field.tile, field.band, field.ring_edges)?.weighted(field.ring_gains)?;
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
