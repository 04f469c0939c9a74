//! What frames of one look share: the planned transform and the weights, kept from call to call.
//!
//! Planning takes a tenth of a small frame's time. The last few plans are kept for all threads. The
//! lock is only ever tried: after a fork it may be held for ever by a thread that no longer exists,
//! and then a plan is made anew.

use std::any::{Any, TypeId};
use std::sync::{Arc, Mutex};

use super::field::Field;
use super::tile::{Choice, Plan};
use super::tiles::{Blend, Row};
use super::waves::Waves;
use crate::error::Error;
use crate::real::Real;

/// Plans kept; the oldest one goes.
const KEPT: usize = 8;

/// Bands of more waves are planned anew each time: their plans take megabytes, their frames long.
const MOST_WAVES: usize = 30_000;

/// The transform and the weights (down, across) of a frame.
pub struct Parts<T: Real> {
    pub(super) plan: Plan<T>,
    pub(super) weights: (Vec<T>, Vec<T>),
}

#[derive(PartialEq)]
struct Key {
    pixel: TypeId,
    rows: (Row, Row),
    blend: Blend,
    /// Shortest and longest wavelength, exponent and ring edges, and the rings' gains, as bits: NaN
    /// is no one's key.
    band: Vec<u64>,
    gains: Vec<u64>,
}

type Kept = Vec<(Key, Arc<dyn Any + Send + Sync>)>;

static KEPT_PARTS: Mutex<Kept> = Mutex::new(Vec::new());

/// The parts of a field's frame, from the store or made.
pub fn parts<T: Real>(field: &Field<'_>, down: Row, across: Row) -> Result<Arc<Parts<T>>, Error> {
    let band = [field.band.shortest, field.band.longest, field.band.exponent];
    let key = Key {
        pixel: TypeId::of::<T>(),
        rows: (down, across),
        blend: field.blend,
        band: band.iter().chain(field.ring_edges).map(|value| value.to_bits()).collect(),
        gains: field.ring_gains.iter().map(|value| value.to_bits()).collect(),
    };
    if let Ok(kept) = KEPT_PARTS.try_lock() {
        let found = kept.iter().find(|(known, _)| *known == key);
        if let Some(Ok(parts)) = found.map(|(_, parts)| Arc::clone(parts).downcast()) {
            return Ok(parts);
        }
    }
    let waves = Waves::new(field.tile, field.band, field.ring_edges)?.weighted(field.ring_gains)?;
    let made = Arc::new(Parts {
        plan: Plan::new(&waves, Choice::Cheaper)?,
        weights: (down.weights(field.blend)?, across.weights(field.blend)?),
    });
    if waves.list.len() <= MOST_WAVES
        && let Ok(mut kept) = KEPT_PARTS.try_lock()
    {
        if kept.len() >= KEPT {
            kept.remove(0);
        }
        kept.push((key, made.clone()));
    }
    Ok(made)
}
