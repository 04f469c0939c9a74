//! Which flakes touch which tile of the picture.
//!
//! Flakes are cut into runs of consecutive indices, by their number and never by that of the threads.
//! Each run is projected and sorted by tile on its own (a counting sort, which keeps the order), so
//! binning is parallel, a run stays in the L2 cache, and a tile that walks the runs one after another
//! meets its flakes in the same order on any machine.

use std::iter::Zip;
use std::ops::Range;
use std::slice::Iter;

use super::project::Group;
use super::splat::Source;
use super::sprite::{Lens, Sprite};
use crate::base::cover::pixels;
use crate::base::error::Error;

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

/// Sprites with their flakes' numbers.
pub type Numbered<'a> = Zip<Iter<'a, Sprite>, Iter<'a, i32>>;

/// The sprites of one run of flakes, by tile.
///
/// They are copied into the order in which tiles read them. An index instead would make every flake
/// of a tile a cache miss, which costs more than drawing it.
#[derive(Default)]
pub struct Bins {
    /// The sprites of tile k are sprites[starts[k]..starts[k + 1]], by index of the flake.
    sprites: Vec<Sprite>,
    /// Their flakes' numbers.
    numbers: Vec<i32>,
    starts: Vec<u32>,
    /// Those that span many tiles, by index.
    large: Vec<Sprite>,
    large_numbers: Vec<i32>,
    /// The next free place of each tile.
    next: Vec<u32>,
}

/// Buffers that one run leaves to the next.
#[derive(Default)]
pub struct Scratch {
    projected: Vec<(Sprite, i32)>,
    /// (tile, place in `projected`)
    pairs: Vec<(u32, u32)>,
}

/// A run's tables while they are filled.
pub struct Sorter<'a> {
    /// The tiles.
    pub grid: &'a Grid,
    large: &'a mut Vec<Sprite>,
    large_numbers: &'a mut Vec<i32>,
    starts: &'a mut Vec<u32>,
    pairs: &'a mut Vec<(u32, u32)>,
    projected: &'a mut Vec<(Sprite, i32)>,
}

impl Sorter<'_> {
    /// Adds a sprite to the tiles that it reaches.
    #[inline(always)]
    pub fn place(&mut self, sprite: Option<Sprite>, number: i32) -> Result<(), Error> {
        let Some(sprite) = sprite else { return Ok(()) };
        let Some((rows, columns)) = self.grid.reached(&sprite) else { return Ok(()) };
        self.add(sprite, number, rows, columns)
    }

    /// Adds a sprite to those of these rows and columns of tiles that it can touch.
    #[inline(always)]
    pub fn add(
        &mut self,
        sprite: Sprite,
        number: i32,
        rows: Range<usize>,
        columns: Range<usize>,
    ) -> Result<(), Error> {
        let Self { grid, large, large_numbers, starts, pairs, projected } = self;
        if rows.len() * columns.len() > MOST_TILES {
            reserve(large, 1)?;
            large.push(sprite);
            reserve(large_numbers, 1)?;
            large_numbers.push(number);
            return Ok(());
        }
        reserve(pairs, MOST_TILES)?;
        let alone = rows.len() * columns.len() == 1;
        for row in rows {
            for column in columns.clone() {
                if alone || touches(&sprite, row, column) {
                    let tile = row * grid.columns + column;
                    starts[tile + 1] += 1;
                    pairs.push((tile as u32, projected.len() as u32));
                }
            }
        }
        projected.push((sprite, number));
        Ok(())
    }
}

impl Bins {
    /// Projects the flakes of a run and sorts them by tile, in place of those of another run.
    #[inline(always)]
    pub fn fill<const LEVEL: u8>(
        &mut self,
        flakes: &impl Source,
        run: Range<usize>,
        lens: &Lens,
        grid: &Grid,
        scratch: &mut Scratch,
    ) -> Result<(), Error> {
        self.sort(run.len(), grid, scratch, |sorter| {
            let mut group = Group::default();
            flakes.each(run, &mut |number, flake| {
                if group.push(&flake, number as i32) {
                    group.project::<LEVEL>(lens, sorter)?;
                }
                Ok(())
            })?;
            group.project::<LEVEL>(lens, sorter)
        })
    }

    /// Sorts some `count` sprites that `place` hands to the sorter, in place of those of another run.
    #[inline(always)]
    pub fn sort(
        &mut self,
        count: usize,
        grid: &Grid,
        scratch: &mut Scratch,
        place: impl FnOnce(&mut Sorter<'_>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let Self { sprites, numbers, starts, large, large_numbers, next } = self;
        let Scratch { projected, pairs } = scratch;
        projected.clear();
        pairs.clear();
        reserve(projected, count)?;
        reserve(pairs, count)?;
        large.clear();
        large_numbers.clear();
        starts.clear();
        reserve(starts, grid.len() + 1)?;
        starts.resize(grid.len() + 1, 0);
        let mut sorter = Sorter { grid, large, large_numbers, starts, pairs, projected };
        place(&mut sorter)?;
        for tile in 0..grid.len() {
            starts[tile + 1] += starts[tile];
        }
        // What another run left there is written over.
        reserve(sprites, pairs.len().saturating_sub(sprites.len()))?;
        sprites.resize(pairs.len(), Sprite::NONE);
        reserve(numbers, pairs.len().saturating_sub(numbers.len()))?;
        numbers.resize(pairs.len(), 0);
        next.clear();
        reserve(next, grid.len())?;
        next.extend_from_slice(&starts[..grid.len()]);
        for &(tile, place) in pairs.iter() {
            let slot = &mut next[tile as usize];
            (sprites[*slot as usize], numbers[*slot as usize]) = projected[place as usize];
            *slot += 1;
        }
        Ok(())
    }

    /// Bytes that it keeps.
    pub fn bytes(&self) -> usize {
        size_of::<Sprite>() * (self.sprites.capacity() + self.large.capacity())
            + size_of::<u32>() * (self.starts.capacity() + self.next.capacity())
            + size_of::<i32>() * (self.numbers.capacity() + self.large_numbers.capacity())
    }

    /// The sprites that lie in few tiles, of which this is one, with their flakes' numbers.
    #[inline]
    pub fn small(&self, tile: usize) -> Numbered<'_> {
        let range = self.starts[tile] as usize..self.starts[tile + 1] as usize;
        self.sprites[range.clone()].iter().zip(&self.numbers[range])
    }

