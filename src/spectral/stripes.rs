//! The tiles of a window, one row of them after another; what no later tile touches is finished while
//! it still lies in the first cache.

use std::ops::Range;
use std::sync::atomic::Ordering;

use ndarray::{ArrayViewMut2, Axis};

use super::carry::Carry;
use super::field::{Ready, Window};
use super::lift::{Lift, Lifted};
use super::opacity::{Block, Opacity};
use super::spectrum::{Power, TileMotion};
use super::tent::Motion;
use super::tiles::{Blend, Row};
use super::waves::Draw;
use crate::base::error::{Cancel, Error, collected};
use crate::base::pool;
use crate::base::real::Real;

/// How the field becomes an opacity.
#[derive(Debug, Clone, Copy)]
pub struct Mapped {
    /// The map.
    pub map: Opacity,
    /// Whether the mean opacity that blur takes is given back.
    pub preserve_mean: bool,
}

/// A run of pixels cut at starts of tiles, for each worker one.
pub(super) fn runs(tiles: &Row, pixels: &Range<usize>) -> Vec<Range<usize>> {
    let touched = tiles.touching(pixels.start, pixels.end);
    let mut runs = Vec::new();
    for run in pool::split(touched.len(), pool::threads()) {
        let (first, last) = (touched.start + run.start, touched.start + run.end);
        let from = if run.start == 0 { pixels.start } else { tiles.start(first) };
        let to = if last == touched.end { pixels.end } else { tiles.start(last) };
        // Many overlapping tiles in a small window: their starts can lie before or behind it.
        let inside = |x: usize| x.clamp(pixels.start, pixels.end);
        let part = inside(from)..inside(to);
        if !part.is_empty() {
            runs.push(part);
        }
    }
    runs
}

impl<T: Real> Ready<'_, '_, T> {
    /// Renders the window's field, or its opacity.
    pub fn render(
        &self,
        window: &Window,
        out: ArrayViewMut2<'_, T>,
        mapped: Option<Mapped>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        self.split(window, out, |rows, part| {
            let out = part.into_slice().ok_or_else(layout)?;
            let mut strip = Strip::new(self, rows, window.cols.clone(), mapped)?;
            while !strip.ended() {
                strip.row_of_tiles(self, out, cancel)?;
            }
            Ok(())
        })
    }

