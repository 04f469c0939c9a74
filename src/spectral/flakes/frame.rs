//! A window of a frame: the optical depth of tiles, blended, or the opacity that it makes.
//!
//! Tiles without their mean are blended by the power law, then the mean is added: independent tiles
//! keep their variance everywhere. What is below 0 at seams is 0. The opacity of independent flakes is
//! 1 - exp(-depth).

use std::ops::Range;

use ndarray::{ArrayView2, ArrayView3, ArrayView4, ArrayViewMut2, Axis};

use super::prepared::Prepared;
use super::product::{Scratch, Term, render};
use super::wall::{Depths, Seen, Wall};
use crate::base::aligned::Aligned;
use crate::base::error::{Cancel, Error, pushed};
use crate::base::normal::{Normal, least, most};
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::dispatch;
use crate::spectral::carry::Carry;
use crate::spectral::field::Window;
use crate::spectral::opacity::Block;
use crate::spectral::stripes::runs;
use crate::spectral::tiles::{Blend, Row};

/// Beyond this depth nothing is left to see in either precision.
const OPAQUE: f64 = 80.0;

/// What pixels become.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Finish {
    /// 1 - exp(-depth), in place of the depth itself.
    pub opacity: bool,
    /// The depth is added to what the result holds: that of other layers.
    pub add: bool,
}

/// Which patterns stand in which tile. Arrays are (rows, cols, ..), or (1, 1, ..) where all tiles are
/// alike; n terms make a tile.
#[derive(Debug, Clone)]
pub struct Terms<'a> {
    /// (.., n): the number of a pattern, or below 0 for none.
    pub pattern: ArrayView3<'a, i32>,
    /// (.., n): factors of patterns without their mean.
    pub gain: ArrayView3<'a, f64>,
    /// (.., n, 2): pixels (x, y) that they are moved by.
    pub shift: ArrayView4<'a, f64>,
    /// (.., n, 2): pixels (x, y) that they move by while the shutter is open.
    pub streak: Option<ArrayView4<'a, f64>>,
    /// Mean optical depth.
    pub mean: ArrayView2<'a, f64>,
}

/// Of arrays that may hold one value for all tiles.
fn at((rows, cols): (usize, usize), (row, col): (usize, usize)) -> (usize, usize) {
    (if rows == 1 { 0 } else { row }, if cols == 1 { 0 } else { col })
}

impl Terms<'_> {
    fn count(&self) -> usize {
        self.pattern.dim().2
    }

    /// Refuses arrays that don't fit `tiles` or each other, and patterns that are not there.
    fn checked(&self, tiles: (usize, usize), patterns: usize) -> Result<(), Error> {
        let count = self.count();
        let fit = |name: &'static str, shape: &[usize], behind: &[usize]| {
            let (rows, cols) = (shape[0], shape[1]);
            let whole = (rows == 1 || rows == tiles.0) && (cols == 1 || cols == tiles.1);
            if whole && shape[2..] == *behind {
                return Ok(());
            }
            let wanted = format!("{tiles:?} or (1, 1), and behind it {behind:?}");
            Err(Error::invalid(name, format!("must have the shape {wanted}, got {shape:?}")))
        };
        fit("pattern", self.pattern.shape(), &[count])?;
        fit("gain", self.gain.shape(), &[count])?;
        fit("shift", self.shift.shape(), &[count, 2])?;
        if let Some(streak) = &self.streak {
            fit("streak", streak.shape(), &[count, 2])?;
        }
        fit("mean", self.mean.shape(), &[])?;
        match self.pattern.iter().find(|&&index| index >= patterns as i32) {
            Some(index) => {
                Err(Error::invalid("pattern", format!("must be below {patterns}, got {index}")))
            }
            None => Ok(()),
        }
    }

    /// Those of a tile that are there to be seen, as far as `takes` says of their numbers.
    fn of(
        &self,
        tile: (usize, usize),
        terms: &mut Vec<Term>,
        takes: impl Fn(usize) -> bool,
    ) -> Result<(), Error> {
        terms.clear();
        let place = |shape: &[usize]| at((shape[0], shape[1]), tile);
        let (p, g, s) =
            (place(self.pattern.shape()), place(self.gain.shape()), place(self.shift.shape()));
        for i in 0..self.count() {
            let (pattern, gain) = (self.pattern[(p.0, p.1, i)], self.gain[(g.0, g.1, i)]);
            if pattern < 0 || gain == 0.0 || !takes(i) {
                continue;
            }
            let pair = |of: &ArrayView4<'_, f64>, (row, col): (usize, usize)| {
                [of[(row, col, i, 0)], of[(row, col, i, 1)]]
            };
            let streak = self.streak.as_ref();
            let streak = streak.map_or([0.0; 2], |streak| pair(streak, place(streak.shape())));
            let term =
                Term { pattern: pattern as usize, gain, shift: pair(&self.shift, s), streak };
            pushed(terms, term)?;
        }
        Ok(())
    }

    fn blurred(&self) -> bool {
        self.streak.as_ref().is_some_and(|streak| streak.iter().any(|&length| length != 0.0))
    }

    fn mean(&self, tile: (usize, usize)) -> f64 {
        self.mean[at(self.mean.dim(), tile)]
    }

    /// The mean that all tiles have.
    fn common_mean(&self) -> Option<f64> {
        (self.mean.len() == 1).then(|| self.mean[(0, 0)])
    }
}

