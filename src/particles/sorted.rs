//! Flakes that are placed, projected and sorted once, for pictures of any part of a frame.
//!
//! A frame made in bands of rows asks for its flakes once and draws each band from them.

use std::cell::Cell;
use std::ops::Range;
use std::sync::{Arc, Mutex};

use ndarray::{ArrayView2, ArrayViewMut2, Axis};

use super::balls::{Balls, Outline};
use super::bins::{Bins, Grid, PIXELS, Scratch, TILE, touches};
use super::canvas::{Canvas, LANES, NONE, Numbered};
use super::draw::one;
use super::profile::Profile;
use super::sprite::Sprite;
use crate::base::error::{Cancel, Error, layout, pushed, reserve};
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::dispatch;

/// Flakes per run of the binning, at least: projected, they fit the L2 cache.
const RUN: usize = 8192;

/// Indices within a run are 32 bits wide, and a flake has at most 16 entries.
const LONGEST_RUN: usize = 1 << 27;

thread_local! {
    /// What one run leaves to the next, on this thread.
    static SCRATCH: Cell<Scratch> = Cell::default();
}

/// A part of a frame, pixels: top, bottom, left, right.
pub type Part = [usize; 4];

/// Buffers of runs, kept from frame to frame: fresh pages cost a fifth of a frame of flakes.
///
/// The lock is only ever tried: after a fork it may be held for ever by a thread that no longer exists,
/// and then buffers are made anew.
static SPARE: Mutex<Vec<Bins>> = Mutex::new(Vec::new());

const MOST_SPARE: usize = 32 << 20;

/// The flakes of a frame by the tiles that they touch.
pub struct Sorted {
    pub runs: Vec<Bins>,
    pub grid: Grid,
    /// What sprites are the images of; None where they are Gaussians.
    pub balls: Option<Arc<Balls>>,
    /// Of balls by their numbers; those without one are round.
    pub outlines: Vec<Outline>,
}

/// Flakes between two looks at the cancel flag.
const LOOK: usize = 1024;

/// Multiplies what a tile's flakes let through into a canvas.
///
/// A flake behind `depth`, of what stands in the tile, is hidden. Nobody looks at pixels beyond the border.
#[dispatch]
fn draw<const LEVEL: u8, P: Profile, C: Canvas>(
    canvas: &mut C,
    depth: Option<&[P; PIXELS]>,
    sorted: &Sorted,
    tile: usize,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (row, column) = (tile / sorted.grid.columns, tile % sorted.grid.columns);
    let origin = [(column * TILE) as f64, (row * TILE) as f64];
    let ends = depth.map(|map| ends(map));
    for bins in &sorted.runs {
        let mut drawn = 0_usize;
        for (list, whole) in [(bins.small(tile), true), (&bins.large[..], false)] {
            for (sprite, number) in list {
                let hidden = ends.is_some_and(|(_, far)| far < P::of(sprite.depth));
                if hidden || !whole && !touches(sprite, row, column) {
                    continue;
                }
                drawn += 1;
                if drawn.is_multiple_of(LOOK) {
                    cancel.check()?;
                }
                canvas.next(*number);
                // Most flakes are nearer than all that stands there.
                let behind = ends.is_some_and(|(near, _)| near < P::of(sprite.depth));
                let depth = depth.filter(|_| behind);
                one::<P, _, LEVEL>(canvas, depth, sprite, origin, sorted.ball(*number));
            }
        }
        cancel.check()?;
    }
    Ok(())
}

/// The nearest and the farthest of a tile's depths, found lane by lane.
#[inline(always)]
fn ends<P: Profile>(map: &[P; PIXELS]) -> (P, P) {
    let (mut near, mut far) = ([P::infinity(); LANES], [P::zero(); LANES]);
    for values in map.as_chunks::<LANES>().0 {
        for k in 0..LANES {
            near[k] = if values[k] < near[k] { values[k] } else { near[k] };
            far[k] = if values[k] > far[k] { values[k] } else { far[k] };
        }
    }
    let least = near.into_iter().fold(P::infinity(), P::min);
    (least, far.into_iter().fold(P::zero(), P::max))
}

impl Drop for Sorted {
    fn drop(&mut self) {
        let (mut runs, mut bytes) = (std::mem::take(&mut self.runs), 0);
        runs.retain(|bins| {
            bytes += bins.bytes();
            bytes <= MOST_SPARE
        });
        if let Ok(mut kept) = SPARE.try_lock() {
            *kept = runs;
        }
    }
}

