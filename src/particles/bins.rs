//! Which flakes touch which tile of the picture.
//!
//! Flakes are cut into runs of consecutive indices, by their number and never by that of the threads.
//! Each run is projected and sorted by tile on its own (a counting sort, which keeps the order), so
//! binning is parallel, a run stays in the L2 cache, and a tile that walks the runs one after another
//! meets its flakes in the same order on any machine.

use std::ops::Range;

use super::sprite::Sprite;
use crate::base::error::{Error, pushed, reserve};
use crate::base::pixel::pixels;

/// Side of a tile, px. Its transmittance in float64 is 32 KiB: the L1 cache.
pub const TILE: usize = 64;

pub const PIXELS: usize = TILE * TILE;

/// A flake that spans more tiles than this is kept in a list that every tile looks at, so that memory
/// stays proportional to the number of flakes and not to the pixels they cover.
const MOST_TILES: usize = 16;

#[derive(Debug, Clone, Copy)]
pub struct Grid {
    /// (height, width), px.
    pub shape: (usize, usize),
    pub rows: usize,
    pub columns: usize,
}

impl Grid {
    /// The tiles that cover a picture; the last ones may reach beyond it.
    pub fn over(shape: (usize, usize)) -> Self {
        Self { shape, rows: shape.0.div_ceil(TILE), columns: shape.1.div_ceil(TILE) }
    }

    pub fn len(&self) -> usize {
        self.rows * self.columns
    }

    /// The rows and columns of tiles that a sprite's bounds reach, or None outside the picture.
    #[inline(always)]
    fn reached(&self, sprite: &Sprite) -> Option<(Range<usize>, Range<usize>)> {
        let (low, high) = sprite.bounds();
        let columns = pixels(low[0], high[0], self.shape.1)?;
        let rows = pixels(low[1], high[1], self.shape.0)?;
        Some((
            rows.start / TILE..(rows.end - 1) / TILE + 1,
            columns.start / TILE..(columns.end - 1) / TILE + 1,
        ))
    }
}

/// The sprites of one run of flakes with the flakes' numbers, by tile.
///
/// They are copied into the order in which tiles read them. An index instead would make every flake
/// of a tile a cache miss, which costs more than drawing it.
#[derive(Default)]
pub struct Bins {
    /// The sprites of tile k are sprites[starts[k]..starts[k + 1]], by index of the flake.
    sprites: Vec<(Sprite, i32)>,
    starts: Vec<u32>,
    /// Those that lie in many tiles, by index.
    pub large: Vec<(Sprite, i32)>,
    /// The next free place of each tile.
    next: Vec<u32>,
}

/// Buffers that one run leaves to the next.
#[derive(Default)]
pub struct Scratch {
    pub projected: Vec<(Sprite, i32)>,
    /// (tile, place in `projected`)
    pairs: Vec<(u32, u32)>,
}

impl Bins {
    /// Sorts the sprites of a run, in place of those of another one.
    pub fn sort(&mut self, grid: &Grid, scratch: &mut Scratch) -> Result<(), Error> {
        let Self { sprites, starts, large, next } = self;
        let Scratch { projected, pairs } = scratch;
        pairs.clear();
        reserve(pairs, projected.len())?;
        large.clear();
        starts.clear();
        reserve(starts, grid.len() + 1)?;
        starts.resize(grid.len() + 1, 0);
        for (place, &(sprite, number)) in projected.iter().enumerate() {
            let Some((rows, columns)) = grid.reached(&sprite) else { continue };
            if rows.len() * columns.len() > MOST_TILES {
                pushed(large, (sprite, number))?;
                continue;
            }
            reserve(pairs, MOST_TILES)?;
            let alone = rows.len() * columns.len() == 1;
            for row in rows {
                for column in columns.clone() {
                    if alone || touches(&sprite, row, column) {
                        let tile = row * grid.columns + column;
                        starts[tile + 1] += 1;
                        pairs.push((tile as u32, place as u32));
                    }
                }
            }
        }
        for tile in 0..grid.len() {
            starts[tile + 1] += starts[tile];
        }
        // What another run left there is written over.
        reserve(sprites, pairs.len().saturating_sub(sprites.len()))?;
        sprites.resize(pairs.len(), (Sprite::NONE, 0));
        next.clear();
        reserve(next, grid.len())?;
        next.extend_from_slice(&starts[..grid.len()]);
        for &(tile, place) in pairs.iter() {
            let slot = &mut next[tile as usize];
            sprites[*slot as usize] = projected[place as usize];
            *slot += 1;
        }
        Ok(())
    }

    pub fn bytes(&self) -> usize {
        size_of::<(Sprite, i32)>() * (self.sprites.capacity() + self.large.capacity())
            + size_of::<u32>() * (self.starts.capacity() + self.next.capacity())
    }

    /// The sprites that lie in few tiles, of which this is one.
    #[inline]
    pub fn small(&self, tile: usize) -> &[(Sprite, i32)] {
        &self.sprites[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }
}

/// Whether a sprite's footprint can touch a tile; never a wrong no.
#[inline(always)]
pub fn touches(sprite: &Sprite, row: usize, column: usize) -> bool {
    let center = [column, row].map(|place| (place * TILE + TILE / 2) as i64 as f64);
    sprite.touches(center, (TILE / 2) as f64)
}
