//! Flakes with the light of lamps: opacity, and the light that they send, which does not depend on
//! their order: the mean of the flakes' radiances, each weighed by its own opacity.

use ndarray::{ArrayView2, ArrayViewMut2, ArrayViewMut3};

use super::patch::{Line, Patch};
use crate::base::cover::pixels;
use crate::base::error::{Cancel, Error};
use crate::base::lamps::Lamps;
use crate::base::pool;
use crate::base::simd::dispatch;
use crate::particles::bins::{Bins, Grid, TILE, touches};
use crate::particles::draw::{PIXELS, one};
use crate::particles::sorted::{Part, Sorted};
use crate::particles::sprite::{Lens, Sprite};

/// What a tile adds up: the light of each pixel, and the sum of opacities.
type Sums = [[f32; 4]; PIXELS];

/// A frame's flakes and their lamps.
pub struct Scene<'a> {
    /// Sprites.
    pub sorted: &'a Sorted,
    /// Pictures.
    pub patches: &'a [Patch],
    /// By which sprites are found in space.
    pub lens: Lens,
    /// The lamps.
    pub lamps: &'a Lamps,
}

impl Scene<'_> {
    /// Draws opacity and premultiplied light of a part of the frame.
    pub fn draw(
        &self,
        mut out: ArrayViewMut2<'_, f32>,
        mut glow: ArrayViewMut3<'_, f32>,
        part: Part,
        depth: Option<ArrayView2<'_, f32>>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let [top, bottom, left, right] = part;
        let shape = self.sorted.shape();
        let fits = top <= bottom && bottom <= shape.0 && left <= right && right <= shape.1;
        if !fits
            || out.dim() != (bottom - top, right - left)
            || glow.dim() != (bottom - top, right - left, 3)
        {
            return Err(Error::Internal("the part is not one of the frame, or not out's".into()));
        }
        let grid = self.sorted.grid();
        let mut tiles = Vec::new();
        let rows = top / TILE..bottom.div_ceil(TILE);
        for row in rows {
            let (upper, lower) = ((row * TILE).max(top), ((row + 1) * TILE).min(bottom));
            let (plane, rest) = out.split_at(ndarray::Axis(0), lower - upper);
            out = rest;
            let (light, rest) = glow.split_at(ndarray::Axis(0), lower - upper);
            glow = rest;
            tiles.push((row, upper, plane, light));
        }
        pool::for_each(tiles, |(row, upper, mut plane, mut light)| {
            let mut scratch: Box<[f64; PIXELS]> = Box::new([1.0; PIXELS]);
            let mut through: Box<[f64; PIXELS]> = Box::new([1.0; PIXELS]);
            let mut sums: Box<Sums> = Box::new([[0.0; 4]; PIXELS]);
            for column in left / TILE..right.div_ceil(TILE) {
                cancel.check()?;
                through.fill(1.0);
                sums.fill([0.0; 4]);
                let map = depth.as_ref().map(|map| self.sorted.map_of(map, row, column));
                let tile = Tile { row, column, map: map.as_ref() };
                sprites(self, &tile, &mut scratch, &mut through, &mut sums, grid, cancel)?;
                self.patches_in(&tile, &mut through, &mut sums);
                let (first, end) = ((column * TILE).max(left), ((column + 1) * TILE).min(right));
                for (y, mut line) in plane.outer_iter_mut().enumerate() {
                    for x in first..end {
                        let at = (upper + y - row * TILE) * TILE + x - column * TILE;
                        let alpha = 1.0 - through[at];
                        line[x - left] = alpha as f32;
                        let [r, g, b, sum] = sums[at];
                        let share = if sum > 0.0 { alpha as f32 / sum } else { 0.0 };
                        for (c, part) in [r, g, b].into_iter().enumerate() {
                            light[[y, x - left, c]] = share * part;
                        }
                    }
                }
            }
            Ok(())
        })
    }

    fn color(&self, point: [f64; 3]) -> [f32; 4] {
        let [r, g, b] = self.lamps.at(point);
        [r as f32, g as f32, b as f32, 1.0]
    }

    /// The place of a sprite in the axes of its flake.
    fn place(&self, sprite: &Sprite) -> [f64; 3] {
        let lens = &self.lens;
        let at = |axis: usize| {
            let middle = sprite.start[axis] + 0.5 * sprite.length * sprite.along[axis];
            (middle - lens.center[axis]) / lens.focal * sprite.depth + lens.offset[axis]
        };
        [at(0), at(1), sprite.depth + lens.offset[2]]
    }

    fn patches_in(&self, tile: &Tile<'_>, through: &mut [f64; PIXELS], sums: &mut Sums) {
        let (top, left) = (tile.row * TILE, tile.column * TILE);
        let mut room = Line::default();
        for patch in self.patches {
            let (upper, lower) = patch.bounds(1, usize::MAX >> 1);
            let (first, end) = patch.bounds(0, usize::MAX >> 1);
            if end <= left || first >= left + TILE || lower <= top || upper >= top + TILE {
                continue;
            }
            let color = self.color(patch.point);
            for y in upper.max(top)..lower.min(top + TILE) {
                let (x, alphas) = patch.row(y, left..left + TILE, &mut room);
                let first = (y - top) * TILE + x - left;
                for (at, &alpha) in (first..).zip(alphas) {
                    let hidden = tile.map.is_some_and(|map| map[at] < patch.depth as f32);
                    if !hidden && alpha > 0.0 {
                        through[at] *= f64::from(1.0 - alpha);
                        (0..4).for_each(|c| sums[at][c] += alpha * color[c]);
                    }
                }
            }
        }
    }
}