/// A frame whose tiles are known.
pub struct Frame<'a, 't, T> {
    patterns: &'a Prepared<T>,
    terms: &'a Terms<'t>,
    down: Row,
    across: Row,
    weights: (Vec<T>, Vec<T>),
    finish: Finish,
    wall: Option<Wall<'t>>,
}

fn layout() -> Error {
    Error::Internal("rows are not contiguous".into())
}

impl<'a, 't, T: Normal> Frame<'a, 't, T> {
    /// A frame of the given shape in tiles that share `overlap` pixels.
    pub fn new(
        shape: (usize, usize),
        overlap: usize,
        patterns: &'a Prepared<T>,
        terms: &'a Terms<'t>,
        finish: Finish,
    ) -> Result<Self, Error> {
        let down = Row { length: shape.0, tile: patterns.tile, overlap }.checked()?;
        let across = Row { length: shape.1, ..down }.checked()?;
        terms.checked((down.count(), across.count()), patterns.len())?;
        let weights = (down.weights(Blend::Power)?, across.weights(Blend::Power)?);
        Ok(Self { patterns, terms, down, across, weights, finish, wall: None })
    }

    /// The same before a scene; the means are the wall's, and those of the terms do not count.
    pub fn before(self, wall: Wall<'t>) -> Result<Self, Error> {
        let tiles = (self.down.count(), self.across.count());
        wall.checked((self.down.length, self.across.length), tiles, self.terms.count())?;
        Ok(Self { wall: Some(wall), ..self })
    }

    /// Refuses a window that does not lie in the frame.
    pub fn fits(&self, window: &Window) -> Result<(), Error> {
        let (rows, cols) = (&window.rows, &window.cols);
        let inside = rows.end <= self.down.length && cols.end <= self.across.length;
        if inside && !rows.is_empty() && !cols.is_empty() {
            return Ok(());
        }
        Err(Error::invalid("window", format!("must lie in the frame, got {rows:?}, {cols:?}")))
    }

    /// Makes a window of it, the same bits as in the whole.
    pub fn render(
        &self,
        window: &Window,
        mut out: ArrayViewMut2<'_, T>,
        mask: Option<ArrayView2<'_, T>>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        self.fits(window)?;
        let (rows, cols) = (&window.rows, &window.cols);
        let size = (rows.len(), cols.len());
        if out.dim() != size || mask.as_ref().is_some_and(|mask| mask.dim() != size) {
            return Err(Error::invalid("out", "and a mask must have the size of the window"));
        }
        let mask = match &mask {
            Some(mask) => Some(mask.to_slice().ok_or_else(layout)?),
            None => None,
        };
        let mut tasks = Vec::new();
        for part in runs(&self.down, rows) {
            let (top, rest) = out.split_at(Axis(0), part.len());
            out = rest;
            let from = (part.start - rows.start) * cols.len();
            let mask = mask.map(|mask| &mask[from..from + part.len() * cols.len()]);
            tasks.push((part, top, mask));
        }
        pool::for_each(tasks, |(rows, part, mask)| {
            let out = part.into_slice().ok_or_else(layout)?;
            let mut strip = Strip::new(self, rows.clone(), cols.clone())?;
            while !strip.ended() {
                let done = strip.next_rows();
                let from = (done.start - rows.start) * cols.len();
                let to = from + done.len() * cols.len();
                let mask = mask.map(|mask| &mask[from..to]);
                strip.row_of_tiles(self, &mut out[from..to], mask, cancel)?;
            }
            Ok(())
        })
    }

