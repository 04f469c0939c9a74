//! Overlapping tiles: where they start, how they are weighted, and their sum.

use ndarray::{ArrayView4, ArrayViewMut2, s};

use crate::base::error::{Error, collected, named, zeroed};
use crate::base::real::Real;

/// How overlapping tiles are mixed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blend {
    /// Squares of the weights sum to 1: independent fields keep their variance everywhere.
    Power,
    /// Weights sum to 1 (the paper): the variance dips to a half at edges, a quarter at corners.
    Linear,
}

impl Blend {
    pub fn named(name: &str) -> Result<Self, Error> {
        named("blend", name, &[("power", Self::Power), ("linear", Self::Linear)])
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row {
    pub length: usize,
    pub tile: usize,
    /// Pixels shared by neighbours.
    pub overlap: usize,
}

impl Row {
    /// Refuses an overlap that would never get on.
    pub fn checked(self) -> Result<Self, Error> {
        if self.tile == 0 || self.length == 0 {
            return Err(Error::invalid("tile", "a tile and the image need at least one pixel"));
        }
        if self.overlap >= self.tile {
            let message =
                format!("must be less than the tile ({}), got {}", self.tile, self.overlap);
            return Err(Error::invalid("overlap", message));
        }
        Ok(self)
    }

    /// From one start to the next.
    pub const fn step(&self) -> usize {
        self.tile - self.overlap
    }

    /// How many tiles cover the length; the last may stick out.
    pub const fn count(&self) -> usize {
        if self.length <= self.tile {
            1
        } else {
            (self.length - self.tile).div_ceil(self.step()) + 1
        }
    }

    pub const fn start(&self, index: usize) -> usize {
        index * self.step()
    }

    /// The tiles that touch the pixels [from, to).
    pub const fn touching(&self, from: usize, to: usize) -> std::ops::Range<usize> {
        let first = if from < self.tile { 0 } else { (from - self.tile) / self.step() + 1 };
        let last = (to - 1) / self.step();
        let count = self.count();
        first..if last < count { last + 1 } else { count }
    }

    /// Shares of all tiles, `tile` of them each; the shares of a pixel sum to 1. Every pixel is normalised
    /// by the sum over all tiles there, counted whole where they stick out, so that borders and overlaps
    /// of more than half a tile come out right too.
    pub fn shares(&self, blend: Blend) -> Result<Vec<f64>, Error> {
        let (tile, overlap) = (self.tile, self.overlap as f64);
        let ramp: Vec<f64> = (0..tile)
            .map(|i| {
                let inner = (i as f64 + 0.5).min(tile as f64 - i as f64 - 0.5);
                let rise = if self.overlap == 0 { 1.0 } else { (inner / overlap).min(1.0) };
                match blend {
                    Blend::Linear => rise,
                    Blend::Power => libm::sin(std::f64::consts::FRAC_PI_2 * rise).powi(2),
                }
            })
            .collect();
        let count = self.count();
        let mut sums = zeroed::<f64>(self.start(count - 1) + tile)?;
        for index in 0..count {
            for (sum, w) in sums[self.start(index)..].iter_mut().zip(&ramp) {
                *sum += w;
            }
        }
        let mut shares = zeroed::<f64>(count * tile)?;
        for (index, shares) in shares.chunks_mut(tile).enumerate() {
            for ((share, w), sum) in shares.iter_mut().zip(&ramp).zip(&sums[self.start(index)..]) {
                *share = w / sum;
            }
        }
        Ok(shares)
    }

    /// Weights of all tiles, by which their fields are added: the roots of the shares where these are of
    /// the power.
    pub fn weights<T: Real>(&self, blend: Blend) -> Result<Vec<T>, Error> {
        let shares = self.shares(blend)?;
        let root = blend == Blend::Power;
        collected(shares.iter().map(|&share| T::of(if root { share.sqrt() } else { share })))
    }

    /// Fills `out` (length, tiles) with each tile's share of each pixel; a row sums to 1.
    pub fn fill_shares(&self, mut out: ArrayViewMut2<'_, f64>, blend: Blend) -> Result<(), Error> {
        if out.dim() != (self.length, self.count()) {
            return Err(Error::Internal("shares: wrong shape".into()));
        }
        out.fill(0.0);
        for (index, shares) in self.shares(blend)?.chunks(self.tile).enumerate() {
            let mut column = out.slice_mut(s![self.start(index).., index]);
            column.iter_mut().zip(shares).for_each(|(to, &share)| *to = share);
        }
        Ok(())
    }
}

/// The weighted sum of a grid of tiles, in a fixed order.
pub fn blend_tiles<T: Real>(
    mut out: ArrayViewMut2<'_, T>,
    tiles: ArrayView4<'_, T>,
    overlap: usize,
    blend: Blend,
) -> Result<(), Error> {
    let (height, width) = out.dim();
    let (rows, cols, tile_height, tile_width) = tiles.dim();
    let down = Row { length: height, tile: tile_height, overlap }.checked()?;
    let across = Row { length: width, tile: tile_width, overlap }.checked()?;
    let (high, wide) = (down.count(), across.count());
    if (rows, cols) != (high, wide) {
        let message = format!(
            "shape ({height}, {width}) with this tile and overlap takes {high} x {wide} tiles, got {rows} x {cols}"
        );
        return Err(Error::invalid("tiles", message));
    }
    let (wy, wx) = (down.weights::<T>(blend)?, across.weights::<T>(blend)?);
    out.fill(T::zero());
    for ((row, col, y, x), &value) in tiles.indexed_iter() {
        let at = (down.start(row) + y, across.start(col) + x);
        if let Some(pixel) = out.get_mut(at) {
            *pixel += wy[row * tile_height + y] * wx[col * tile_width + x] * value;
        }
    }
    Ok(())
}
