//! Which pattern a tile takes, and where: hashes of what the tile is.
//!
//! No tile is mirrored: streaks that are drawn into patterns would lean to the other side there.

use super::footprint::FINE;
use crate::base::random::Hash;

/// What the numbers are for, so that they differ from those of other uses of a seed.
const PATTERN: i64 = 0x666c_616b_6531;

/// A layer's pattern in a tile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Below the number of patterns.
    pub pattern: usize,
    /// Pixels (x, y) that the torus is shifted by, from 0 to the tile's size.
    pub shift: [f64; 2],
}

/// The choice of the tile (row, column) for a layer, the `generation`-th that is seen there.
pub fn choice(
    seed: i64,
    layer: usize,
    (row, col): (usize, usize),
    generation: i64,
    patterns: usize,
    tile: usize,
) -> Choice {
    let hash =
        Hash::seeded(seed).word(PATTERN).word(layer as i64).word(row as i64).word(col as i64);
    let hash = hash.word(generation);
    let upto = |word: i64, most: usize| hash.word(word).unit() * most as f64;
    Choice {
        pattern: (upto(0, patterns) as usize).min(patterns - 1),
        shift: [upto(1, tile), upto(2, tile)],
    }
}

/// The place within a pixel that is nearest to a shift, and the whole pixels that are left.
pub fn place(shift: [f64; 2]) -> (usize, [f64; 2]) {
    let fine = FINE as f64;
    let steps = shift.map(|along| (along * fine + 0.5).floor());
    // Whole numbers, and a power of two: all of this is exact.
    let pixels = steps.map(|steps| (steps / fine).floor());
    let [i, j] = [0, 1].map(|axis| (steps[axis] - fine * pixels[axis]) as usize);
    (FINE * j + i, pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_the_nearest() {
        for (x, y) in [(0.0, 0.0), (0.4, 0.1), (-7.3, 12.9), (1e9 + 0.7, -2.6)] {
            let (place, left) = place([x, y]);
            let (i, j) = ((place % 4) as f64 / 4.0, (place / 4) as f64 / 4.0);
            // The place and whole pixels make the shift, but for an eighth of a pixel.
            let most = 0.125 + 1e-6;
            assert!((left[0] + i - x).abs() < most && (left[1] + j - y).abs() < most);
            assert!(left.iter().all(|left| *left == left.round()), "{x} {y} {left:?}");
        }
    }

    #[test]
    fn choices_are_spread_evenly() {
        let mut counts = [0; 8];
        for row in 0..64 {
            for col in 0..64 {
                let found = choice(5, 2, (row, col), 0, 8, 64);
                assert!(found.shift.iter().all(|s| (0.0..64.0).contains(s)));
                counts[found.pattern] += 1;
            }
        }
        // Five standard deviations of a binomial count of 4096.
        assert!(counts.iter().all(|&n| (n - 512_i64).abs() < 106), "{counts:?}");
        let found = |generation| choice(5, 2, (3, 4), generation, 8, 64);
        assert_ne!(found(0).shift, found(1).shift);
    }
}
