//! Flakes placed in blocks, by vectors: those out of view are dropped before more is asked of them.

use std::ops::Range;

use super::torus::Carried;
use crate::base::error::Error;
use crate::base::simd::dispatch;

/// Flakes of a block.
const BLOCK: usize = 64;

/// Who knows what is seen.
pub trait Eye: Sync {
    /// Whether a flake at a place may be seen.
    fn sees(&self, place: [f64; 3]) -> bool;
}

/// Hands on the flakes of a range that an eye may see, in their order: index, and place before the sway.
#[inline(always)]
pub fn each_seen<E: Eye>(
    carried: &Carried,
    eye: &E,
    range: Range<usize>,
    mut see: impl FnMut(usize, [f64; 3]) -> Result<(), Error>,
) -> Result<(), Error> {
    let (mut places, mut seen) = ([[0.0; BLOCK]; 3], [false; BLOCK]);
    for first in range.clone().step_by(BLOCK) {
        look(carried, eye, first, &mut places, &mut seen);
        for index in first..range.end.min(first + BLOCK) {
            let at = index - first;
            if seen[at] {
                see(index, places.map(|axis| axis[at]))?;
            }
        }
    }
    Ok(())
}

dispatch! {
    /// Places a block, and says which of its flakes may be seen.
    fn look<E: Eye>(
        carried: &Carried,
        eye: &E,
        first: usize,
        places: &mut [[f64; BLOCK]; 3],
        seen: &mut [bool; BLOCK],
    ) = look_with
}

#[inline(always)]
fn look_with<E: Eye, const LEVEL: u8>(
    carried: &Carried,
    eye: &E,
    first: usize,
    places: &mut [[f64; BLOCK]; 3],
    seen: &mut [bool; BLOCK],
) {
    *places = carried.places(first);
    let [x, y, z] = places;
    for (seen, ((&x, &y), &z)) in seen.iter_mut().zip(x.iter().zip(y.iter()).zip(z.iter())) {
        *seen = eye.sees([x, y, z]);
    }
}
