//! Random phases: one hash per wave, odd in k, spanning a whole turn.

use ndarray::{ArrayViewMut2, Zip};

use super::grid::{Role, role, signed};
use crate::base::random::Hash;

/// A phase in cycles reduced to [-1/2, 1/2).
#[inline]
pub fn reduce(phase: f64) -> f64 {
    let rest = phase - (phase + 0.5).floor();
    // Adding 1/2 rounds: next to an edge the rest may land on the other side of it.
    if rest >= 0.5 {
        rest - 1.0
    } else if rest < -0.5 {
        rest + 1.0
    } else {
        rest
    }
}

/// The hash of a tile, to which each wave adds its own words.
#[inline]
pub const fn tile_hash(seed: i64, row: i64, col: i64) -> Hash {
    Hash::seeded(seed).word(row).word(col)
}

/// A leader's phase in cycles.
#[inline]
pub const fn leader_phase(hash: Hash) -> f64 {
    let turn = hash.unit();
    if turn >= 0.5 { turn - 1.0 } else { turn }
}

/// The phase of any bin of a tile.
pub fn bin_phase(tile: Hash, ky: i64, kx: i64, shape: (usize, usize)) -> f64 {
    match role(ky, kx, shape) {
        Role::Leader => leader_phase(tile.word(ky).word(kx)),
        // A Nyquist index is its own negative.
        Role::Mirror => {
            let own = |k: i64, n: usize| if super::grid::is_nyquist(k, n) { k } else { -k };
            reduce(-leader_phase(tile.word(own(ky, shape.0)).word(own(kx, shape.1))))
        }
        Role::Alone => -0.5 * (tile.word(ky).word(kx).bits() >> 63) as f64,
    }
}

/// Random phases of a tile in fftfreq order.
pub fn random_phase(mut out: ArrayViewMut2<'_, f64>, seed: i64, (row, col): (i64, i64)) {
    let shape = out.dim();
    let tile = tile_hash(seed, row, col);
    Zip::indexed(&mut out).for_each(|(row, col), phase| {
        *phase = bin_phase(tile, signed(row, shape.0), signed(col, shape.1), shape);
    });
}
