//! Which pattern a tile takes, and where: hashes of what the tile is.

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

/// The choice of the tile (row, column) for a layer.
pub fn choice(
    seed: i64,
    layer: usize,
    (row, col): (usize, usize),
    patterns: usize,
    tile: usize,
) -> Choice {
    let hash =
        Hash::seeded(seed).word(PATTERN).word(layer as i64).word(row as i64).word(col as i64);
    // The bits of earlier versions.
    let hash = hash.word(0);
    let upto = |word: i64, most: usize| hash.word(word).unit() * most as f64;
    Choice {
        pattern: (upto(0, patterns) as usize).min(patterns - 1),
        shift: [upto(1, tile), upto(2, tile)],
    }
}
