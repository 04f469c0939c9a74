//! Flakes drawn into one tile: T *= 1 - alpha, pixel by pixel, flake after flake.
//!
//! The transmittance is float64 whatever the pixels are: 1e5 layers of alpha 1e-5 in float32 would
//! be wrong by 3e-3, because 1 - alpha rounds the same way each time. One tile of it fits the L1
//! cache. Alphas are computed in the pixels' type.
//!
//! A flake at rest is the product of two short vectors, one per axis. A streak is tilted, so its
//! pixels are computed one by one, but only those inside its rectangle, row by row, and the part
//! between the two ends, where nothing changes along the way, does without error functions.
//!
//! Loops over lanes are plain loops with a fixed count: a closure would not inherit the instruction
//! set that the function is compiled for, and would run many times slower.

#![expect(
    clippy::needless_range_loop,
    reason = "an index over lanes of a fixed count is what vectorises without closures"
)]

use super::bins::{Bins, Grid, TILE, touches};
use super::dim::LANES;
use super::profile::{self, Profile, TERMS};
use super::sprite::{REACH, Sprite};
use crate::base::cover::pixels;
use crate::base::error::{Cancel, Error};
use crate::base::simd::dispatch;

/// Pixels of a tile.
pub const PIXELS: usize = TILE * TILE;

/// Flakes between two looks at the cancel flag.
const LOOK: usize = 1024;

dispatch! {
    /// Multiplies what the flakes let through into a tile's transmittance.
    ///
    /// `depth`, where given, is the depth of what stands in the tile; a flake behind it is hidden. Pixels
    /// beyond the picture's border are computed like the others and never looked at.
    pub fn draw<P: Profile>(
        transmittance: &mut [f64; PIXELS],
        depth: Option<&[P; PIXELS]>,
        runs: &[Bins],
        grid: &Grid,
        tile: usize,
        cancel: &Cancel,
    ) -> Result<(), Error> = draw_with
}

#[inline(always)]
fn draw_with<P: Profile, const LEVEL: u8>(
    transmittance: &mut [f64; PIXELS],
    depth: Option<&[P; PIXELS]>,
    runs: &[Bins],
    grid: &Grid,
    tile: usize,
    cancel: &Cancel,
) -> Result<(), Error> {
    let origin = [tile % grid.columns, tile / grid.columns].map(corner);
    let (row, column) = (tile / grid.columns, tile % grid.columns);
    for bins in runs {
        let mut drawn = 0_usize;
        for (list, whole) in [(bins.small(tile), true), (bins.large(), false)] {
            for sprite in list {
                if !whole && !touches(sprite, row, column) {
                    continue;
                }
                drawn += 1;
                if drawn.is_multiple_of(LOOK) {
                    cancel.check()?;
                }
                if sprite.length == 0.0 {
                    disc::<P, LEVEL>(transmittance, depth, sprite, origin);
                } else {
                    streak::<P, LEVEL>(transmittance, depth, sprite, origin);
                }
            }
        }
        cancel.check()?;
    }
    Ok(())
}

#[inline(always)]
fn corner(place: usize) -> f64 {
    (place * TILE) as f64
}

/// The first pixel of `blocks` blocks of `lanes` that begin at `first`, moved to stay in the tile.
#[inline(always)]
fn begin(first: usize, count: usize, lanes: usize) -> (usize, usize) {
    let blocks = count.div_ceil(lanes);
    (first.min(TILE - blocks * lanes), blocks)
}

/// T *= 1 - alpha for one block of a row, hidden where the map is nearer.
#[inline(always)]
fn multiply<P: Profile, const N: usize, const LEVEL: u8>(
    transmittance: &mut [f64; PIXELS],
    map: Option<&[P; PIXELS]>,
    depth: P,
    at: usize,
    alpha: &mut [P; N],
) {
    if let Some(map) = map {
        let map: &[P; N] = map[at..at + N].try_into().expect("a block lies in the tile");
        for k in 0..N {
            // NaN in the map hides nothing.
            alpha[k] = if map[k] < depth { P::zero() } else { alpha[k] };
        }
    }
    dim::<P, LEVEL>(&mut transmittance[at..at + N], P::one(), alpha);
}

