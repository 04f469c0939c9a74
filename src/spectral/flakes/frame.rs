//! A window of a frame: the optical depth of tiles, blended, or the opacity that it makes.
//!
//! Tiles without their mean are blended by the power law, then the mean is added: independent tiles
//! keep their variance everywhere. What is below 0 at seams is 0. The opacity of independent flakes is
//! 1 - exp(-depth).

use std::ops::Range;

use ndarray::{ArrayView2, ArrayView3, ArrayView4, ArrayViewMut2, Axis};

use super::prepared::Prepared;
use super::product::{Scratch, Term, render};
use crate::aligned::Aligned;
use crate::error::{Cancel, Error, pushed};
use crate::normal::{Normal, least, most};
use crate::pool;
use crate::simd::dispatch;
use crate::spectral::carry::Carry;
use crate::spectral::field::Window;
use crate::spectral::opacity::Block;
use crate::spectral::stripes::runs;
use crate::spectral::tiles::{Blend, Row};

/// Beyond this depth nothing is left to see in either precision.
const OPAQUE: f64 = 80.0;

/// What pixels become.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finish {
    /// Optical depth.
    Depth,
    /// 1 - exp(-depth).
    Opacity,
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
    /// Whether a tile is upside down.
    pub mirror: ArrayView2<'a, bool>,
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
        fit("mirror", self.mirror.shape(), &[])?;
        fit("mean", self.mean.shape(), &[])?;
        match self.pattern.iter().find(|&&index| index >= patterns as i32) {
            Some(index) => {
                Err(Error::invalid("pattern", format!("must be below {patterns}, got {index}")))
            }
            None => Ok(()),
        }
    }

    /// Those of a tile that are there to be seen.
    fn of(&self, tile: (usize, usize), terms: &mut Vec<Term>) -> Result<(), Error> {
        terms.clear();
        let place = |shape: &[usize]| at((shape[0], shape[1]), tile);
        let (p, g, s) =
            (place(self.pattern.shape()), place(self.gain.shape()), place(self.shift.shape()));
        for i in 0..self.count() {
            let (pattern, gain) = (self.pattern[(p.0, p.1, i)], self.gain[(g.0, g.1, i)]);
            if pattern < 0 || gain == 0.0 {
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

    fn mirrored(&self, tile: (usize, usize)) -> bool {
        self.mirror[at(self.mirror.dim(), tile)]
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
pub struct Frame<'a, T> {
    patterns: &'a Prepared<T>,
    terms: &'a Terms<'a>,
    down: Row,
    across: Row,
    weights: (Vec<T>, Vec<T>),
    finish: Finish,
}

impl<'a, T: Normal> Frame<'a, T> {
    /// A frame of the given shape in tiles that share `overlap` pixels.
    pub fn new(
        shape: (usize, usize),
        overlap: usize,
        patterns: &'a Prepared<T>,
        terms: &'a Terms<'a>,
        finish: Finish,
    ) -> Result<Self, Error> {
        let down = Row { length: shape.0, tile: patterns.tile, overlap }.checked()?;
        let across = Row { length: shape.1, ..down }.checked()?;
        terms.checked((down.count(), across.count()), patterns.len())?;
        let weights = (down.weights(Blend::Power)?, across.weights(Blend::Power)?);
        Ok(Self { patterns, terms, down, across, weights, finish })
    }

    /// Makes a window of it, the same bits as in the whole.
    pub fn render(
        &self,
        window: &Window,
        mut out: ArrayViewMut2<'_, T>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let (rows, cols) = (&window.rows, &window.cols);
        let inside = rows.end <= self.down.length && cols.end <= self.across.length;
        if !inside || rows.is_empty() || cols.is_empty() || out.dim() != (rows.len(), cols.len()) {
            return Err(Error::invalid("window", "must lie in the frame and fit `out`"));
        }
        let mut tasks = Vec::new();
        for rows in runs(&self.down, rows) {
            let (part, rest) = out.split_at(Axis(0), rows.len());
            out = rest;
            tasks.push((rows, part));
        }
        pool::for_each(tasks, |(rows, part)| {
            let part = part.into_slice();
            let part = part.ok_or_else(|| Error::Internal("rows are not contiguous".into()))?;
            self.strip(rows, cols, part, cancel)
        })
    }

    /// A worker's rows: tiles in row-major order, each pixel finished when no later tile touches it.
    fn strip(
        &self,
        rows: Range<usize>,
        cols: &Range<usize>,
        out: &mut [T],
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let (tile, step, width) = (self.patterns.tile, self.down.step(), cols.len());
        let (down, across) =
            (self.down.touching(rows.start, rows.end), self.across.touching(cols.start, cols.end));
        let starts = (self.across.start(across.start), self.across.start(across.end - 1));
        let mut carry = Carry::new((tile, tile), (step, step), starts.0, starts.1)?;
        let mut pixels = Aligned::zeroed(tile * tile + Carry::<T>::MARGIN)?;
        let mut terms = Vec::new();
        let mut scratch = Scratch::new(self.patterns, self.terms.count(), self.terms.blurred())?;
        let mean = T::of(self.terms.common_mean().unwrap_or(0.0));
        let mut next = rows.start;
        for row in down.clone() {
            let top = self.down.start(row);
            let end = if row + 1 == down.end { rows.end } else { (top + step).min(rows.end) };
            let done = next..end.max(next);
            carry.begin_row();
            for col in across.clone() {
                cancel.check()?;
                let left = self.across.start(col);
                let weights = (
                    &self.weights.0[row * tile..(row + 1) * tile],
                    &self.weights.1[col * tile..(col + 1) * tile],
                );
                self.tile((row, col), weights, &mut terms, &mut scratch, &mut pixels)?;
                carry.add(left, &mut pixels, weights);
                let last = col + 1 == across.end;
                let right = if last { cols.end } else { (left + step).min(cols.end) };
                let inside = left.max(cols.start)..right;
                if !inside.is_empty() && !done.is_empty() {
                    let from = (done.start - top) * tile + inside.start - left;
                    let to = (done.start - rows.start) * width + inside.start - cols.start;
                    let block = Block {
                        rows: done.len(),
                        cols: inside.len(),
                        field: (&pixels[from..], tile),
                        out: (&mut out[to..], width),
                    };
                    match self.finish {
                        Finish::Depth => finish_depth(block, mean),
                        Finish::Opacity => finish_opacity(block, mean),
                    }
                }
                carry.keep(left, &pixels, last);
            }
            next = done.end;
        }
        Ok(())
    }

    /// The pixels of a tile, before their weights.
    fn tile(
        &self,
        tile: (usize, usize),
        weights: (&[T], &[T]),
        terms: &mut Vec<Term>,
        scratch: &mut Scratch<T>,
        pixels: &mut [T],
    ) -> Result<(), Error> {
        let count = self.patterns.tile * self.patterns.tile;
        let pixels = &mut pixels[..count];
        self.terms.of(tile, terms)?;
        if terms.is_empty() {
            pixels.fill(T::zero());
        } else {
            render(self.patterns, terms, self.terms.mirrored(tile), scratch, pixels);
        }
        if self.terms.common_mean().is_none() {
            lift(pixels, weights, T::of(self.terms.mean(tile)));
        }
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

/// Calls `of` with every pixel's depth.
#[inline(always)]
fn each<T: Normal>(block: Block<'_, '_, T>, mean: T, of: impl Fn(T) -> T) {
    let (field, out) = (block.field.0.chunks(block.field.1), block.out.0.chunks_mut(block.out.1));
    for (field, out) in field.zip(out).take(block.rows) {
        for (out, &value) in out[..block.cols].iter_mut().zip(&field[..block.cols]) {
            *out = of(most(value + mean, T::zero()));
        }
    }
}

#[inline(always)]
fn finish_depth_with<T: Normal, const LEVEL: u8>(block: Block<'_, '_, T>, mean: T) {
    each(block, mean, |depth| depth);
}

#[inline(always)]
fn finish_opacity_with<T: Normal, const LEVEL: u8>(block: Block<'_, '_, T>, mean: T) {
    let opaque = T::of(OPAQUE);
    each(block, mean, |depth| T::one() - T::exp_at::<LEVEL>(-least(depth, opaque)));
}

dispatch! {
    fn finish_depth<T: Normal>(block: Block<'_, '_, T>, mean: T) = finish_depth_with
}
dispatch! {
    fn finish_opacity<T: Normal>(block: Block<'_, '_, T>, mean: T) = finish_opacity_with
}
