//! Pixels: which of them an interval covers, and Gaussians that are sampled at their centres, or at texels.
//!
//! A narrow one loses or gains energy with its place between pixels, so it is drawn wider, with
//! sigma_e^2 = max(sigma^2 + 1/12, 0.38), and fainter by the same factor.

use std::ops::Range;

use crate::base::real::Real;

/// The pixels (of `count`) whose centres j + 1/2 lie in [low, high].
#[inline(always)]
pub fn pixels(low: f64, high: f64, count: usize) -> Option<Range<usize>> {
    // Clamped before the cast, since a bound may be 1e30.
    let limit = count as i64 as f64;
    let first = (low - 0.5).clamp(0.0, limit);
    let end = (high + 0.5).clamp(0.0, limit);
    // The casts truncate, which is the floor of what is not negative; `floor` and `ceil` would be calls
    // where SSE 4.1 is not assumed. Signed integers convert in one instruction, unsigned ones in
    // several.
    let whole = first as i64;
    let start = whole as usize + usize::from(first > whole as f64);
    let end = end as i64 as usize;
    (start < end).then_some(start..end)
}

/// Below this variance (px^2) samples alias: exp(-2 pi^2 0.38) = 5.5e-4 of the energy per axis.
const LEAST_VARIANCE: f64 = 0.38;

/// The least sigma in px, before the pixel's square widens it, of an image that is integrated over
/// each square: it keeps its energy at any place, so it may be narrower than one that is sampled.
pub const LEAST_SIGMA: f64 = 0.3;

/// sigma_e^2 of a Gaussian of this variance, px^2.
#[inline(always)]
pub fn sampled(variance: f64) -> f64 {
    (variance + 1.0 / 12.0).max(LEAST_VARIANCE)
}

#[inline(always)]
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The cubic by which things fade in and out: 0 below 0, 1 above 1, and 3 t^2 - 2 t^3 between.
#[inline(always)]
pub fn smoothstep<T: Real>(t: T) -> T {
    let t = num_traits::clamp(t, T::zero(), T::one());
    t * t * (T::of(3.0) - T::of(2.0) * t)
}
