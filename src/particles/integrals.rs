//! What exact images are summed with: the normal distribution's integral, and means over a way.

use crate::base::simd::multiply_add;

/// Nodes of Gauss and Legendre for the mean over a way of so many sigma at most: right to 2e-7 of the
/// middle. A longer way is summed by panels of the last length.
pub(super) const RULES: [(f64, usize); 4] = [(1.0, 4), (2.0, 6), (3.4, 8), (5.0, 10)];

/// What all images are summed with.
pub(super) struct Tables {
    pub(super) normal: Normal,
    // Places and weights on the way from 0 to 1, of each of RULES.
    pub(super) rules: [Vec<(f64, f64)>; RULES.len()],
}

impl Tables {
    pub(super) fn new() -> Self {
        Self { normal: Normal::new(), rules: RULES.map(|(_, number)| gauss_legendre(number)) }
    }
}

/// Nodes and weights for the mean over the interval from 0 to 1.
fn gauss_legendre(number: usize) -> Vec<(f64, f64)> {
    let node = |index: usize| {
        let count = number as f64;
        let mut x = libm::cos(std::f64::consts::PI * (index as f64 + 0.75) / (count + 0.5));
        let mut slope = 1.0;
        // Newton's steps towards a zero of the polynomial of Legendre.
        for _ in 0..8 {
            let (mut below, mut value) = (1.0, x);
            for k in 1..number {
                let k = k as f64;
                (below, value) = (value, ((2.0 * k + 1.0) * x * value - k * below) / (k + 1.0));
            }
            slope = count * (x * value - below) / (x * x - 1.0);
            x -= value / slope;
        }
        (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..number).map(node).collect()
}

/// Steps of a table for each deviation, and deviations that it reaches: beyond lie 1e-9.
const STEPS: usize = 64;
const LAST: usize = 6;

/// The normal distribution's integral, read from a table: an error function takes ten times as long.
pub(super) struct Normal([[f64; 2]; 2 * LAST * STEPS + 1]);

impl Normal {
    /// At even steps the integral and the density.
    pub(super) fn new() -> Self {
        Self(std::array::from_fn(|index| {
            let z = index as f64 / STEPS as f64 - LAST as f64;
            let density = libm::exp(-0.5 * z * z) / std::f64::consts::TAU.sqrt();
            [0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2), density]
        }))
    }

    /// The integral up to z, to 3e-12: Taylor's series about the nearest step.
    #[inline(always)]
    fn upto<const LEVEL: u8>(&self, z: f64) -> f64 {
        let z = z.clamp(-(LAST as f64), LAST as f64);
        let index = ((z + LAST as f64) * STEPS as f64 + 0.5) as u32 as usize;
        let [integral, density] = self.0[index.min(2 * LAST * STEPS)];
        let near = index as f64 / STEPS as f64 - LAST as f64;
        let rest = z - near;
        let square = near * near;
        let add = multiply_add::<f64, LEVEL>;
        let series = add(rest, near * (3.0 - square) / 24.0, (square - 1.0) / 6.0);
        let series = add(rest, add(rest, series, -0.5 * near), 1.0);
        add(density * rest, series, integral)
    }

    /// Fills `shares` with those of a Gaussian about a place that lie within pixels, along one axis.
    #[inline(always)]
    pub(super) fn shares<const LEVEL: u8>(
        &self,
        shares: &mut Vec<f64>,
        place: f64,
        sigma: f64,
        (from, to): (usize, usize),
    ) {
        let scale = 1.0 / sigma;
        let start = (from as f64 - place) * scale;
        shares.clear();
        let mut before = self.upto::<LEVEL>(start);
        for edge in 1..=to.saturating_sub(from) {
            let after = self.upto::<LEVEL>(multiply_add::<f64, LEVEL>(edge as f64, scale, start));
            shares.push(after - before);
            before = after;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::simd::PORTABLE;

    #[test]
    fn the_table_is_the_integral() {
        let normal = Normal::new();
        for k in -70_000..=70_000 {
            let z = f64::from(k) * 1e-4;
            let wanted = 0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2);
            let off = (normal.upto::<PORTABLE>(z) - wanted).abs();
            assert!(off < if z.abs() < 6.0 { 3e-12 } else { 1e-9 }, "{z} {off:e}");
        }
    }

    #[test]
    fn rules_are_exact_for_powers() {
        for (_, number) in RULES {
            for power in 0..2 * number as i32 {
                let sum: f64 =
                    gauss_legendre(number).iter().map(|(x, weight)| weight * x.powi(power)).sum();
                assert!((sum * f64::from(power + 1) - 1.0).abs() < 1e-12, "{number} {power} {sum}");
            }
        }
    }
}