impl Sorted {
    /// Sorts the images of a frame of `shape`, each with its number; `images` adds those of some.
    pub fn new(
        count: usize,
        images: impl Fn(Range<usize>, &mut Vec<(Sprite, i32)>) + Sync,
        balls: Option<Arc<Balls>>,
        shape: (usize, usize),
        cancel: &Cancel,
    ) -> Result<Self, Error> {
        let grid = Grid::over(shape);
        // A run of this length keeps the tables of tiles (one per run) small beside the flakes.
        let length = RUN.max(grid.len()).min(LONGEST_RUN);
        let spare = SPARE.try_lock().map(|mut kept| std::mem::take(&mut *kept));
        let mut runs = spare.unwrap_or_default();
        runs.resize_with(count.div_ceil(length), Bins::default);
        // Several runs to an item, which share their scratch buffers.
        let together = runs.len().div_ceil(4 * pool::threads()).max(1);
        pool::for_each(runs.chunks_mut(together).enumerate(), |(item, runs)| {
            let mut scratch = SCRATCH.take();
            for (i, bins) in runs.iter_mut().enumerate() {
                cancel.check()?;
                let start = (item * together + i) * length;
                let range = start..(start + length).min(count);
                scratch.projected.clear();
                reserve(&mut scratch.projected, range.len())?;
                images(range, &mut scratch.projected);
                bins.sort(&grid, &mut scratch)?;
            }
            SCRATCH.set(scratch);
            Ok(())
        })?;
        Ok(Self { runs, grid, balls, outlines: Vec::new() })
    }

    /// What a sprite of a number is the image of.
    #[inline(always)]
    pub fn ball(&self, number: i32) -> Option<(&Balls, &Outline)> {
        let outline = self.outlines.get(number as usize).unwrap_or(&Outline::ROUND);
        self.balls.as_deref().map(|balls| (balls, outline))
    }

    pub fn shape(&self) -> (usize, usize) {
        self.grid.shape
    }

    /// Draws the flakes' alpha in a part of the frame into `out`, of the part's shape, in [0, 1].
    ///
    /// `depth`, of the frame's shape, is the depth of what stands in it; where it is nearer than a flake's
    /// depth (both rounded to the pixels' type), the flake is hidden; NaN hides nothing. Bits depend neither
    /// on the thread count nor on the part: tiles have one owner, and the order in which flakes are
    /// multiplied follows from their indices.
    pub fn draw<P: Profile, M: Real>(
        &self,
        out: ArrayViewMut2<'_, P>,
        part: Part,
        depth: Option<ArrayView2<'_, M>>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        self.check(out.dim(), part, depth.as_ref())?;
        let tiles = tiles(out, (part[0], part[2]), self.grid.columns)?;
        pool::for_each(tiles, |(tile, at, pixels)| {
            let mut through = [1.0; PIXELS];
            self.onto::<P, M>(&mut through, depth.as_ref(), tile, cancel)?;
            store(pixels, &through, at)
        })
    }

    /// The same; `numbers` gets the flake whose own alpha is the greatest at each pixel, or [`NONE`], and
    /// `most` that alpha; all of the part's shape.
    pub fn draw_numbered<P: Profile, M: Real>(
        &self,
        out: ArrayViewMut2<'_, P>,
        numbers: ArrayViewMut2<'_, i32>,
        most: Option<ArrayViewMut2<'_, P>>,
        part: Part,
        depth: Option<ArrayView2<'_, M>>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        for shape in [out.dim(), numbers.dim(), most.as_ref().map_or(out.dim(), |most| most.dim())]
        {
            self.check(shape, part, depth.as_ref())?;
        }
        let (first, columns) = ((part[0], part[2]), self.grid.columns);
        let own = tiles(numbers, first, columns)?;
        let mut most =
            most.map(|most| tiles(most, first, columns)).transpose()?.into_iter().flatten();
        let mut parts = Vec::new();
        for (tile, own) in tiles(out, first, columns)?.into_iter().zip(own) {
            pushed(&mut parts, (tile, own.2, most.next().map(|most| most.2)))?;
        }
        pool::for_each(parts, |((tile, at, pixels), own, most)| {
            let mut canvas = Numbered::new();
            self.onto::<P, M>(&mut canvas, depth.as_ref(), tile, cancel)?;
            store(pixels, &canvas.through, at)?;
            // A flake so faint that the pixel's opacity is rounded to 0 is not seen.
            for (number, &through) in canvas.numbers.iter_mut().zip(&canvas.through) {
                *number = if P::of(1.0 - through) > P::zero() { *number } else { NONE };
            }
            copy(own, &canvas.numbers, at, |number| number)?;
            most.map_or(Ok(()), |most| copy(most, &canvas.most, at, P::of))
        })
    }

