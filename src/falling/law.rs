//! What flakes are: how large, and how many of them show.

use crate::base::pixel::smoothstep;

/// Over this share of the amount the last flakes fade in, so that none pops.
const FADE_IN: f64 = 0.1;

/// The exponential law of diameters, exp(-slope D) between two of them.
#[derive(Debug, Clone, Copy)]
pub struct Sizes {
    /// The smallest and the largest, metres.
    pub range: (f64, f64),
    slope: f64,
    // exp(-slope times their difference) less 1, or 0 where there are as many of all.
    whole: f64,
}

impl Sizes {
    /// The law between the smallest and the largest diameter, metres; `slope` per metre.
    pub fn new(range: (f64, f64), slope: f64) -> Self {
        let whole = slope * (range.1 - range.0);
        // libm rather than std: the same bits with every C library.
        Self { range, slope, whole: if whole.abs() < 1e-9 { 0.0 } else { libm::expm1(-whole) } }
    }

    /// Whether there are such flakes.
    pub fn sound(&self) -> bool {
        let (low, high) = self.range;
        0.0 < low && low <= high && high.is_finite() && self.slope.is_finite()
    }

    /// The diameter that a share of them is smaller than.
    #[inline]
    pub fn quantile(&self, share: f64) -> f64 {
        let (low, high) = self.range;
        if self.whole == 0.0 {
            return low + share * (high - low);
        }
        let inside = -libm::log1p(share * self.whole) / self.slope;
        (low + inside).clamp(low, high)
    }
}

/// The share of a flake that is there: those of low rank are, and the last ones fade in. The mean over
/// all ranks, 0 to 1, is the amount.
#[inline]
pub fn presence(rank: f64, amount: f64) -> f64 {
    let fade = FADE_IN * amount.min(2.0 * (1.0 - amount));
    if fade <= 0.0 {
        return if rank < amount { 1.0 } else { 0.0 };
    }
    ((amount + 0.5 * fade - rank) / fade).clamp(0.0, 1.0)
}

/// The rank from which on none is there.
#[inline]
pub fn last_rank(amount: f64) -> f64 {
    amount + 0.5 * FADE_IN * amount.min(2.0 * (1.0 - amount))
}

/// 0 below the first number and 1 above the second, smooth between; a step where they are one.
#[inline]
pub fn ramp(low: f64, high: f64, x: f64) -> f64 {
    if low < high { smoothstep((x - low) / (high - low)) } else { f64::from(u8::from(x >= high)) }
}

/// Numbers at even steps between two places.
#[derive(Debug, Clone)]
pub struct Table {
    pub range: (f64, f64),
    /// One number for all places, or several.
    pub values: Vec<f64>,
}

impl Table {
    /// Whether it says something everywhere.
    pub fn sound(&self) -> bool {
        !self.values.is_empty() && self.values.iter().all(|v| v.is_finite())
    }

    /// Linear between the steps, and beyond the ends as there.
    #[inline]
    pub fn at(&self, x: f64) -> f64 {
        let [first, .., _] = &self.values[..] else { return self.values[0] };
        let last = (self.values.len() - 1) as f64;
        let place = (x - self.range.0) / (self.range.1 - self.range.0) * last;
        if place.is_nan() {
            return *first;
        }
        let place = place.clamp(0.0, last);
        let index = (place as usize).min(self.values.len() - 2);
        let part = place - index as f64;
        self.values[index] + part * (self.values[index + 1] - self.values[index])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_what_is_there_is_the_amount() {
        for amount in [0.0, 1e-3, 0.07, 0.5, 0.9, 0.999, 1.0] {
            let n = 200_000;
            let ranks = (0..n).map(|i| (f64::from(i) + 0.5) / f64::from(n));
            let sum: f64 = ranks.clone().map(|rank| presence(rank, amount)).sum();
            assert!((sum / f64::from(n) - amount).abs() < 1e-5, "{amount} {sum}");
            assert!(
                ranks.filter(|&rank| rank >= last_rank(amount)).all(|r| presence(r, amount) == 0.0)
            );
        }
        assert_eq!(presence(0.999_999, 1.0), 1.0);
    }
}
