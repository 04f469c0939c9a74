//! The opacity of a flake: a ball of even density, which light crosses on longer ways in the middle.
//!
//! At r of its radius R from the middle its optical depth is tau0 sqrt(1 - (r/R)^2). What is called its
//! opacity is the mean over its disc, so that a flake of diameter D covers opacity * pi/4 D^2.

use crate::base::error::Error;

/// The most opaque ball: above it, tau0 is more than single precision can carry.
pub const MOST_OPAQUE: f64 = 0.99;

/// The mean opacity over the disc of a ball whose optical depth in the middle is `tau0`.
pub fn mean_opacity(tau0: f64) -> f64 {
    if tau0 < 1e-3 {
        // 1 - 2 (1 - (1 + t) exp(-t)) / t^2, whose terms cancel here.
        return tau0 * (2.0 / 3.0 - tau0 / 4.0);
    }
    1.0 - 2.0 * (1.0 - (1.0 + tau0) * libm::exp(-tau0)) / (tau0 * tau0)
}

/// The optical depth in the middle of a ball of a mean opacity, 0 to [`MOST_OPAQUE`].
pub fn middle_depth(opacity: f64) -> Result<f64, Error> {
    if !(0.0..=MOST_OPAQUE).contains(&opacity) {
        let words = format!("must be from 0 to {MOST_OPAQUE}, got {opacity}");
        return Err(Error::invalid("opacity", words));
    }
    let (mut low, mut high) = (0.0, 20.0);
    // Halved until nothing is left between the two.
    for _ in 0..64 {
        let middle = 0.5 * (low + high);
        if mean_opacity(middle) < opacity { low = middle } else { high = middle }
    }
    Ok(if opacity == 0.0 { 0.0 } else { 0.5 * (low + high) })
}

/// The opacity at `r` radii from the middle of a ball, 0 outside.
#[inline]
pub fn opacity_at(r: f64, tau0: f64) -> f64 {
    let inside = 1.0 - r * r;
    if inside <= 0.0 { 0.0 } else { -libm::expm1(-tau0 * libm::sqrt(inside)) }
}
