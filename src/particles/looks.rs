//! How the flakes of a box look: how many are there, how large they are, which are too large.

use crate::base::smooth::smoothstep;

/// How flakes look.
#[derive(Debug, Clone, Copy)]
pub struct Looks {
    /// Smallest and largest radius, world units.
    pub radius: (f64, f64),
    /// Of a flake's middle, 0 to 1.
    pub opacity: f64,
    /// The share of the flakes that is there, 0 to 1: those of the lowest indices.
    pub amount: f64,
    /// Over this share of them the last ones fade in.
    pub fade_in: f64,
    /// Sigma in px (without blur) from which flakes fade, and at which they are gone.
    pub largest: (f64, f64),
    /// Stream of the numbers that their sizes are.
    pub sizes: i64,
}

impl Looks {
    /// Whether there are such flakes.
    pub fn sound(&self) -> bool {
        0.0 <= self.radius.0
            && self.radius.0 <= self.radius.1
            && self.radius.1.is_finite()
            && (0.0..=1.0).contains(&self.opacity)
            && (0.0..=1.0).contains(&self.amount)
            && 0.0 < self.fade_in
            && self.fade_in <= 1.0
            && self.largest.0 < self.largest.1
    }
}

/// How much of flake `index` of `count` is there: all of it, or less for the last of the `amount` that
/// are, so that none pops when the amount changes.
#[inline(always)]
pub fn presence(index: usize, count: usize, amount: f64, fade_in: f64) -> f64 {
    let rank = (index as f64 + 0.5) / count as f64;
    ((amount - rank * (1.0 - fade_in)) / fade_in).clamp(0.0, 1.0)
}

/// Sigma in px of a flake without the widening that sampling needs; what is at the eye or behind it is
/// as large as can be.
#[inline(always)]
pub fn sigma(focal: f64, radius: f64, depth: f64) -> f64 {
    focal * radius / (3.0 * depth.max(1e-6))
}

/// How much of a flake of that sigma is shown: all up to the first limit, nothing from the second on.
#[inline(always)]
pub fn size_fade(sigma: f64, limits: (f64, f64)) -> f64 {
    1.0 - smoothstep((sigma - limits.0) / (limits.1 - limits.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_are_there_as_are_asked_for_and_the_last_ones_fade() {
        let (count, fade_in) = (1000, 0.1);
        for amount in [0.0, 0.3, 1.0] {
            let there: Vec<f64> = (0..count).map(|i| presence(i, count, amount, fade_in)).collect();
            assert!(there.is_sorted_by(|a, b| a >= b));
            let all: f64 = there.iter().sum();
            // Each fades over a tenth of the amounts: 0.9 rank + 0.05 is the middle of them.
            let want = ((amount - 0.05) / 0.9_f64).clamp(0.0, 1.0) * count as f64;
            assert!((all - want).abs() < 0.06 * count as f64, "{amount}: {all} {want}");
        }
        assert_eq!(presence(0, 1, 1.0, 0.1), 1.0);
    }

    #[test]
    fn what_is_too_large_is_not_shown() {
        assert_eq!([3.0, 3.5, 6.0, 9.0].map(|s| size_fade(s, (3.5, 6.0))), [1.0, 1.0, 0.0, 0.0]);
        assert_eq!(size_fade(4.75, (3.5, 6.0)), 0.5);
        assert_eq!(sigma(300.0, 0.02, 4.0), 0.5);
        assert!(size_fade(sigma(300.0, 0.02, -1.0), (3.5, 6.0)) == 0.0);
    }
}
