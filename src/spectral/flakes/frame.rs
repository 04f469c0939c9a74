//! A frame of optical depth: tiles of layers, blended.
//!
//! Tiles without their mean are blended by the power law, then the mean is added: independent tiles
//! keep their variance everywhere. What is below 0 at seams is 0.

use std::ops::Range;

use ndarray::{ArrayView1, ArrayView3, ArrayView4, ArrayViewMut2, Axis};

use super::prepared::Prepared;
use super::product::{Scratch, Term, render};
use crate::base::aligned::Aligned;
use crate::base::error::{Cancel, Error, pushed};
use crate::base::normal::most;
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::dispatch;
use crate::spectral::carry::Carry;
use crate::spectral::opacity::Block;
use crate::spectral::stripes::{layout, runs};
use crate::spectral::tiles::{Blend, Row};

/// What tiles show of L layers. Arrays are (rows, cols, ..), an axis of 1 for all tiles alike.
#[derive(Debug, Clone)]
pub struct Layers<'a> {
    /// (.., L): the numbers of patterns.
    pub pattern: ArrayView3<'a, i32>,
    /// (.., L, 2): pixels (x, y) that they are moved by.
    pub shift: ArrayView4<'a, f64>,
    /// (.., L, 2): pixels (x, y) that they move by while the shutter is open.
    pub streak: Option<ArrayView4<'a, f64>>,
    /// (L,): factors of patterns without their mean.
    pub gain: ArrayView1<'a, f64>,
    /// Mean optical depth.
    pub mean: f64,
}

/// A frame whose tiles are known.
pub struct Frame<'a, T> {
    patterns: &'a Prepared<T>,
    layers: Layers<'a>,
    blurred: bool,
    down: Row,
    across: Row,
    weights: (Vec<T>, Vec<T>),
}

impl<'a, T: Real> Frame<'a, T> {
    /// A frame of the given shape in tiles that share `overlap` pixels.
    pub fn new(
        shape: (usize, usize),
        overlap: usize,
        patterns: &'a Prepared<T>,
        layers: &'a Layers<'_>,
    ) -> Result<Self, Error> {
        let down = Row { length: shape.0, tile: patterns.tile, overlap }.checked()?;
        let across = Row { length: shape.1, ..down }.checked()?;
        let number = layers.gain.len();
        let (rows, cols) = (down.count(), across.count());
        let (each, pairs) = ((rows, cols, number), (rows, cols, number, 2));
        let misfit = |name| Error::invalid(name, "must be of the tiles and the layers");
        let streak = match &layers.streak {
            Some(streak) => Some(streak.broadcast(pairs).ok_or_else(|| misfit("streak"))?),
            None => None,
        };
        let layers = Layers {
            pattern: layers.pattern.broadcast(each).ok_or_else(|| misfit("pattern"))?,
            shift: layers.shift.broadcast(pairs).ok_or_else(|| misfit("shift"))?,
            streak,
            gain: layers.gain.view(),
            mean: layers.mean,
        };
        if layers.pattern.iter().any(|&index| index < 0 || index as usize >= patterns.count()) {
            return Err(Error::invalid("pattern", "must be a number of the patterns"));
        }
        let moves = |streak: &ArrayView4<'_, f64>| streak.iter().any(|&length| length != 0.0);
        let blurred = layers.streak.as_ref().is_some_and(moves);
        let weights = (down.weights(Blend::Power)?, across.weights(Blend::Power)?);
        Ok(Self { patterns, layers, blurred, down, across, weights })
    }

    /// Makes it.
    pub fn render(&self, mut out: ArrayViewMut2<'_, T>, cancel: &Cancel) -> Result<(), Error> {
        if out.dim() != (self.down.length, self.across.length) {
            return Err(Error::invalid("out", "must have the shape of the frame"));
        }
        let mut tasks = Vec::new();
        for rows in runs(&self.down, &(0..self.down.length)) {
            let (top, rest) = out.split_at(Axis(0), rows.len());
            out = rest;
            tasks.push((rows, top));
        }
        pool::for_each(tasks, |(rows, part)| {
            let part = part.into_slice().ok_or_else(layout)?;
            self.strip(rows, part, cancel)
        })
    }