    /// The sprites that lie in many tiles, perhaps in this one.
    #[inline]
    pub fn large(&self) -> Numbered<'_> {
        self.large.iter().zip(&self.large_numbers)
    }
}

/// Whether a sprite's footprint can touch a tile; never a wrong no.
#[inline(always)]
pub fn touches(sprite: &Sprite, row: usize, column: usize) -> bool {
    let center = [column, row].map(|place| (place * TILE + TILE / 2) as i64 as f64);
    sprite.touches(center, (TILE / 2) as f64)
}

/// Room for `more` elements, or an error where `push` would abort the process.
#[inline(always)]
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
    use super::super::sprite::Flake;
    use super::*;
    use crate::base::random::Hash;
    use crate::base::simd::{AVX2, AVX512, Level, PORTABLE};

    const LENS: Lens = Lens { focal: 100.0, center: [0.0; 2], offset: [0.0; 3], near: 0.1 };

    struct List(Vec<Flake>);

    impl Source for List {
        fn len(&self) -> usize {
            self.0.len()
        }

        fn get(&self, index: usize) -> Option<Flake> {
            Some(self.0[index])
        }
    }

    fn flakes(count: usize) -> Vec<Flake> {
        let unit = |i: usize, word: i64| Hash::seeded(1).word(i as i64).word(word).unit();
        (0..count)
            .map(|i| Flake {
                point: [3.0 * unit(i, 0), 2.0 * unit(i, 1), 1.0],
                // Three sizes: a few pixels, a tile, the picture. All different, to tell them apart.
                radius: [0.01, 0.3, 3.0][i % 3] * (1.0 + 1e-3 * i as f64),
                opacity: 0.5,
                // At rest in groups and one by one; some cross the near plane, some are behind it.
                travel: if i < 100 || i % 2 == 0 {
                    [0.0; 3]
                } else {
                    [unit(i, 2), -0.5, if i % 5 == 0 { 1.9 } else { 0.0 }]
                },
            })
            .map(|flake| {
                let behind = flake.radius > 0.0 && unit((flake.radius * 1e6) as usize, 3) < 0.1;
                Flake {
                    point: [flake.point[0], flake.point[1], if behind { -1.0 } else { 1.0 }],
                    ..flake
                }
            })
            .collect()
    }

    #[test]
    fn a_tile_meets_every_flake_that_reaches_it_in_order() {
        let flakes = flakes(300);
        let grid = Grid::over((200, 300));
        assert_eq!((grid.rows, grid.columns), (4, 5));
        for (level, parts) in [(PORTABLE, 1), (PORTABLE, 7), (AVX2, 2), (AVX512, 7)] {
            let known = match crate::base::simd::level() {
                Level::Avx512 => AVX512,
                Level::Avx2 => AVX2,
                Level::Portable => PORTABLE,
            };
            if level > known {
                continue;
            }
            let mut scratch = Scratch::default();
            let bins: Vec<Bins> = crate::base::pool::split(flakes.len(), parts)
                .into_iter()
                .map(|run| {
                    let mut bins = Bins::default();
                    let (flakes, scratch) = (&List(flakes.clone()), &mut scratch);
                    match level {
                        AVX512 => bins.fill::<AVX512>(flakes, run, &LENS, &grid, scratch),
                        AVX2 => bins.fill::<AVX2>(flakes, run, &LENS, &grid, scratch),
                        _ => bins.fill::<PORTABLE>(flakes, run, &LENS, &grid, scratch),
                    }
                    .unwrap();
                    bins
                })
                .collect();
            for tile in 0..grid.len() {
                let (row, column) = (tile / 5, tile % 5);
                for large in [false, true] {
                    let kept = |sprite: &&Sprite| {
                        grid.reached(sprite).is_some_and(|(rows, columns)| {
                            (rows.len() * columns.len() > MOST_TILES) == large
                                && rows.contains(&row)
                                && columns.contains(&column)
                                && touches(sprite, row, column)
                        })
                    };
                    let met: Vec<Sprite> = bins
                        .iter()
                        .flat_map(|bins| if large { bins.large() } else { bins.small(tile) })
                        .map(|(sprite, _)| sprite)
                        .filter(kept)
                        .copied()
                        .collect();
                    let projected: Vec<Sprite> =
                        flakes.iter().filter_map(|flake| Sprite::of(flake, &LENS)).collect();
                    let wanted: Vec<Sprite> = projected.iter().filter(kept).copied().collect();
                    assert!(!wanted.is_empty());
                    assert_eq!(met, wanted, "tile {tile} of {parts} runs");
                }
            }
        }
    }
}