    fn onto<P: Profile, M: Real>(
        &self,
        canvas: &mut impl Canvas,
        depth: Option<&ArrayView2<'_, M>>,
        tile: usize,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let (row, column) = (tile / self.grid.columns, tile % self.grid.columns);
        let mut room = [P::infinity(); PIXELS];
        if let Some(map) = depth {
            map_of(map, (row, column), &mut room);
        }
        draw(canvas, depth.map(|_| &room), self, tile, cancel)
    }

    pub fn check<M>(
        &self,
        out: (usize, usize),
        part: Part,
        depth: Option<&ArrayView2<'_, M>>,
    ) -> Result<(), Error> {
        let shape = self.grid.shape;
        let [top, bottom, left, right] = part;
        if !(top <= bottom && bottom <= shape.0 && left <= right && right <= shape.1)
            || out != (bottom - top, right - left)
        {
            return Err(Error::Internal("the part is not one of the frame, or not out's".into()));
        }
        if depth.is_some_and(|depth| depth.dim() != shape) {
            return Err(Error::invalid("depth", format!("must have shape {shape:?}")));
        }
        Ok(())
    }
}

/// A tile's number, where in it the part begins, and its pixels.
type Tile<'o, A> = (usize, (usize, usize), ArrayViewMut2<'o, A>);

/// The part of a picture from `first` (row, column) on cut into tiles, smaller ones at its border.
fn tiles<A>(
    out: ArrayViewMut2<'_, A>,
    first: (usize, usize),
    columns: usize,
) -> Result<Vec<Tile<'_, A>>, Error> {
    let mut tiles = Vec::new();
    let mut rest = out;
    let mut y = first.0;
    while rest.nrows() > 0 {
        let height = (TILE - y % TILE).min(rest.nrows());
        let (mut band, below) = rest.split_at(Axis(0), height);
        let mut x = first.1;
        while band.ncols() > 0 {
            let width = (TILE - x % TILE).min(band.ncols());
            let (tile, right) = band.split_at(Axis(1), width);
            let number = y / TILE * columns + x / TILE;
            pushed(&mut tiles, (number, (y % TILE, x % TILE), tile))?;
            band = right;
            x += width;
        }
        rest = below;
        y += height;
    }
    Ok(tiles)
}

/// A tile of the depth map, written to `room`; beyond the picture nothing stands.
#[dispatch]
pub fn map_of<const LEVEL: u8, P: Profile, M: Real>(
    map: &ArrayView2<'_, M>,
    tile: (usize, usize),
    room: &mut [P; PIXELS],
) {
    room.fill(P::infinity());
    let (lines, from) = (map.rows().into_iter().skip(tile.0 * TILE), tile.1 * TILE);
    let of = |value: &mut P, depth: &M| {
        let depth = depth.wide();
        *value = P::of(if depth.is_nan() { f64::INFINITY } else { depth });
    };
    for (values, line) in room.chunks_exact_mut(TILE).zip(lines) {
        match line.as_slice() {
            Some(line) => values.iter_mut().zip(&line[from..]).for_each(|(a, b)| of(a, b)),
            None => values.iter_mut().zip(line.iter().skip(from)).for_each(|(a, b)| of(a, b)),
        }
    }
}

/// Writes a tile's pixels from (row, column) on.
#[inline(always)]
fn copy<A, B: Copy>(
    mut pixels: ArrayViewMut2<'_, A>,
    tile: &[B; PIXELS],
    (row, column): (usize, usize),
    of: impl Fn(B) -> A,
) -> Result<(), Error> {
    for (line, own) in pixels.rows_mut().into_iter().zip(tile.chunks_exact(TILE).skip(row)) {
        let line = line.into_slice().ok_or_else(layout)?;
        for (pixel, &own) in line.iter_mut().zip(&own[column..]) {
            *pixel = of(own);
        }
    }
    Ok(())
}

/// The same of what is let through, as opacity.
#[dispatch]
fn store<const LEVEL: u8, P: Profile>(
    pixels: ArrayViewMut2<'_, P>,
    through: &[f64; PIXELS],
    at: (usize, usize),
) -> Result<(), Error> {
    copy(pixels, through, at, |through| P::of(1.0 - through))
}