    /// The pixels of a tile, before their weights.
    fn tile(
        &self,
        tile: (usize, usize),
        weights: (&[T], &[T]),
        buffers: &mut Buffers<T>,
    ) -> Result<(), Error> {
        let count = self.patterns.tile * self.patterns.tile;
        let Buffers { pixels, terms, scratch, depths } = buffers;
        let pixels = &mut pixels[..count];
        let mut render_into = |pixels: &mut [T], takes: &dyn Fn(usize) -> bool| {
            self.terms.of(tile, terms, takes)?;
            if terms.is_empty() {
                pixels.fill(T::zero());
            } else {
                render(self.patterns, terms, scratch, pixels);
            }
            Ok::<_, Error>(())
        };
        let (Some(wall), Some(depths)) = (&self.wall, depths) else {
            render_into(pixels, &|_| true)?;
            if self.common_mean().is_none() {
                lift(pixels, weights, T::of(self.terms.mean(tile)));
            }
            return Ok(());
        };
        let corner = (self.down.start(tile.0), self.across.start(tile.1));
        depths.read(wall, corner, self.patterns.tile);
        let whole = |group: usize| depths.seen(wall, group) == Seen::Wholly;
        render_into(pixels, &|term| whole(wall.group[term] as usize))?;
        let groups = 0..wall.groups();
        let mean = groups.clone().filter(|&group| whole(group)).map(|group| wall.mean(tile, group));
        lift(pixels, weights, T::of(mean.sum()));
        for group in groups {
            if depths.seen(wall, group) == Seen::Partly {
                let part = &mut depths.part[..count];
                render_into(part, &|term| wall.group[term] as usize == group)?;
                lift(part, weights, T::of(wall.mean(tile, group)));
                depths.add_seen(wall, group, pixels);
            }
        }
        Ok(())
    }

    /// The mean that all pixels have; tiles hold it where they have means of their own.
    fn common_mean(&self) -> Option<f64> {
        if self.wall.is_some() { None } else { self.terms.common_mean() }
    }
}

/// What a worker makes a tile with.
struct Buffers<T: Real> {
    pixels: Aligned<T>,
    terms: Vec<Term>,
    scratch: Scratch<T>,
    depths: Option<Depths<T>>,
}

/// A worker's rows and columns: tiles in row-major order, each pixel finished when no later tile
/// touches it.
pub struct Strip<T: Real> {
    rows: Range<usize>,
    cols: Range<usize>,
    /// The rows and columns of tiles that touch it.
    tiles: (Range<usize>, Range<usize>),
    carry: Carry<T>,
    buffers: Buffers<T>,
    /// The first row that is not finished, and how tiles follow each other down.
    next: usize,
    down: Row,
}

impl<T: Normal> Strip<T> {
    /// The whole strip is still to be made.
    pub fn new(
        frame: &Frame<'_, '_, T>,
        rows: Range<usize>,
        cols: Range<usize>,
    ) -> Result<Self, Error> {
        let (tile, step) = (frame.patterns.tile, frame.down.step());
        let tiles = (
            frame.down.touching(rows.start, rows.end),
            frame.across.touching(cols.start, cols.end),
        );
        let (count, margin) = (tile * tile, Carry::<T>::MARGIN);
        let starts = (frame.across.start(tiles.1.start), frame.across.start(tiles.1.end - 1));
        Ok(Self {
            carry: Carry::new((tile, tile), (step, step), starts.0, starts.1)?,
            buffers: Buffers {
                pixels: Aligned::zeroed(count + margin)?,
                terms: Vec::new(),
                scratch: Scratch::new(frame.patterns, frame.terms.count(), frame.terms.blurred())?,
                depths: frame.wall.is_some().then(|| Depths::new(count, margin)).transpose()?,
            },
            next: rows.start,
            down: frame.down,
            rows,
            cols,
            tiles,
        })
    }

    /// Whether all tiles have been made.
    pub fn ended(&self) -> bool {
        self.tiles.0.is_empty()
    }

    /// The rows that the next row of tiles finishes; none where tiles overlap beyond the strip's top.
    pub fn next_rows(&self) -> Range<usize> {
        let row = self.tiles.0.start;
        let last = row + 1 >= self.tiles.0.end;
        let below = self.down.start(row + 1);
        let end = if last { self.rows.end } else { below.min(self.rows.end) };
        self.next..end.max(self.next)
    }