    /// Makes some rows: tiles in row-major order, each pixel finished when no later tile touches it.
    fn strip(&self, rows: Range<usize>, out: &mut [T], cancel: &Cancel) -> Result<(), Error> {
        let (tile, step, width) = (self.patterns.tile, self.across.step(), self.across.length);
        let (down, across) = (self.down.touching(rows.start, rows.end), 0..self.across.count());
        let last = self.across.start(across.end - 1);
        let mut carry = Carry::new((tile, tile), (step, step), 0, last)?;
        let mut pixels = Aligned::zeroed(tile * tile + Carry::<T>::MARGIN)?;
        let mut scratch = Scratch::new(self.patterns, self.layers.gain.len(), self.blurred)?;
        let (mut terms, mut done) = (Vec::new(), rows.start..rows.start);
        for row in down.clone() {
            let top = self.down.start(row);
            // None where tiles overlap beyond the strip's top.
            let below = self.down.start(row + 1).clamp(done.end, rows.end);
            done = done.end..if row + 1 == down.end { rows.end } else { below };
            carry.begin_row();
            for col in across.clone() {
                cancel.check()?;
                self.terms((row, col), &mut terms)?;
                if terms.is_empty() {
                    pixels[..tile * tile].fill(T::zero());
                } else {
                    render(self.patterns, &terms, &mut scratch, &mut pixels[..tile * tile]);
                }
                let left = self.across.start(col);
                let weights = (
                    &self.weights.0[row * tile..(row + 1) * tile],
                    &self.weights.1[col * tile..(col + 1) * tile],
                );
                carry.add(left, &mut pixels, weights);
                let ends = col + 1 == across.end;
                let right = if ends { width } else { (left + step).min(width) };
                if !done.is_empty() {
                    let block = Block {
                        rows: done.len(),
                        cols: right - left,
                        field: (&pixels[(done.start - top) * tile..], tile),
                        out: (&mut out[(done.start - rows.start) * width + left..], width),
                    };
                    finished(block, T::of(self.layers.mean));
                }
                carry.keep(left, &pixels, ends);
            }
        }
        Ok(())
    }

    /// The layers of a tile that are seen.
    fn terms(&self, (row, col): (usize, usize), terms: &mut Vec<Term>) -> Result<(), Error> {
        terms.clear();
        let pair = |of: &ArrayView4<'_, f64>, layer| [0, 1].map(|axis| of[(row, col, layer, axis)]);
        for (layer, &gain) in self.layers.gain.iter().enumerate() {
            if gain != 0.0 {
                let pattern = self.layers.pattern[(row, col, layer)] as usize;
                let streak = self.layers.streak.as_ref().map_or([0.0; 2], |of| pair(of, layer));
                pushed(
                    terms,
                    Term { pattern, gain, shift: pair(&self.layers.shift, layer), streak },
                )?;
            }
        }
        Ok(())
    }
}

/// Adds the mean; what is below 0 is 0.
#[inline(always)]
fn finish_with<T: Real, const LEVEL: u8>(block: Block<'_, '_, T>, mean: T) {
    let (field, out) = (block.field.0.chunks(block.field.1), block.out.0.chunks_mut(block.out.1));
    for (field, out) in field.zip(out).take(block.rows) {
        for (out, &field) in out[..block.cols].iter_mut().zip(&field[..block.cols]) {
            *out = most(field + mean, T::zero());
        }
    }
}

dispatch! {
    fn finished<T: Real>(block: Block<'_, '_, T>, mean: T) = finish_with
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectral::flakes::twin;
    use ndarray::{Array1, Array2, Array3, Array4, s};

    fn made(shape: (usize, usize), pattern: &Array3<i32>) -> Result<Array2<f64>, Error> {
        let patterns = Prepared::<f64>::new(twin::spectra(3, 8).view(), 0.2)?;
        let (shift, streak) = (Array4::zeros((1, 1, 1, 2)), Array4::from_elem((1, 1, 1, 2), 1.5));
        let gain = Array1::from_elem(1, 3.0);
        let layers = Layers {
            pattern: pattern.view(),
            shift: shift.view(),
            streak: Some(streak.view()),
            gain: gain.view(),
            mean: 0.2,
        };
        let mut out = Array2::from_elem(shape, f64::NAN);
        Frame::new(shape, 0, &patterns, &layers)?.render(out.view_mut(), &Cancel::new())?;
        Ok(out)
    }

    #[test]
    fn a_frame_is_its_tiles_and_the_mean() {
        let pattern =
            Array3::from_shape_fn((3, 2, 1), |(row, col, _)| ((row + 2 * col) % 3) as i32);
        let found = made((20, 13), &pattern).unwrap();
        assert!(found.iter().any(|&depth| depth == 0.0));
        for ((row, col, _), &index) in pattern.indexed_iter() {
            let term =
                Term { pattern: index as usize, gain: 3.0, shift: [0.0; 2], streak: [1.5; 2] };
            let tile = twin::tile(&twin::spectra(3, 8), &[term], 0.2);
            let rows = 8 * row..(8 * row + 8).min(20);
            let cols = 8 * col..(8 * col + 8).min(13);
            for ((y, x), got) in found.slice(s![rows, cols]).indexed_iter() {
                assert!((got - (tile[(y, x)] + 0.2).max(0.0)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn arrays_that_do_not_fit_are_refused() {
        assert!(made((20, 13), &Array3::zeros((2, 2, 1))).is_err());
        assert!(made((20, 13), &Array3::zeros((3, 2, 2))).is_err());
        assert!(made((20, 13), &Array3::from_elem((1, 1, 1), 3)).is_err());
        assert!(made((20, 13), &Array3::from_elem((1, 1, 1), -1)).is_err());
    }
}
