//! The frequency grid of a tile: signed indices, frequencies, directions; and the random phases of its bins, one hash
//! per wave, odd in k, spanning a whole turn.

use ndarray::{ArrayViewMut2, Zip};

use crate::base::random::Hash;

/// The signed frequency index of array position `index` in fftfreq order; even sizes store the
/// Nyquist index as -n/2.
#[inline]
pub const fn signed(index: usize, n: usize) -> i64 {
    if index < n.div_ceil(2) { index as i64 } else { index as i64 - n as i64 }
}

#[inline]
pub const fn position(index: i64, n: usize) -> usize {
    index.rem_euclid(n as i64) as usize
}

/// Whether a signed index is the Nyquist index of its axis, its own mirror there.
#[inline]
pub const fn is_nyquist(index: i64, n: usize) -> bool {
    n.is_multiple_of(2) && index == -(n as i64 / 2)
}

/// Frequency in cycles per pixel, (y, x), with an axis' component zero on its Nyquist line.
///
/// A motion rate must be odd in k for the field to stay real. On a Nyquist line the bin is its own
/// mirror in that axis, so that only zero is odd there: the rule of spectral differentiation.
#[inline]
pub fn odd_frequency(ky: i64, kx: i64, (height, width): (usize, usize)) -> (f64, f64) {
    let component = |k: i64, n: usize| if is_nyquist(k, n) { 0.0 } else { k as f64 / n as f64 };
    (component(ky, height), component(kx, width))
}

/// |k| in cycles per pixel.
#[inline]
pub fn magnitude(ky: i64, kx: i64, (height, width): (usize, usize)) -> f64 {
    let (fy, fx) = (ky as f64 / height as f64, kx as f64 / width as f64);
    (fy * fy + fx * fx).sqrt()
}

/// The unit vector k'/|k'| as (y, x), odd in k; zero at dc.
///
/// Divided by |k'|, not multiplied by its reciprocal: on the axes it must be exactly 1.
#[inline]
pub fn direction(ky: i64, kx: i64, shape: (usize, usize)) -> (f64, f64) {
    let length = magnitude(ky, kx, shape);
    if length == 0.0 {
        return (0.0, 0.0);
    }
    let (fy, fx) = odd_frequency(ky, kx, shape);
    (fy / length, fx / length)
}

/// How a bin stands to its mirror -k.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The one of the pair whose hash is drawn.
    Leader,
    /// The other: minus the leader's phase.
    Mirror,
    /// Its own mirror (dc and, for even sizes, the corners).
    Alone,
}

/// The role of a bin among the random phases.
#[inline]
pub const fn role(ky: i64, kx: i64, (height, width): (usize, usize)) -> Role {
    let own_x = kx == 0 || is_nyquist(kx, width);
    let own_y = ky == 0 || is_nyquist(ky, height);
    if own_x && own_y {
        Role::Alone
    } else if (kx > 0 && !own_x) || (own_x && ky > 0) {
        Role::Leader
    } else {
        Role::Mirror
    }
}

/// A phase in cycles reduced to [-1/2, 1/2).
#[inline]
pub fn reduce(phase: f64) -> f64 {
    let rest = phase - (phase + 0.5).floor();
    // Adding 1/2 rounds: next to an edge the rest may land on the other side of it.
    match rest {
        _ if rest >= 0.5 => rest - 1.0,
        _ if rest < -0.5 => rest + 1.0,
        _ => rest,
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

pub fn bin_phase(tile: Hash, ky: i64, kx: i64, shape: (usize, usize)) -> f64 {
    match role(ky, kx, shape) {
        Role::Leader => leader_phase(tile.word(ky).word(kx)),
        // A Nyquist index is its own negative.
        Role::Mirror => {
            let own = |k: i64, n: usize| if is_nyquist(k, n) { k } else { -k };
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
