//! What the flakes of a tile are drawn on: transmittance, alone or with the number of the flake that shows
//! most.

#![expect(unsafe_code, reason = "vectors by `Lanes`")]

use super::bins::{PIXELS, TILE};
use super::profile::Profile;
use crate::base::lanes::Lanes;
use crate::base::real::Real;
use crate::base::simd::{AVX2, AVX512};

/// The number where no flake is.
pub const NONE: i32 = -1;

/// A tile that flakes are drawn on, one after the other.
pub trait Canvas {
    /// Says which flake comes next.
    fn next(&mut self, number: i32);

    /// Takes the flake's alphas at LANES pixels from `at` on: weight * profile.
    fn take<const LEVEL: u8>(&mut self, at: usize, weight: f64, profile: &[f64; LANES]);
}

/// T *= 1 - alpha.
impl Canvas for [f64; PIXELS] {
    #[inline(always)]
    fn next(&mut self, _: i32) {}

    #[inline(always)]
    fn take<const LEVEL: u8>(&mut self, at: usize, weight: f64, profile: &[f64; LANES]) {
        rows::<LEVEL>(&mut self[at..at + LANES], weight, profile);
    }
}

/// Transmittance, and at every pixel the flake whose own alpha is the greatest; of equals the first.
pub struct Numbered {
    /// T, with the bits that it has alone.
    pub through: [f64; PIXELS],
    pub most: [f64; PIXELS],
    /// Whose it is, or [`NONE`].
    pub numbers: [i32; PIXELS],
    drawn: i32,
}

impl Numbered {
    pub fn new() -> Self {
        Self { through: [1.0; PIXELS], most: [0.0; PIXELS], numbers: [NONE; PIXELS], drawn: NONE }
    }
}

impl Canvas for Numbered {
    #[inline(always)]
    fn next(&mut self, number: i32) {
        self.drawn = number;
    }

    #[inline(always)]
    fn take<const LEVEL: u8>(&mut self, at: usize, weight: f64, profile: &[f64; LANES]) {
        rows::<LEVEL>(&mut self.through[at..at + LANES], weight, profile);
        let most: &mut [f64; LANES] =
            (&mut self.most[at..at + LANES]).try_into().expect("a block in a tile");
        let numbers: &mut [i32; LANES] =
            (&mut self.numbers[at..at + LANES]).try_into().expect("a block in a tile");
        for k in 0..LANES {
            let alpha = weight * profile[k];
            let first = (alpha == most[k]) & (self.drawn < numbers[k]);
            let wins = (alpha > most[k]) | first;
            most[k] = if wins { alpha } else { most[k] };
            numbers[k] = if wins { self.drawn } else { numbers[k] };
        }
    }
}

/// Pixels at a time.
pub const LANES: usize = 8;

/// T *= 1 - weight * profile in float64, for whole lanes; in functions that are compiled for the level.
///
/// Left to itself the compiler makes vectors of eight rows, and gathers and scatters their pixels.
#[inline(always)]
pub fn rows<const LEVEL: u8>(through: &mut [f64], weight: f64, profile: &[f64]) {
    let lanes = through.chunks_exact_mut(LANES).zip(profile.chunks_exact(LANES));
    for (through, profile) in lanes {
        // SAFETY: `dispatch` asks the processor before it takes a level; both hold LANES numbers.
        unsafe {
            match LEVEL {
                AVX512 => dim::<<f64 as Real>::Avx512>(through, weight, profile),
                AVX2 => dim::<<f64 as Real>::Avx2>(through, weight, profile),
                _ => dim::<<f64 as Real>::Portable>(through, weight, profile),
            }
        }
    }
}

/// # Safety
///
/// The processor has the vectors' instructions, and both slices hold LANES numbers.
#[inline(always)]
unsafe fn dim<V: Lanes<f64>>(through: &mut [f64], weight: f64, profile: &[f64]) {
    for at in (0..LANES).step_by(V::N) {
        // SAFETY: N divides LANES; the rest is the caller's.
        unsafe {
            let to = through.as_mut_ptr().add(at);
            let left =
                V::splat(weight).product_from(V::load(profile.as_ptr().add(at)), V::splat(1.0));
            left.mul(V::load(to)).store(to);
        }
    }
}

/// The first pixel of `blocks` blocks of `lanes` that begin at `first`, moved to stay in the tile.
#[inline(always)]
pub fn begin(first: usize, count: usize, lanes: usize) -> (usize, usize) {
    let blocks = count.div_ceil(lanes);
    (first.min(TILE - blocks * lanes), blocks)
}

/// Lanes of a row, weight * profile, hidden where the map is nearer.
#[inline(always)]
pub fn multiply<P: Profile, C: Canvas, const LEVEL: u8>(
    canvas: &mut C,
    map: Option<&[P; PIXELS]>,
    depth: P,
    at: usize,
    (weight, profile): (f64, &[f64; LANES]),
) {
    let Some(map) = map else { return canvas.take::<LEVEL>(at, weight, profile) };
    let map: &[P; LANES] = map[at..at + LANES].try_into().expect("lanes lie in the tile");
    let mut seen = *profile;
    for k in 0..LANES {
        // NaN in the map hides nothing.
        seen[k] = if map[k] < depth { 0.0 } else { seen[k] };
    }
    canvas.take::<LEVEL>(at, weight, &seen);
}
