//! Which flakes touch which tile of the picture.
//!
//! Flakes are cut into runs of consecutive indices; each run is projected and sorted by tile on its
//! own (a counting sort, which keeps the order), so binning is parallel and a tile that walks the
//! runs one after another meets its flakes by index whatever the number of runs.

use std::ops::Range;

use super::sprite::{Flake, Lens, Sprite};
use crate::error::{Error, zeroed};

/// Side of a tile, px. Its transmittance in float64 is 32 KiB: the L1 cache.
pub const TILE: usize = 64;

/// A flake that spans more tiles than this is kept in a list that every tile looks at, so that memory
/// stays proportional to the number of flakes and not to the pixels they cover.
const MOST_TILES: usize = 16;

/// The tiles of a picture.
#[derive(Debug, Clone, Copy)]
pub struct Grid {
    /// (height, width), px.
    pub shape: (usize, usize),
    /// Tiles down.
    pub rows: usize,
    /// Tiles across.
    pub columns: usize,
}

impl Grid {
    /// The tiles that cover a picture; the last ones may reach beyond it.
    pub fn over(shape: (usize, usize)) -> Self {
        Self { shape, rows: shape.0.div_ceil(TILE), columns: shape.1.div_ceil(TILE) }
    }

    /// Tiles in all.
    pub fn len(&self) -> usize {
        self.rows * self.columns
    }

    /// Whether there is no tile.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The rows and columns of tiles that a sprite's bounds reach, or None outside the picture.
    #[inline]
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

/// The pixels (of `count`) whose centres j + 1/2 lie in [low, high].
#[inline]
pub fn pixels(low: f64, high: f64, count: usize) -> Option<Range<usize>> {
    // Casts saturate, and compare as floats first: a bound may be 1e30.
    let first = (low - 0.5).ceil().max(0.0);
    let last = (high - 0.5).floor().min(count as f64 - 1.0);
    if first <= last { Some(first as usize..last as usize + 1) } else { None }
}

/// The sprites of one run of flakes, by tile.
pub struct Bins {
    sprites: Vec<Sprite>,
    /// The entries of tile k are starts[k]..starts[k + 1].
    starts: Vec<u32>,
    entries: Vec<u32>,
    large: Vec<u32>,
}

impl Bins {
    /// Projects the flakes of a run and sorts them by tile.
    pub fn of(
        flakes: impl ExactSizeIterator<Item = Flake>,
        lens: &Lens,
        grid: &Grid,
    ) -> Result<Self, Error> {
        let mut sprites: Vec<Sprite> = Vec::new();
        reserve(&mut sprites, flakes.len())?;
        let mut large: Vec<u32> = Vec::new();
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        reserve(&mut pairs, flakes.len())?;
        let mut starts: Vec<u32> = zeroed(grid.len() + 1)?;
        for flake in flakes {
            let Some(sprite) = Sprite::of(&flake, lens) else { continue };
            let Some((rows, columns)) = grid.reached(&sprite) else { continue };
            let index = sprites.len() as u32;
            if rows.len() * columns.len() > MOST_TILES {
                reserve(&mut large, 1)?;
                large.push(index);
            } else {
                reserve(&mut pairs, MOST_TILES)?;
                let alone = rows.len() * columns.len() == 1;
                for row in rows {
                    for column in columns.clone() {
                        if alone || touches(&sprite, row, column) {
                            let tile = row * grid.columns + column;
                            starts[tile + 1] += 1;
                            pairs.push((tile as u32, index));
                        }
                    }
                }
            }
            sprites.push(sprite);
        }
        for tile in 0..grid.len() {
            starts[tile + 1] += starts[tile];
        }
        let mut entries: Vec<u32> = zeroed(pairs.len())?;
        let mut next: Vec<u32> = Vec::new();
        reserve(&mut next, grid.len())?;
        next.extend_from_slice(&starts[..grid.len()]);
        for (tile, index) in pairs {
            let slot = &mut next[tile as usize];
            entries[*slot as usize] = index;
            *slot += 1;
        }
        Ok(Self { sprites, starts, entries, large })
    }

    /// The sprites that may touch a tile, in the order of the flakes.
    #[inline]
    pub fn sprites(&self, grid: &Grid, tile: usize) -> Ordered<'_> {
        let own = self.starts[tile] as usize..self.starts[tile + 1] as usize;
        Ordered {
            bins: self,
            own: &self.entries[own],
            large: &self.large,
            row: tile / grid.columns,
            column: tile % grid.columns,
        }
    }
}

