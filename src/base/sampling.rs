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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_of_samples_hardly_depends_on_the_place() {
        // The least width, at the worst places: on a pixel's centre and on its edge.
        let sum = |variance: f64, at: f64| -> f64 {
            (-9..=9).map(|i| (-0.5 * (f64::from(i) - at).powi(2) / variance).exp()).sum()
        };
        let swing = |variance: f64| (sum(variance, 0.0) / sum(variance, 0.5) - 1.0).abs();
        assert!(swing(sampled(0.0)) < 2.3e-3, "{}", swing(sampled(0.0)));
        assert!(swing(0.2) > 0.05);
        assert_eq!(sampled(1.0), 1.0 + 1.0 / 12.0);
    }
}