/// A tile of the frame.
struct Tile<'a> {
    row: usize,
    column: usize,
    map: Option<&'a [f32; PIXELS]>,
}

dispatch! {
    /// Draws a tile's sprites, each alone, and adds its light.
    fn sprites(
        scene: &Scene<'_>,
        tile: &Tile<'_>,
        scratch: &mut [f64; PIXELS],
        through: &mut [f64; PIXELS],
        sums: &mut Sums,
        grid: &Grid,
        cancel: &Cancel,
    ) -> Result<(), Error> = sprites_with
}

#[inline(always)]
fn sprites_with<const LEVEL: u8>(
    scene: &Scene<'_>,
    tile: &Tile<'_>,
    scratch: &mut [f64; PIXELS],
    through: &mut [f64; PIXELS],
    sums: &mut Sums,
    grid: &Grid,
    cancel: &Cancel,
) -> Result<(), Error> {
    let number = tile.row * grid.columns + tile.column;
    let origin = [(tile.column * TILE) as f64, (tile.row * TILE) as f64];
    for bins in scene.sorted.runs() {
        cancel.check()?;
        let bins: &Bins = bins;
        for (list, whole) in [(bins.small(number), true), (bins.large(), false)] {
            for (sprite, _) in list {
                if !whole && !touches(sprite, tile.row, tile.column) {
                    continue;
                }
                let (low, high) = sprite.bounds();
                let range =
                    |axis: usize| pixels(low[axis] - origin[axis], high[axis] - origin[axis], TILE);
                let (Some(columns), Some(rows)) = (range(0), range(1)) else { continue };
                one::<f32, _, LEVEL>(scratch, tile.map, sprite, origin);
                let color = scene.color(scene.place(sprite));
                for row in rows {
                    let line = row * TILE;
                    for at in line + columns.start..line + columns.end {
                        let left = scratch[at];
                        scratch[at] = 1.0;
                        through[at] *= left;
                        let alpha = (1.0 - left) as f32;
                        (0..4).for_each(|c| sums[at][c] += alpha * color[c]);
                    }
                }
            }
        }
    }
    Ok(())
}