#[inline]
fn touches(sprite: &Sprite, row: usize, column: usize) -> bool {
    let center = [column, row].map(|place| (place * TILE + TILE / 2) as f64);
    sprite.touches(center, (TILE / 2) as f64)
}

/// The merge of a tile's own entries and the large sprites.
pub struct Ordered<'a> {
    bins: &'a Bins,
    own: &'a [u32],
    large: &'a [u32],
    row: usize,
    column: usize,
}

impl<'a> Iterator for Ordered<'a> {
    type Item = &'a Sprite;

    #[inline(always)]
    fn next(&mut self) -> Option<&'a Sprite> {
        loop {
            let own = self.own.first().copied().unwrap_or(u32::MAX);
            let large = self.large.first().copied().unwrap_or(u32::MAX);
            if own < large {
                self.own = &self.own[1..];
                return Some(&self.bins.sprites[own as usize]);
            }
            if large == u32::MAX {
                return None;
            }
            self.large = &self.large[1..];
            let sprite = &self.bins.sprites[large as usize];
            if touches(sprite, self.row, self.column) {
                return Some(sprite);
            }
        }
    }
}

/// Room for `more` elements, or an error where `push` would abort the process.
#[inline]
fn reserve<T>(buffer: &mut Vec<T>, more: usize) -> Result<(), Error> {
    if buffer.capacity() - buffer.len() >= more {
        return Ok(());
    }
    buffer.try_reserve(more).map_err(|_| Error::Memory {
        bytes: (buffer.len().saturating_add(more)).saturating_mul(size_of::<T>()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Hash;

    const LENS: Lens = Lens { focal: 100.0, center: [0.0; 2], offset: [0.0; 3], near: 0.1 };

    fn flakes(count: usize) -> Vec<Flake> {
        let unit = |i: usize, word: i64| Hash::seeded(1).word(i as i64).word(word).unit();
        (0..count)
            .map(|i| Flake {
                point: [3.0 * unit(i, 0), 2.0 * unit(i, 1), 1.0],
                // Three sizes: a few pixels, a tile, the picture. All different, to tell them apart.
                radius: [0.01, 0.3, 3.0][i % 3] * (1.0 + 1e-3 * i as f64),
                opacity: 0.5,
                travel: if i % 2 == 0 { [0.0; 3] } else { [unit(i, 2), -0.5, 0.0] },
            })
            .collect()
    }

    #[test]
    fn a_tile_meets_every_flake_that_reaches_it_in_order() {
        let flakes = flakes(300);
        let grid = Grid::over((200, 300));
        assert_eq!((grid.rows, grid.columns), (4, 5));
        for parts in [1, 2, 7] {
            let bins: Vec<Bins> = crate::pool::split(flakes.len(), parts)
                .into_iter()
                .map(|run| Bins::of(flakes[run].iter().copied(), &LENS, &grid).unwrap())
                .collect();
            for tile in 0..grid.len() {
                let needed = |sprite: &Sprite| {
                    let reached = grid.reached(sprite).is_some_and(|(rows, columns)| {
                        rows.contains(&(tile / 5)) && columns.contains(&(tile % 5))
                    });
                    reached && touches(sprite, tile / 5, tile % 5)
                };
                let met: Vec<Sprite> = bins
                    .iter()
                    .flat_map(|bins| bins.sprites(&grid, tile))
                    .filter(|sprite| needed(sprite))
                    .copied()
                    .collect();
                let wanted: Vec<Sprite> = flakes
                    .iter()
                    .filter_map(|flake| Sprite::of(flake, &LENS))
                    .filter(needed)
                    .collect();
                assert_eq!(met, wanted, "tile {tile} of {parts} runs");
            }
        }
    }

    #[test]
    fn pixels_are_those_whose_centres_lie_inside() {
        assert_eq!(pixels(0.5, 2.5, 10), Some(0..3));
        assert_eq!(pixels(0.6, 2.4, 10), Some(1..2));
        assert_eq!(pixels(-1e30, 1e30, 10), Some(0..10));
        assert_eq!(pixels(10.0, 1e30, 10), None);
        assert_eq!(pixels(3.6, 4.4, 10), None);
    }
}
