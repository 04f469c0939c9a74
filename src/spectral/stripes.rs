//! The tiles of a window, one row of them after another; what no later tile touches is finished while
//! it still lies in the first cache.

use std::ops::Range;
use std::sync::atomic::Ordering;

use ndarray::{ArrayViewMut2, Axis};

use super::carry::Carry;
use super::field::{Ready, Window};
use super::lift::Lift;
use super::opacity::{Block, Lifted, Opacity};
use super::spectrum::TileMotion;
use super::tent::Motion;
use super::tile::Scratch;
use super::tiles::{Blend, Row};
use super::waves::Draw;
use crate::base::aligned::Aligned;
use crate::base::error::{Cancel, Error, layout};
use crate::base::pool;
use crate::base::real::Real;

#[derive(Debug, Clone, Copy)]
pub struct Mapped {
    pub map: Opacity,
    /// Whether the mean opacity that blur takes is given back.
    pub preserve_mean: bool,
}

/// What one worker makes tiles with.
pub trait Maker<T> {
    /// Makes the tile (row, column).
    fn make(&mut self, at: (usize, usize), pixels: &mut [T]) -> Result<(), Error>;

    /// Takes the sum of all tiles over some rows and columns of the picture, which none after those
    /// of `row` touches.
    fn finish(
        &mut self,
        block: Block<'_, '_, T>,
        row: usize,
        rows: Range<usize>,
        cols: Range<usize>,
    );
}

/// The tiles of a picture, and their weights down and across.
pub struct Tiles<'a, T> {
    pub down: Row,
    pub across: Row,
    pub weights: &'a (Vec<T>, Vec<T>),
}

impl<T: Real> Tiles<'_, T> {
    /// Renders a window, cut at starts of tiles into a run of rows for each worker.
    ///
    /// Each adds the tiles that touch its rows in row-major order, so that the bits of a pixel depend
    /// neither on the threads nor on the window. Tiles across a border between workers are made by
    /// both: fewer than one row of tiles for each worker.
    pub fn render<M: Maker<T>>(
        &self,
        window: &Window,
        mut out: ArrayViewMut2<'_, T>,
        cancel: &Cancel,
        maker: impl Fn(&Range<usize>) -> Result<M, Error> + Sync + Send,
    ) -> Result<(), Error> {
        let pixels = &window.rows;
        let touched = self.down.touching(pixels.start, pixels.end);
        let mut tasks = Vec::new();
        for run in pool::split(touched.len(), pool::threads()) {
            let (first, last) = (touched.start + run.start, touched.start + run.end);
            let from = if run.start == 0 { pixels.start } else { self.down.start(first) };
            let to = if last == touched.end { pixels.end } else { self.down.start(last) };
            // Many overlapping tiles in a small window: their starts can lie before or behind it.
            let inside = |y: usize| y.clamp(pixels.start, pixels.end);
            let rows = inside(from)..inside(to);
            if !rows.is_empty() {
                let (part, rest) = out.split_at(Axis(0), rows.len());
                out = rest;
                tasks.push((rows, part));
            }
        }
        pool::for_each(tasks, |(rows, part)| {
            let out = part.into_slice().ok_or_else(layout)?;
            let made = &mut maker(&rows)?;
            self.strip(rows, &window.cols, out, made, cancel)
        })
    }

    /// Makes some rows: tiles in row-major order, each pixel finished when no later one touches it.
    fn strip(
        &self,
        rows: Range<usize>,
        cols: &Range<usize>,
        out: &mut [T],
        maker: &mut impl Maker<T>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let (down, across) =
            (self.down.touching(rows.start, rows.end), self.across.touching(cols.start, cols.end));
        let (height, width) = (self.down.tile, self.across.tile);
        let (step, wide) = ((self.down.step(), self.across.step()), cols.len());
        let ends = (self.across.start(across.start), self.across.start(across.end - 1));
        let mut carry = Carry::new((height, width), step, ends.0, ends.1)?;
        let mut pixels = Aligned::zeroed(height * width + Carry::<T>::MARGIN)?;
        let mut next = rows.start;
        for row in down.clone() {
            let top = self.down.start(row);
            // Rows before the next tile's start are finished.
            let end = if row + 1 == down.end { rows.end } else { (top + step.0).min(rows.end) };
            let done = next..end.max(next);
            carry.begin_row();
            for col in across.clone() {
                cancel.check()?;
                maker.make((row, col), &mut pixels[..height * width])?;
                let left = self.across.start(col);
                let weights = (
                    &self.weights.0[row * height..(row + 1) * height],
                    &self.weights.1[col * width..(col + 1) * width],
                );
                carry.add(left, &mut pixels, weights);
                let last = col + 1 == across.end;
                let right = if last { cols.end } else { (left + step.1).min(cols.end) };
                let inside = left.max(cols.start)..right;
                if !inside.is_empty() && !done.is_empty() {
                    let from = (done.start - top) * width + inside.start - left;
                    let to = (done.start - rows.start) * wide + inside.start - cols.start;
                    let block = Block {
                        rows: done.len(),
                        cols: inside.len(),
                        field: (&pixels[from..], width),
                        out: (&mut out[to..], wide),
                    };
                    maker.finish(block, row, done.clone(), inside);
                }
                carry.keep(left, &pixels, last);
            }
            next = done.end;
        }
        Ok(())
    }
}

