//! A flake drawn into one tile: T *= 1 - alpha, pixel by pixel, flake after flake.
//!
//! The transmittance is float64 whatever the pixels are: 1e5 layers of alpha 1e-5 in float32 would
//! be wrong by 3e-3, because 1 - alpha rounds the same way each time. One tile of it fits the L1
//! cache. Alphas are computed in the pixels' type.
//!
//! A flake at rest is the product of two short vectors, one per axis; one that moves is a [`streak`].
//!
//! Loops over lanes are plain loops with a fixed count: a closure would not inherit the instruction
//! set that the function is compiled for, and would run many times slower.

use super::balls::{Balls, Outline, ball};
use super::bins::{PIXELS, TILE};
use super::canvas::{Canvas, LANES, begin, multiply};
use super::profile::{self, Profile};
use super::sprite::{REACH, Sprite};
use super::streak::streak;
use crate::base::pixel::pixels;

#[inline(always)]
pub fn one<P: Profile, C: Canvas, const LEVEL: u8>(
    canvas: &mut C,
    depth: Option<&[P; PIXELS]>,
    sprite: &Sprite,
    origin: [f64; 2],
    balls: Option<(&Balls, &Outline)>,
) {
    if let Some(balls) = balls {
        ball::<P, C, LEVEL>(canvas, depth, sprite, origin, balls);
    } else if sprite.length == 0.0 {
        disc::<P, C, LEVEL>(canvas, depth, sprite, origin);
    } else {
        streak::<P, C, LEVEL>(canvas, depth, sprite, origin);
    }
}

#[inline(always)]
fn disc<P: Profile, C: Canvas, const LEVEL: u8>(
    canvas: &mut C,
    map: Option<&[P; PIXELS]>,
    sprite: &Sprite,
    origin: [f64; 2],
) {
    let [x, y] = [sprite.start[0] - origin[0], sprite.start[1] - origin[1]];
    let reach = REACH * sprite.sigma;
    let Some(columns) = pixels(x - reach, x + reach, TILE) else { return };
    let Some(rows) = pixels(y - reach, y + reach, TILE) else { return };
    let (left, blocks) = begin(columns.start, columns.len(), LANES);
    let (top, row_blocks) = begin(rows.start, rows.len(), LANES);
    let inverse = 1.0 / sprite.sigma;
    let (first_x, first_y) = (left as f64 + 0.5 - x, top as f64 + 0.5 - y);
    let (first_x, first_y) = (P::of(first_x * inverse), P::of(first_y * inverse));
    let (step, amplitude) = (P::of(inverse), P::of(sprite.amplitude));
    let depth = P::of(sprite.depth);
    // Returned by value they would be copied before they are written.
    let (mut across, mut down) = ([P::zero(); TILE], [P::zero(); TILE]);
    axis::<P, LEVEL>(first_x, step, P::one(), &mut across[..blocks * LANES]);
    axis::<P, LEVEL>(first_y, step, amplitude, &mut down[..row_blocks * LANES]);
    for block in 0..blocks {
        let mut profile = [0.0; LANES];
        for k in 0..LANES {
            profile[k] = across[block * LANES + k].wide();
        }
        for row in rows.start..rows.end {
            let at = row * TILE + left + block * LANES;
            let weight = down[row - top].wide();
            multiply::<P, C, LEVEL>(canvas, map, depth, at, (weight, &profile));
        }
    }
}

/// The profile at `start`, `start + step`, ... in whole blocks.
#[inline(always)]
fn axis<P: Profile, const LEVEL: u8>(start: P, step: P, scale: P, values: &mut [P]) {
    for (block, values) in values.chunks_exact_mut(LANES).enumerate() {
        for k in 0..LANES {
            let offset = P::of((block * LANES + k) as f64);
            values[k] = scale * profile::gaussian::<P, LEVEL>(start + offset * step);
        }
    }
}
