//! Which particles touch which band of the picture: one list for each row of tiles, in drawing order.
//!
//! Not one for each tile: a particle near the eye covers thousands of tiles, and few bands.

use super::draw::TILE;
use super::sprite::Sprite;
use crate::base::error::{Error, collected, zeroed};

/// A particle in a band: its place among the sprites, and the columns it can touch.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Entry {
    /// Place in the list of sprites.
    pub sprite: u32,
    /// First column.
    pub left: u32,
    /// Column after the last.
    pub right: u32,
}

/// The lists of all bands, one after the other.
#[derive(Debug, Clone)]
pub struct Bands {
    entries: Vec<Entry>,
    starts: Vec<usize>,
}

impl Bands {
    /// Sorts the sprites named in `order` into the bands of a picture of `height` rows.
    pub fn of(sprites: &[Sprite], order: &[u32], height: usize) -> Result<Self, Error> {
        let bands = height.div_ceil(TILE);
        let mut starts: Vec<usize> = zeroed(bands + 1)?;
        let touched = |sprite: &Sprite| {
            let [top, bottom] = sprite.rows.map(|row| row as usize);
            if top < bottom { top / TILE..(bottom - 1) / TILE + 1 } else { 0..0 }
        };
        for &place in order {
            for band in touched(&sprites[place as usize]) {
                starts[band + 1] += 1;
            }
        }
        for band in 0..bands {
            starts[band + 1] += starts[band];
        }
        let mut entries = collected((0..starts[bands]).map(|_| Entry::default()))?;
        let mut next = collected(starts.iter().copied())?;
        for &place in order {
            let sprite = &sprites[place as usize];
            let [left, right] = sprite.columns;
            for band in touched(sprite) {
                entries[next[band]] = Entry { sprite: place, left, right };
                next[band] += 1;
            }
        }
        Ok(Self { entries, starts })
    }

    /// The list of one band.
    pub fn band(&self, band: usize) -> &[Entry] {
        &self.entries[self.starts[band]..self.starts[band + 1]]
    }
}
