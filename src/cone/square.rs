//! Squares of 16 x 16 pixels of a chart, each in one piece and in the order in which sixteen neighbours are
//! looked up at once. The rows of a chart may all want one place in the first cache, and a square's are
//! read once for every layer.

use super::chart::BLOCK;

/// Pixels of a square.
pub const SQUARE: usize = BLOCK * BLOCK;

/// What passes through the layers of a square so far. Sixteen numbers are eight pixels of a row and the
/// eight below them; two such pieces side by side follow each other.
#[derive(Clone)]
#[repr(align(64))]
pub struct Clear(pub [f32; SQUARE]);

impl Clear {
    /// Nothing in the way.
    pub const ALL: Self = Self([1.0; SQUARE]);
}

/// Where the pixels of a square look, in the order of [`Clear`].
#[derive(Clone)]
#[repr(C, align(64))]
pub struct Square {
    /// Azimuth, 2^32 to a tile of the first layer.
    pub across: [u32; SQUARE],
    /// Height, 2^32 to a tile of the first layer.
    pub along: [u32; SQUARE],
}

/// The place of a pixel of a square.
#[inline(always)]
pub const fn place_of(x: usize, y: usize) -> usize {
    (y / 2 * 2 + x / 8) * 16 + y % 2 * 8 + x % 8
}

impl Square {
    /// One to be filled.
    pub const EMPTY: Self = Self { across: [0; SQUARE], along: [0; SQUARE] };

    /// Copies the first 16 columns of 16 rows of planes, which are `stride` wide; fewer rows leave the
    /// others as they are.
    #[inline(always)]
    pub fn fill(&mut self, across: &[u32], along: &[u32], stride: usize) {
        for (to, from) in [(&mut self.across, across), (&mut self.along, along)] {
            for (row, from) in from.chunks(stride).take(BLOCK).enumerate() {
                for x in [0, 8] {
                    let at = place_of(x, row);
                    to[at..at + 8].copy_from_slice(&from[x..x + 8]);
                }
            }
        }
    }
}

/// Words as squares; nothing where they do not begin at a line of the cache.
pub fn squares(words: &[u32]) -> Option<&[Square]> {
    // SAFETY: a square is words, whatever they are.
    let (before, squares, after) = unsafe { words.align_to::<Square>() };
    (before.is_empty() && after.is_empty()).then_some(squares)
}

/// Copies the planes of a chart, `stride` wide, into the words of its squares, band after band. False where
/// words and planes do not fit.
pub fn keep(words: &mut [u32], across: &[u32], along: &[u32], stride: usize) -> bool {
    // SAFETY: as above.
    let (before, squares, after) = unsafe { words.align_to_mut::<Square>() };
    let fits = stride > 0
        && stride.is_multiple_of(BLOCK)
        && across.len().is_multiple_of(stride)
        && across.len() == along.len()
        && squares.len() == (across.len() / stride).div_ceil(BLOCK) * (stride / BLOCK);
    if !fits || !before.is_empty() || !after.is_empty() {
        return false;
    }
    let bands = across.chunks(BLOCK * stride).zip(along.chunks(BLOCK * stride));
    for (band, (across, along)) in squares.chunks_mut(stride / BLOCK).zip(bands) {
        for (index, square) in band.iter_mut().enumerate() {
            *square = Square::EMPTY;
            square.fill(&across[index * BLOCK..], &along[index * BLOCK..], stride);
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_a_place_of_its_own() {
        let mut seen = [false; SQUARE];
        for y in 0..BLOCK {
            for x in 0..BLOCK {
                assert!(!std::mem::replace(&mut seen[place_of(x, y)], true));
            }
        }
        // Eight of a row, then the eight below them.
        assert_eq!([place_of(7, 0), place_of(0, 1), place_of(8, 0)], [7, 8, 16]);
    }

    #[test]
    fn a_chart_is_kept_by_squares() {
        // Three blocks wide; the second band has three rows.
        let (stride, rows) = (48, 19);
        let across: Vec<u32> = (0..stride as u32 * rows).collect();
        let along: Vec<u32> = across.iter().map(|word| word + 100_000).collect();
        let mut kept = vec![Square::EMPTY; 6];
        // SAFETY: squares are words.
        let (_, words, _) = unsafe { kept.align_to_mut::<u32>() };
        assert!(keep(words, &across, &along, stride));
        assert!(!keep(&mut words[..512], &across, &along, stride));
        assert!(!keep(words, &across, &along[1..], stride));
        assert!(squares(&words[1..]).is_none());
        let again = squares(words).unwrap();
        for y in 0..rows as usize {
            for x in 0..stride {
                let square = &again[y / BLOCK * 3 + x / BLOCK];
                let place = place_of(x % BLOCK, y % BLOCK);
                let word = (y * stride + x) as u32;
                assert_eq!([square.across[place], square.along[place]], [word, word + 100_000]);
            }
        }
        assert_eq!(again[3].across[place_of(0, 3)], 0);
    }
}