impl<T: Real> Ready<'_, T> {
    /// Renders the window's field, or its opacity.
    pub fn render(
        &self,
        window: &Window,
        out: ArrayViewMut2<'_, T>,
        mapped: Option<Mapped>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let weights = &self.parts.weights;
        let tiles = Tiles { down: self.down, across: self.across, weights };
        tiles.render(window, out, cancel, |rows| Worker::new(self, rows, &window.cols, mapped))
    }

    /// The rows of tiles, `first` to `last`, that touch image row y, with their share in a mean.
    fn shares(&self, y: usize, first: usize, last: usize) -> impl Iterator<Item = (usize, T)> + '_ {
        let touching = self.down.touching(y, y + 1);
        (touching.start.max(first)..touching.end.min(last + 1)).map(move |row| {
            let weight = self.parts.weights.0[row * self.field.tile.0 + y - self.down.start(row)];
            // Means mix with weights that sum to 1: the squares, in the power law.
            (row, if self.field.blend == Blend::Linear { weight } else { weight * weight })
        })
    }
}

/// One worker's buffers, and the way from a tile's place to its pixels.
struct Worker<'r, 'f, T: Real> {
    ready: &'r Ready<'f, T>,
    mapped: Option<Mapped>,
    lift: Option<Lift<T>>,
    /// The first row and column of tiles.
    first: (usize, usize),
    place: Vec<Motion>,
    rate: Vec<Motion>,
    whole: Vec<Motion>,
    scratch: Scratch<T>,
}

impl<'r, 'f, T: Real> Worker<'r, 'f, T> {
    fn new(
        ready: &'r Ready<'f, T>,
        rows: &Range<usize>,
        cols: &Range<usize>,
        mapped: Option<Mapped>,
    ) -> Result<Self, Error> {
        let (height, width) = ready.field.tile;
        let across = ready.across.touching(cols.start, cols.end);
        let lifted = mapped.filter(|mapped| mapped.preserve_mean).map(|mapped| {
            let start = |tile: usize| ready.across.start(tile);
            let span = start(across.start)..start(across.end - 1) + width;
            let (alike, rows) = (ready.field.tiles_alike(), height.div_ceil(ready.down.step()));
            Lift::new(mapped.map, alike, rows, span, height * width)
        });
        let still = vec![Motion { drift: [0.0; 2], shift: [0.0; 2] }; ready.field.rings()];
        Ok(Self {
            ready,
            mapped,
            lift: lifted.transpose()?,
            first: (ready.down.touching(rows.start, rows.end).start, across.start),
            place: still.clone(),
            rate: still.clone(),
            whole: still,
            scratch: ready.parts.plan.scratch()?,
        })
    }
}

impl<T: Real> Maker<T> for Worker<'_, '_, T> {
    fn make(&mut self, at: (usize, usize), pixels: &mut [T]) -> Result<(), Error> {
        let Ready { field, across, parts, transformed, .. } = self.ready;
        field.motions(&field.drift, &field.shift, at, &mut self.place);
        field.motions(&field.velocity, &field.shift_rate, at, &mut self.rate);
        if let Some(lap) = &field.lap {
            field.motions(&lap.drift, &lap.shift, at, &mut self.whole);
        }
        let motion = TileMotion {
            place: &self.place,
            lap: field.lap.as_ref().map(|lap| (&self.whole[..], lap.part)),
            rate: &self.rate,
            filter: field.filter,
            shortest: field.shortest.as_ref().map_or(0.0, |map| map[at]),
        };
        let draw = Draw::new(field.seed, at, field.jitter);
        let power = parts.plan.render(draw, motion, &mut self.scratch, pixels)?;
        transformed.fetch_add(usize::from(power.kept > 0.0), Ordering::Relaxed);
        if let Some(lift) = &mut self.lift {
            if at.1 == self.first.1 {
                lift.begin_row(at.0);
            }
            let weights = &parts.weights.1[at.1 * across.tile..][..across.tile];
            lift.add(power, at.0, across.start(at.1), weights, field.blend == Blend::Power);
        }
        Ok(())
    }

    fn finish(
        &mut self,
        block: Block<'_, '_, T>,
        row: usize,
        rows: Range<usize>,
        cols: Range<usize>,
    ) {
        let Some(mapped) = self.mapped else { return block.copy() };
        let lifted = self.lift.as_mut().map_or(Lifted::None, |lift| {
            lift.of(cols, rows.map(|y| self.ready.shares(y, self.first.0, row)))
        });
        mapped.map.map_block(block, lifted);
    }
}