/// T *= 1 - weight * profile for whole lanes.
#[inline(always)]
fn dim<P: Profile, const LEVEL: u8>(through: &mut [f64], weight: P, profile: &[P]) {
    let lanes = through.chunks_exact_mut(LANES).zip(profile.chunks_exact(LANES));
    for (through, profile) in lanes {
        let (Some(through), Some(profile)) = (through.first_chunk_mut(), profile.first_chunk())
        else {
            return;
        };
        // SAFETY: `draw` asks the processor before it takes a level.
        unsafe { P::dim::<LEVEL>(through, weight, profile) };
    }
}

#[inline(always)]
fn disc<P: Profile, const LEVEL: u8>(
    transmittance: &mut [f64; PIXELS],
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
    let place = Place { map, depth: P::of(sprite.depth), left, top, rows };
    if blocks <= 2 && row_blocks <= 2 {
        // Most flakes. Both axes at once, so that the chain of the exponential is waited for once.
        let mut values = [P::zero(); 4 * LANES];
        for k in 0..4 * LANES {
            let (start, scale) =
                if k < 2 * LANES { (first_x, P::one()) } else { (first_y, amplitude) };
            let offset = P::of((k % (2 * LANES)) as f64);
            values[k] = scale * profile::gaussian(start + offset * step);
        }
        let (across, down) = values.split_at(2 * LANES);
        if blocks == 1 {
            outer::<P, LANES, LEVEL>(transmittance, &place, 1, across, down);
        } else {
            outer::<P, { 2 * LANES }, LEVEL>(transmittance, &place, 1, across, down);
        }
    } else {
        let across = axis::<P>(first_x, step, P::one(), blocks);
        let down = axis::<P>(first_y, step, amplitude, row_blocks);
        outer::<P, LANES, LEVEL>(transmittance, &place, blocks, &across, &down);
    }
}

/// Where a disc lies in its tile.
struct Place<'a, P> {
    map: Option<&'a [P; PIXELS]>,
    depth: P,
    left: usize,
    top: usize,
    rows: std::ops::Range<usize>,
}

/// The product of the two axes, `blocks` blocks of N columns.
#[inline(always)]
fn outer<P: Profile, const N: usize, const LEVEL: u8>(
    transmittance: &mut [f64; PIXELS],
    place: &Place<'_, P>,
    blocks: usize,
    across: &[P],
    down: &[P],
) {
    for block in 0..blocks {
        let profile: &[P; N] = across[block * N..(block + 1) * N].try_into().expect("whole blocks");
        for row in place.rows.start..place.rows.end {
            let weight = down[row - place.top];
            let at = row * TILE + place.left + block * N;
            if place.map.is_none() {
                dim::<P, LEVEL>(&mut transmittance[at..at + N], weight, profile);
                continue;
            }
            let mut alpha = [P::zero(); N];
            for k in 0..N {
                alpha[k] = weight * profile[k];
            }
            multiply::<P, N, LEVEL>(transmittance, place.map, place.depth, at, &mut alpha);
        }
    }
}

/// The profile at `start`, `start + step`, ... for `blocks` blocks.
#[inline(always)]
fn axis<P: Profile>(start: P, step: P, scale: P, blocks: usize) -> [P; TILE] {
    let mut values = [P::zero(); TILE];
    for block in 0..blocks {
        let values: &mut [P; LANES] =
            (&mut values[block * LANES..(block + 1) * LANES]).try_into().expect("whole blocks");
        for k in 0..LANES {
            let offset = P::of((block * LANES + k) as f64);
            values[k] = scale * profile::gaussian(start + offset * step);
        }
    }
    values
}

