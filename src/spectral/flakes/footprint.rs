//! The optical depth of one flake on a grid finer than pixels.
//!
//! A flake hides the part a of a pixel: its Gaussian, which moves while the shutter is open, averaged
//! over the pixel's square. Its depth is -ln(1 - a), so that depths add up to the joint opacity
//! 1 - prod(1 - a) of independent flakes. Where a pattern is moved while the shutter is open, its flakes
//! hide the less for it: their depths are those of the thinner ones, -ln(1 - q a) / q.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4};

use crate::base::sampling::LEAST_SIGMA;

/// Samples of the grid along a pixel.
pub const FINE: usize = 4;

/// Deviations that an image reaches: beyond lie 7e-6 of it.
const REACH: f64 = 4.5;

/// Places of a moving flake for each deviation of its way.
const PLACES: f64 = 4.0;

/// Of a pixel, a flake hides no more.
const MOST: f64 = 0.999;

/// The grid's samples of a flake's depth, its middle on the grid.
pub struct Footprint {
    /// Samples from the middle to each side, right and down.
    pub reach: [usize; 2],
    /// Row by row, 2 reach + 1 each way.
    pub values: Vec<f32>,
    /// Integral of the depth, square pixels.
    pub depth: f64,
    /// Integral of the opacity, square pixels.
    pub coverage: f64,
}

impl Footprint {
    /// Of a flake whose image has a diameter in pixels, and moves by `streak` (x, y) meanwhile; `thin`, above
    /// 0 and up to 1, is the part q of it that a moved pattern shows in a pixel.
    pub fn new(diameter: f64, opacity: f64, streak: [f64; 2], thin: f64) -> Self {
        let sigma = (diameter / 8_f64.sqrt()).max(LEAST_SIGMA);
        let coverage = opacity * FRAC_PI_4 * diameter * diameter;
        let fine = FINE as f64;
        let reach =
            streak.map(|way| ((REACH * sigma + 0.5 + 0.5 * way.abs()) * fine).ceil() as usize);
        let (wide, high) = (2 * reach[0] + 1, 2 * reach[1] + 1);
        let places = (PLACES * streak[0].hypot(streak[1]) / sigma).ceil().max(1.0);
        let mut hidden = vec![0.0; wide * high];
        for place in 0..places as usize {
            let part = (place as f64 + 0.5) / places - 0.5;
            let [across, down] = [0, 1].map(|axis| shares(reach[axis], part * streak[axis], sigma));
            for (line, down) in hidden.chunks_exact_mut(wide).zip(down) {
                for (value, across) in line.iter_mut().zip(&across) {
                    *value += coverage / places * down * across;
                }
            }
        }
        let depths = hidden.iter().map(|hidden: &f64| -(-thin * hidden.min(MOST)).ln_1p() / thin);
        let depth = depths.clone().sum::<f64>() / (fine * fine);
        Self { reach, values: depths.map(|depth| depth as f32).collect(), depth, coverage }
    }
}

/// Shares of a Gaussian in pixels whose middles are at the samples -reach .. reach of the grid.
fn shares(reach: usize, center: f64, sigma: f64) -> Vec<f64> {
    let upto = |x: f64| 0.5 * libm::erf((x - center) * FRAC_1_SQRT_2 / sigma);
    let at = |i: usize| (i as f64 - reach as f64) / FINE as f64;
    (0..=2 * reach).map(|i| upto(at(i) + 0.5) - upto(at(i) - 0.5)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The opacity of a pixel whose middle is `at` from that of the flake: a plain sum over the way.
    fn hidden(at: [f64; 2], diameter: f64, opacity: f64, streak: [f64; 2]) -> f64 {
        let sigma = (diameter / 8_f64.sqrt()).max(0.3);
        let steps = 4000;
        let mut sum = 0.0;
        for step in 0..steps {
            let part = (f64::from(step) + 0.5) / f64::from(steps) - 0.5;
            let share = |axis: usize| {
                let x = at[axis] - part * streak[axis];
                let upto = |x: f64| 0.5 * libm::erf(x / (sigma * 2_f64.sqrt()));
                upto(x + 0.5) - upto(x - 0.5)
            };
            sum += share(0) * share(1);
        }
        opacity * FRAC_PI_4 * diameter * diameter * sum / f64::from(steps)
    }

    #[test]
    fn samples_are_depths_of_pixels() {
        for (diameter, streak) in
            [(0.4, [0.0, 0.0]), (1.5, [0.6, -1.1]), (2.8, [0.0, 0.0]), (2.8, [3.0, 5.0])]
        {
            let made = Footprint::new(diameter, 0.9, streak, 1.0);
            let wide = 2 * made.reach[0] + 1;
            for (dx, dy) in [(0, 0), (1, 0), (-2, 3), (0, 5)] {
                let at = |reach: usize, d: i32| (reach as i32 + d) as usize;
                let got = made.values[at(made.reach[1], dy) * wide + at(made.reach[0], dx)];
                let place = [f64::from(dx) / 4.0, f64::from(dy) / 4.0];
                let want = -(-hidden(place, diameter, 0.9, streak)).ln_1p();
                assert!((f64::from(got) - want).abs() < 3e-3 * want + 1e-5, "{got} {want}");
            }
            // What a flake covers is what the opacities of pixels add up to.
            let opacities = made.values.iter().map(|&tau| 1.0 - (-f64::from(tau)).exp());
            let sum = opacities.sum::<f64>() / 16.0;
            assert!((sum / made.coverage - 1.0).abs() < 1e-3, "{sum} {}", made.coverage);
            assert!(made.depth > made.coverage);
        }
    }

    #[test]
    fn thin_depths_are_of_what_a_pattern_that_is_moved_shows() {
        let (whole, thin) = ([1.0, 0.2]).map(|q| Footprint::new(2.8, 0.9, [0.0; 2], q)).into();
        for (whole, thin) in whole.values.iter().zip(&thin.values) {
            let hidden = 1.0 - (-f64::from(*whole)).exp();
            let want = -(1.0 - 0.2 * hidden).ln() / 0.2;
            assert!((f64::from(*thin) - want).abs() < 1e-5, "{thin} {want}");
        }
        assert!(thin.coverage < thin.depth && thin.depth < whole.depth);
    }
}
