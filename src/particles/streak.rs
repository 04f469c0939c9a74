//! A flake that moves during the exposure, drawn into one tile.
//!
//! Its footprint is tilted, so its pixels are computed one by one, but only those inside its rectangle,
//! row by row, and the part between the two ends, where nothing changes along the way, does without
//! error functions.

#![expect(
    clippy::needless_range_loop,
    reason = "an index over lanes of a fixed count is what vectorises without closures"
)]

use super::bins::TILE;
use super::dim::LANES;
use super::draw::{PIXELS, begin, multiply};
use super::profile::{self, Profile, TERMS};
use super::sprite::{REACH, Sprite};
use crate::base::cover::pixels;

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
pub(super) fn streak<P: Profile, const LEVEL: u8>(
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