/// What is the same for all pixels of a streak.
struct Sweep<P> {
    /// Steps per pixel to the right, in sigma: along the streak and across it.
    step_along: P,
    step_across: P,
    amplitude: P,
    half: P,
    series: [P; TERMS],
}

#[inline(always)]
fn streak<P: Profile, const LEVEL: u8>(
    transmittance: &mut [f64; PIXELS],
    map: Option<&[P; PIXELS]>,
    sprite: &Sprite,
    origin: [f64; 2],
) {
    const BLOCK: usize = 2 * LANES;
    let (low, high) = sprite.bounds();
    let Some(rows) = pixels(low[1] - origin[1], high[1] - origin[1], TILE) else { return };
    let [x, y] = [sprite.start[0] - origin[0], sprite.start[1] - origin[1]];
    let [ux, uy] = sprite.along;
    let inverse = 1.0 / sprite.sigma;
    let reach = REACH * sprite.sigma;
    let length = sprite.length * inverse;
    let short = length < P::SHORT;
    let amplitude = if short {
        sprite.amplitude
    } else {
        sprite.amplitude * std::f64::consts::FRAC_PI_2.sqrt() / length
    };
    let coefficients = if short { profile::series(length) } else { [0.0; TERMS] };
    let mut series = [P::zero(); TERMS];
    for k in 0..TERMS {
        series[k] = P::of(coefficients[k]);
    }
    let sweep = Sweep {
        step_along: P::of(ux * inverse),
        step_across: P::of(-uy * inverse),
        amplitude: P::of(amplitude),
        half: P::of(0.5 * length),
        series,
    };
    let depth = P::of(sprite.depth);
    // A square footprint's middle, and its axes in units of its own spread along each.
    let square = sprite.square();
    let [middle_x, middle_y] = [0.5 * sprite.length * ux, 0.5 * sprite.length * uy];
    let [wide_x, wide_y] = profile::widening([length * ux, length * uy]);
    let (by_wide_x, by_wide_y) = (inverse / wide_x, inverse / wide_y);
    // Where a row (h below the start) meets the tilted rectangle: two slanted strips.
    let (by_x, by_y) = (1.0 / ux, 1.0 / uy);
    for row in rows {
        let h = row as f64 + 0.5 - y;
        let (mut left, mut right) = (f64::NEG_INFINITY, f64::INFINITY);
        if square {
            (left, right) = (low[0] - sprite.start[0], high[0] - sprite.start[0]);
        } else if uy.abs() > 1e-9 {
            let middle = h * ux * by_y;
            let half = reach * by_y.abs();
            (left, right) = (middle - half, middle + half);
        }
        if !square && ux.abs() > 1e-9 {
            let middle = (0.5 * sprite.length - h * uy) * by_x;
            let half = (0.5 * sprite.length + reach) * by_x.abs();
            left = left.max(middle - half);
            right = right.min(middle + half);
        }
        let Some(columns) = pixels(x + left, x + right, TILE) else { continue };
        let (first, blocks) = begin(columns.start, columns.len(), BLOCK);
        for block in 0..blocks {
            let column = first + block * BLOCK;
            let right = column as f64 + 0.5 - x;
            let from_start = (right * ux + h * uy) * inverse;
            let across = (h * ux - right * uy) * inverse;
            let mut alpha = [P::zero(); BLOCK];
            let along = from_start - 0.5 * length;
            let rims = if square {
                let (x, y) = ((right - middle_x) * by_wide_x, (h - middle_y) * by_wide_y);
                [
                    Rim { start: P::of(x), step: P::of(by_wide_x), half: P::zero() },
                    Rim { start: P::of(y), step: P::zero(), half: P::zero() },
                ]
            } else {
                [
                    Rim { start: P::of(across), step: sweep.step_across, half: P::zero() },
                    Rim { start: P::of(along), step: sweep.step_along, half: sweep.half },
                ]
            };
            if short {
                blurred_short(&sweep, along, across, &mut alpha);
                end(&rims, &mut alpha);
            } else if square {
                blurred_square(&sweep, from_start, length - from_start, across, &mut alpha);
                end(&rims, &mut alpha);
            } else {
                blurred(&sweep, from_start, length - from_start, across, &mut alpha);
            }
            let at = row * TILE + column;
            multiply::<P, BLOCK, LEVEL>(transmittance, map, depth, at, &mut alpha);
        }
    }
}