    /// Makes a row of tiles and what it finishes, [`Self::next_rows`]: `out` and `mask` have these.
    pub fn row_of_tiles(
        &mut self,
        frame: &Frame<'_, '_, T>,
        out: &mut [T],
        mask: Option<&[T]>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let done = self.next_rows();
        let (tile, step, width) = (frame.patterns.tile, frame.across.step(), self.cols.len());
        let row = self.tiles.0.start;
        let top = frame.down.start(row);
        let mean = T::of(frame.common_mean().unwrap_or(0.0));
        self.carry.begin_row();
        for col in self.tiles.1.clone() {
            cancel.check()?;
            let left = frame.across.start(col);
            let weights = (
                &frame.weights.0[row * tile..(row + 1) * tile],
                &frame.weights.1[col * tile..(col + 1) * tile],
            );
            let Self { carry, buffers, cols, tiles, .. } = self;
            frame.tile((row, col), weights, buffers)?;
            let pixels = &mut buffers.pixels;
            carry.add(left, pixels, weights);
            let last = col + 1 == tiles.1.end;
            let right = if last { cols.end } else { (left + step).min(cols.end) };
            let inside = left.max(cols.start)..right;
            if !inside.is_empty() && !done.is_empty() {
                let from = (done.start - top) * tile + inside.start - left;
                let to = inside.start - cols.start;
                let block = Block {
                    rows: done.len(),
                    cols: inside.len(),
                    field: (&pixels[from..], tile),
                    out: (&mut out[to..], width),
                };
                let mask = mask.map(|mask| &mask[to..]);
                finished(Piece { block, mask, mean }, frame.finish);
            }
            carry.keep(left, pixels, last);
        }
        self.next = done.end;
        self.tiles.0.start += 1;
        Ok(())
    }
}

/// Adds the mean times the weight, which comes once more: squares of weights sum to 1.
#[inline(always)]
fn lift_with<T: Normal, const LEVEL: u8>(pixels: &mut [T], (wy, wx): (&[T], &[T]), mean: T) {
    for (&wy, pixels) in wy.iter().zip(pixels.chunks_exact_mut(wx.len())) {
        let mean = wy * mean;
        for (pixel, &wx) in pixels.iter_mut().zip(wx) {
            *pixel += mean * wx;
        }
    }
}

dispatch! {
    fn lift<T: Normal>(pixels: &mut [T], weights: (&[T], &[T]), mean: T) = lift_with
}

/// A rectangle of pixels to be finished.
struct Piece<'p, T> {
    block: Block<'p, 'p, T>,
    /// Shares of the depth that are seen, with the result's stride.
    mask: Option<&'p [T]>,
    mean: T,
}

/// Makes each pixel what `of` says of its depth and of what the result holds.
#[inline(always)]
fn each<T: Normal>(piece: Piece<'_, T>, of: impl Fn(T, T) -> T) {
    let Piece { block, mask, mean } = piece;
    let (field, stride) = (block.field.0.chunks(block.field.1), block.out.1);
    let lines = field.zip(block.out.0.chunks_mut(stride)).take(block.rows);
    for (y, (field, out)) in lines.enumerate() {
        let (field, out) = (&field[..block.cols], &mut out[..block.cols]);
        if let Some(mask) = mask {
            let mask = &mask[y * stride..][..block.cols];
            for i in 0..out.len() {
                out[i] = of(mask[i] * most(field[i] + mean, T::zero()), out[i]);
            }
        } else {
            for i in 0..out.len() {
                out[i] = of(most(field[i] + mean, T::zero()), out[i]);
            }
        }
    }
}

#[inline(always)]
fn finish_with<T: Normal, const LEVEL: u8>(piece: Piece<'_, T>, finish: Finish) {
    let opaque = T::of(OPAQUE);
    let opacity = |depth: T| T::one() - T::exp_at::<LEVEL>(-least(depth, opaque));
    match (finish.opacity, finish.add) {
        (false, false) => each(piece, |depth, _| depth),
        (false, true) => each(piece, |depth, before| before + depth),
        (true, false) => each(piece, |depth, _| opacity(depth)),
        (true, true) => each(piece, |depth, before| opacity(before + depth)),
    }
}

dispatch! {
    fn finished<T: Normal>(piece: Piece<'_, T>, finish: Finish) = finish_with
}
