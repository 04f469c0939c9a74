//! Flakes with the light of lamps: opacity, and the light that they send, which does not depend on
//! their order: the mean of the flakes' radiances, each weighed by its own opacity.

use ndarray::{ArrayView2, ArrayViewMut2, ArrayViewMut3, s};

use super::patch::{Line, Patch};
use crate::base::error::{Cancel, Error, layout};
use crate::base::lamps::{Lamps, light};
use crate::base::pool;
use crate::base::simd::dispatch;
use crate::particles::bins::{PIXELS, TILE, touches};
use crate::particles::canvas::{Canvas, LANES, rows};
use crate::particles::draw::one;
use crate::particles::sorted::{Part, Sorted, map_of};
use crate::particles::sprite::{Lens, Sprite};

pub struct Scene<'a> {
    pub sorted: &'a Sorted,
    pub patches: &'a [Patch],
    /// By which sprites are found in space.
    pub lens: Lens,
    pub lamps: &'a Lamps,
    /// Of a flake by its number, the light on it over that on the mean.
    pub glint: &'a (dyn Fn(i32) -> f32 + Sync),
}

impl Scene<'_> {
    /// Draws opacity and premultiplied light of a part of the frame. `finish` gets the first row of the part,
    /// opacity and light of each band of rows as soon as it is drawn.
    pub fn draw(
        &self,
        mut out: ArrayViewMut2<'_, f32>,
        mut glow: ArrayViewMut3<'_, f32>,
        part: Part,
        depth: Option<ArrayView2<'_, f32>>,
        cancel: &Cancel,
        finish: impl Fn(usize, ArrayView2<'_, f32>, ArrayViewMut3<'_, f32>) -> Result<(), Error> + Sync,
    ) -> Result<(), Error> {
        let [top, bottom, left, right] = part;
        self.sorted.check(out.dim(), part, depth.as_ref())?;
        if glow.dim() != (bottom - top, right - left, 3) {
            return Err(Error::Internal("light is not of out's shape".into()));
        }
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
        let colors = self.colors(self.patches.iter().map(|patch| (patch.point, patch.index)));
        pool::for_each(tiles, |(row, upper, mut plane, mut light)| {
            let (mut canvas, mut room) = (Lit::new(), [f32::INFINITY; PIXELS]);
            for column in left / TILE..right.div_ceil(TILE) {
                cancel.check()?;
                canvas.clear();
                if let Some(map) = &depth {
                    map_of(map, (row, column), &mut room);
                }
                let tile = Tile { row, column, map: depth.map(|_| &room) };
                sprites(self, &tile, &mut canvas, cancel)?;
                pictures(self, &colors, &tile, &mut canvas);
                let (first, end) = ((column * TILE).max(left), ((column + 1) * TILE).min(right));
                let from = (upper - row * TILE, first - column * TILE);
                let columns = s![.., first - left..end - left];
                let glow = light.slice_mut(s![.., first - left..end - left, ..]);
                store(plane.slice_mut(columns), glow, &canvas, from).ok_or_else(layout)?;
            }
            finish(upper - top, plane.view(), light)
        })
    }

    /// The light of flakes at places in the eye's axes, of their numbers, and 1, by which opacities are counted.
    fn colors(&self, flakes: impl Iterator<Item = ([f64; 3], i32)>) -> Vec<[f32; 4]> {
        let (places, numbers): (Vec<_>, Vec<_>) = flakes.unzip();
        let mut found = vec![[0.0; 3]; places.len()];
        light(self.lamps, &places, &mut found);
        let both = found.into_iter().zip(numbers);
        both.map(|(rgb, number)| {
            let glint = (self.glint)(number);
            let [r, g, b] = rgb.map(|v| glint * v as f32);
            [r, g, b, 1.0]
        })
        .collect()
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
}

struct Tile<'a> {
    row: usize,
    column: usize,
    map: Option<&'a [f32; PIXELS]>,
}

/// What a tile adds up: transmittance, the light of each pixel's flakes, and their opacities; and the color
/// of the flake that is drawn.
struct Lit {
    through: [f64; PIXELS],
    sums: [[f32; PIXELS]; 4],
    color: [f32; 4],
}

impl Lit {
    fn new() -> Box<Self> {
        Box::new(Self { through: [1.0; PIXELS], sums: [[0.0; PIXELS]; 4], color: [0.0; 4] })
    }

    fn clear(&mut self) {
        self.through.fill(1.0);
        self.sums.iter_mut().for_each(|sum| sum.fill(0.0));
    }