#[inline(always)]
fn blurred_short<P: Profile, const N: usize>(
    sweep: &Sweep<P>,
    along: f64,
    across: f64,
    alpha: &mut [P; N],
) {
    let (x, q) = (P::of(along), P::of(across));
    for k in 0..N {
        let offset = P::of(k as f64);
        alpha[k] = sweep.amplitude
            * profile::swept_short(
                x + offset * sweep.step_along,
                q + offset * sweep.step_across,
                sweep.half,
                sweep.series,
            );
    }
}

/// One of the two directions in which a footprint ends: from `half` around 0, in sigma.
struct Rim<P> {
    start: P,
    step: P,
    half: P,
}

#[inline(always)]
fn end<P: Profile, const N: usize>(rims: &[Rim<P>; 2], alpha: &mut [P; N]) {
    for k in 0..N {
        let offset = P::of(k as f64);
        let [a, b] = rims;
        let a = profile::rim((a.start + offset * a.step).abs() - a.half);
        let b = profile::rim((b.start + offset * b.step).abs() - b.half);
        alpha[k] *= a * b;
    }
}

/// In float64 the series ends before footprints turn from square to tilted.
#[inline(always)]
fn blurred_square<P: Profile, const N: usize>(
    sweep: &Sweep<P>,
    from_start: f64,
    from_end: f64,
    across: f64,
    alpha: &mut [P; N],
) {
    let (a, b, q) = (P::of(from_start), P::of(from_end), P::of(across));
    for k in 0..N {
        let offset = P::of(k as f64);
        let step = offset * sweep.step_along;
        let bare = profile::bare(q + offset * sweep.step_across);
        alpha[k] = sweep.amplitude * bare * profile::swept(a + step, b - step);
    }
}

#[inline(always)]
fn blurred<P: Profile, const N: usize>(
    sweep: &Sweep<P>,
    from_start: f64,
    from_end: f64,
    across: f64,
    alpha: &mut [P; N],
) {
    let q = P::of(across);
    for k in 0..N {
        alpha[k] = sweep.amplitude * profile::gaussian(q + P::of(k as f64) * sweep.step_across);
    }
    // The least distances from the ends that any lane has.
    let last = sweep.step_along.wide() * (N - 1) as f64;
    let (least_a, least_b) = (from_start + last.min(0.0), from_end - last.max(0.0));
    let (a, b) = (P::of(from_start), P::of(from_end));
    if least_a >= P::SATURATED && least_b >= P::SATURATED {
        for k in 0..N {
            alpha[k] = alpha[k] + alpha[k];
        }
    } else if least_b >= P::SATURATED {
        one_end(a, sweep.step_along, alpha);
    } else if least_a >= P::SATURATED {
        one_end(b, -sweep.step_along, alpha);
    } else {
        for k in 0..N {
            let step = P::of(k as f64) * sweep.step_along;
            let (a, b) = (a + step, b - step);
            let nearest = if a < b { a } else { b };
            alpha[k] *= profile::swept(a, b) * profile::rim(-nearest);
        }
    }
}

#[inline(always)]
fn one_end<P: Profile, const N: usize>(start: P, step: P, alpha: &mut [P; N]) {
    for k in 0..N {
        let from_end = start + P::of(k as f64) * step;
        alpha[k] *= profile::swept_end(from_end) * profile::rim(-from_end);
    }
}
