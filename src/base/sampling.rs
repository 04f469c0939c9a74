//! A Gaussian that is sampled at pixel centres, or at texels.
//!
//! A narrow one loses or gains energy with its place between pixels, so it is drawn wider, with
//! sigma_e^2 = max(sigma^2 + 1/12, 0.38), and fainter by the same factor.

/// The variance of one pixel's box, by which sampling widens a Gaussian.
pub const PIXEL_VARIANCE: f64 = 1.0 / 12.0;

/// Below this variance (px^2) samples alias: exp(-2 pi^2 0.38) = 5.5e-4 of the energy per axis.
pub const LEAST_VARIANCE: f64 = 0.38;

/// The least sigma in px, before the pixel's square widens it, of an image that is integrated over
/// each square: it keeps its energy at any place, so it may be narrower than one that is sampled.
pub const LEAST_SIGMA: f64 = 0.3;

/// sigma_e^2 of a Gaussian of this variance, px^2.
#[inline(always)]
pub fn sampled(variance: f64) -> f64 {
    (variance + PIXEL_VARIANCE).max(LEAST_VARIANCE)
}
