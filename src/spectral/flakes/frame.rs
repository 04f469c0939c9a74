//! A frame of optical depth: tiles of layers, blended.
//!
//! Tiles without their mean are blended by the power law, then the mean is added: independent tiles
//! keep their variance everywhere. What is below 0 at seams is 0.

use std::ops::Range;

use ndarray::{ArrayView1, ArrayView3, ArrayView4, ArrayViewMut2};

use super::prepared::Prepared;
use super::product::{Scratch, Term, render};
use crate::base::error::{Cancel, Error, pushed};
use crate::base::normal::most;
use crate::base::random::Hash;
use crate::base::real::Real;
use crate::base::simd::dispatch;
use crate::spectral::field::Window;
use crate::spectral::opacity::Block;
use crate::spectral::stripes::{Maker, Tiles};
use crate::spectral::tiles::{Blend, Row};

/// What the numbers of a seed are for.
const PATTERN: i64 = 0x666c_616b_6531;

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
    pub mean: f64,
}

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

    pub fn render(&self, out: ArrayViewMut2<'_, T>, cancel: &Cancel) -> Result<(), Error> {
        if out.dim() != (self.down.length, self.across.length) {
            return Err(Error::invalid("out", "must have the shape of the frame"));
        }
        let tiles = Tiles { down: self.down, across: self.across, weights: &self.weights };
        let window = Window { rows: 0..self.down.length, cols: 0..self.across.length };
        tiles.render(&window, out, cancel, |_| {
            let scratch = Scratch::new(self.patterns, self.layers.gain.len(), self.blurred)?;
            Ok(Worker { frame: self, scratch, terms: Vec::new() })
        })
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

/// The pattern of `patterns` that the tile (row, column) takes for a layer, and the pixels (x, y) that
/// the torus is shifted by.
pub fn choice(
    seed: i64,
    layer: usize,
    (row, col): (usize, usize),
    patterns: usize,
    tile: usize,
) -> (usize, [f64; 2]) {
    let hash = [PATTERN, layer as i64, row as i64, col as i64, 0];
    let hash = hash.into_iter().fold(Hash::seeded(seed), Hash::word);
    let upto = |word: i64, most: usize| hash.word(word).unit() * most as f64;
    ((upto(0, patterns) as usize).min(patterns - 1), [upto(1, tile), upto(2, tile)])
}

struct Worker<'f, 'a, T> {
    frame: &'f Frame<'a, T>,
    scratch: Scratch<T>,
    terms: Vec<Term>,
}

impl<T: Real> Maker<T> for Worker<'_, '_, T> {
    fn make(&mut self, at: (usize, usize), pixels: &mut [T]) -> Result<(), Error> {
        self.frame.terms(at, &mut self.terms)?;
        if self.terms.is_empty() {
            pixels.fill(T::zero());
        } else {
            render(self.frame.patterns, &self.terms, &mut self.scratch, pixels);
        }
        Ok(())
    }

    fn finish(
        &mut self,
        block: Block<'_, '_, T>,
        _row: usize,
        _rows: Range<usize>,
        _cols: Range<usize>,
    ) {
        finished(block, T::of(self.frame.layers.mean));
    }
}

/// Adds the mean; what is below 0 is 0.
#[dispatch]
fn finished<const LEVEL: u8, T: Real>(block: Block<'_, '_, T>, mean: T) {
    let (field, out) = (block.field.0.chunks(block.field.1), block.out.0.chunks_mut(block.out.1));
    for (field, out) in field.zip(out).take(block.rows) {
        for (out, &field) in out[..block.cols].iter_mut().zip(&field[..block.cols]) {
            *out = most(field + mean, T::zero());
        }
    }
}