    #[inline(always)]
    fn add(&mut self, at: usize, alphas: &[f32]) {
        for (sum, color) in self.sums.iter_mut().zip(self.color) {
            for (sum, alpha) in sum[at..at + alphas.len()].iter_mut().zip(alphas) {
                *sum += alpha * color;
            }
        }
    }
}

impl Canvas for Lit {
    #[inline(always)]
    fn next(&mut self, _: i32) {}

    #[inline(always)]
    fn take<const LEVEL: u8>(&mut self, at: usize, weight: f64, profile: &[f64; LANES]) {
        rows::<LEVEL>(&mut self.through[at..at + LANES], weight, profile);
        let alphas: [f32; LANES] = std::array::from_fn(|k| (weight * profile[k]) as f32);
        self.add(at, &alphas);
    }
}

#[dispatch]
fn sprites<const LEVEL: u8>(
    scene: &Scene<'_>,
    tile: &Tile<'_>,
    lit: &mut Lit,
    cancel: &Cancel,
) -> Result<(), Error> {
    let grid = &scene.sorted.grid;
    let number = tile.row * grid.columns + tile.column;
    let origin = [(tile.column * TILE) as f64, (tile.row * TILE) as f64];
    for bins in &scene.sorted.runs {
        cancel.check()?;
        let large = bins.large.iter().filter(|(sprite, _)| touches(sprite, tile.row, tile.column));
        let drawn: Vec<_> = bins.small(number).iter().chain(large).collect();
        let colors = scene.colors(drawn.iter().map(|(sprite, it)| (scene.place(sprite), *it)));
        for ((sprite, number), color) in drawn.into_iter().zip(colors) {
            lit.color = color;
            one::<f32, _, LEVEL>(lit, tile.map, sprite, origin, scene.sorted.ball(*number));
        }
    }
    Ok(())
}

/// Draws the pictures of flakes, of these colors, as far as they reach into a tile.
#[dispatch]
fn pictures<const LEVEL: u8>(
    scene: &Scene<'_>,
    colors: &[[f32; 4]],
    tile: &Tile<'_>,
    lit: &mut Lit,
) {
    let (top, left) = (tile.row * TILE, tile.column * TILE);
    let (mut room, mut seen) = (Line::default(), [0.0; TILE]);
    for (patch, &color) in scene.patches.iter().zip(colors) {
        let (upper, lower) = patch.bounds(1);
        let (first, end) = patch.bounds(0);
        if end <= left || first >= left + TILE || lower <= top || upper >= top + TILE {
            continue;
        }
        lit.color = color;
        for y in upper.max(top)..lower.min(top + TILE) {
            let (x, alphas) = patch.row(y, left..left + TILE, &mut room);
            let at = (y - top) * TILE + x - left;
            let seen = &mut seen[..alphas.len()];
            seen.copy_from_slice(alphas);
            if let Some(map) = tile.map {
                for (seen, &ground) in seen.iter_mut().zip(&map[at..]) {
                    *seen = if ground < patch.depth as f32 { 0.0 } else { *seen };
                }
            }
            for (through, &alpha) in lit.through[at..].iter_mut().zip(&*seen) {
                *through *= f64::from(1.0 - alpha);
            }
            lit.add(at, seen);
        }
    }
}

/// Writes opacity and premultiplied light of a tile's pixels from (row, column) on.
#[dispatch]
fn store<const LEVEL: u8>(
    out: ArrayViewMut2<'_, f32>,
    glow: ArrayViewMut3<'_, f32>,
    lit: &Lit,
    from: (usize, usize),
) -> Option<()> {
    let mut out = out;
    let mut glow = glow;
    let (row, column) = from;
    let [red, green, blue, whole] = &lit.sums;
    for (y, (mut out, mut glow)) in out.outer_iter_mut().zip(glow.outer_iter_mut()).enumerate() {
        let out = out.as_slice_mut()?;
        let (glow, _) = glow.as_slice_mut()?.as_chunks_mut::<3>();
        let start = (row + y) * TILE + column;
        let own = start..start + out.len();
        let through = &lit.through[own.clone()];
        let sums = through.iter().zip(&whole[own.clone()]);
        let colors = red[own.clone()].iter().zip(&green[own.clone()]).zip(&blue[own]);
        // Opacity twice: one that is kept for the light would be waited for, behind the stores to `out`.
        for ((glow, (through, &sum)), ((red, green), blue)) in glow.iter_mut().zip(sums).zip(colors)
        {
            let share = if sum > 0.0 { (1.0 - through) as f32 / sum } else { 0.0 };
            *glow = [share * red, share * green, share * blue];
        }
        out.iter_mut().zip(through).for_each(|(out, through)| *out = (1.0 - through) as f32);
    }
    Some(())
}