    /// Cuts the window into a run of rows for each worker.
    ///
    /// Each adds the tiles that touch its rows in row-major order, so that the bits of a pixel depend
    /// neither on the threads nor on the window. Tiles across a border between workers are made by
    /// both: fewer than one row of tiles for each worker.
    fn split<'o, O: Send>(
        &self,
        window: &Window,
        mut out: ArrayViewMut2<'o, O>,
        work: impl Fn(Range<usize>, ArrayViewMut2<'o, O>) -> Result<(), Error> + Sync + Send,
    ) -> Result<(), Error> {
        let mut tasks = Vec::new();
        for rows in runs(&self.down, &window.rows) {
            let (part, rest) = out.split_at(Axis(0), rows.len());
            out = rest;
            tasks.push((rows, part));
        }
        pool::for_each(tasks, |(rows, part)| work(rows, part))
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

pub(super) fn layout() -> Error {
    Error::Internal("rows are not contiguous".into())
}

/// A window's rows of tiles, one after the other, with what each leaves to the next.
struct Strip<T: Real> {
    rows: Range<usize>,
    cols: Range<usize>,
    /// The rows and columns of tiles that touch it.
    touching: (Range<usize>, Range<usize>),
    mapped: Option<Mapped>,
    work: TileWork<T>,
    carry: Carry<T>,
    lift: Option<Lift<T>>,
    /// The row of tiles that comes, and the first row that is not finished.
    row: usize,
    next: usize,
}

impl<T: Real> Strip<T> {
    fn new(
        ready: &Ready<'_, '_, T>,
        rows: Range<usize>,
        cols: Range<usize>,
        mapped: Option<Mapped>,
    ) -> Result<Self, Error> {
        let (height, width) = ready.field.tile;
        let step = (ready.down.step(), ready.across.step());
        let touching = (
            ready.down.touching(rows.start, rows.end),
            ready.across.touching(cols.start, cols.end),
        );
        let starts = (ready.across.start(touching.1.start), ready.across.start(touching.1.end - 1));
        let lifted = mapped.filter(|mapped| mapped.preserve_mean).map(|mapped| {
            let (alike, span) = (ready.field.tiles_alike(), starts.0..starts.1 + width);
            Lift::new(mapped.map, alike, height.div_ceil(step.0), span, height * width)
        });
        Ok(Self {
            work: TileWork::new(ready)?,
            carry: Carry::new((height, width), step, starts.0, starts.1)?,
            lift: lifted.transpose()?,
            row: touching.0.start,
            next: rows.start,
            rows,
            cols,
            touching,
            mapped,
        })
    }

    /// Whether all rows are finished.
    fn ended(&self) -> bool {
        self.row == self.touching.0.end
    }

    /// Makes one row of tiles and finishes what no later one touches, in the strip's rows of `out`.
    fn row_of_tiles(
        &mut self,
        ready: &Ready<'_, '_, T>,
        out: &mut [T],
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let Self { rows, cols, touching, mapped, work, carry, lift, .. } = self;
        let (height, width) = ready.field.tile;
        let step = (ready.down.step(), ready.across.step());
        let squared = ready.field.blend == Blend::Power;
        let (row, mut made) = (self.row, 0);
        let start = ready.down.start(row);
        // Rows before the next tile's start are finished.
        let last = row + 1 == touching.0.end;
        let end = if last { rows.end } else { (start + step.0).min(rows.end) };
        let done = self.next..end.max(self.next);
        let weights = &ready.parts.weights.0[row * height..(row + 1) * height];
        carry.begin_row();
        if let Some(lift) = lift {
            lift.begin_row(row);
        }
        for col in touching.1.clone() {
            cancel.check()?;
            let power = work.render(ready, (row, col))?;
            made += usize::from(power.kept > 0.0);
            let left = ready.across.start(col);
            let across = &ready.parts.weights.1[col * width..(col + 1) * width];
            let pixels = work.pixels();
            carry.add(left, pixels, (weights, across));
            if let Some(lift) = lift {
                lift.add(power, row, left, across, squared);
            }
            let last = col + 1 == touching.1.end;
            let right = if last { cols.end } else { (left + step.1).min(cols.end) };
            let inside = left.max(cols.start)..right;
            if !inside.is_empty() && !done.is_empty() {
                let first = (done.start - rows.start) * cols.len();
                let room = &mut out[first..first + done.len() * cols.len()];
                let from = (done.start - start) * width + inside.start - left;
                let block = Block {
                    rows: done.len(),
                    cols: inside.len(),
                    field: (&pixels[from..], width),
                    out: (&mut room[inside.start - cols.start..], cols.len()),
                };
                let lifted = lift.as_mut().map_or(Lifted::None, |lift| {
                    let shares = done.clone().map(|y| ready.shares(y, touching.0.start, row));
                    lift.of(inside, shares)
                });
                match &mapped {
                    Some(mapped) => mapped.map.map_block(block, lifted),
                    None => block.copy(),
                }
            }
            carry.keep(left, pixels, last);
        }
        self.next = done.end;
        self.row += 1;
        ready.transformed.fetch_add(made, Ordering::Relaxed);
        Ok(())
    }
}

/// One worker's buffers, and the way from a tile's place to its pixels.
struct TileWork<T: Real> {
    place: Vec<Motion>,
    rate: Vec<Motion>,
    whole: Vec<Motion>,
    scratch: super::tile::Scratch<T>,
}

impl<T: Real> TileWork<T> {
    fn new(ready: &Ready<'_, '_, T>) -> Result<Self, Error> {
        let rings = ready.field.rings();
        let still = || collected((0..rings).map(|_| Motion { drift: [0.0; 2], shift: [0.0; 2] }));
        Ok(Self {
            place: still()?,
            rate: still()?,
            whole: still()?,
            scratch: ready.parts.plan.scratch()?,
        })
    }

    fn render(&mut self, ready: &Ready<'_, '_, T>, at: (usize, usize)) -> Result<Power, Error> {
        let field = ready.field;
        field.motions(field.drift, field.shift, at, &mut self.place);
        field.motions(field.velocity, field.shift_rate, at, &mut self.rate);
        if let Some(lap) = field.lap {
            field.motions(lap.drift, lap.shift, at, &mut self.whole);
        }
        let motion = TileMotion {
            place: &self.place,
            lap: field.lap.map(|lap| (&self.whole[..], lap.part)),
            rate: &self.rate,
            filter: field.filter,
            shortest: field.shortest.as_ref().map_or(0.0, |map| map[at]),
        };
        let draw = Draw::new(field.seed, at, field.jitter);
        ready.parts.plan.render(draw, motion, &mut self.scratch)
    }

    /// The tile's pixels, and [`Carry::MARGIN`] more.
    fn pixels(&mut self) -> &mut [T] {
        self.scratch.pixels_and_margin()
    }
}
