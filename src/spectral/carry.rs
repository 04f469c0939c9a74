//! What tiles leave to their neighbours: the sums at their right and lower borders.
//!
//! A tile is added in place to what came before, in row-major order. Its left columns get what the
//! tile before it left there (which holds the row above already), its upper rows what the row above
//! left. So only borders are stored and read again, and a tile's middle never leaves the first cache.

use crate::base::aligned::Aligned;
use crate::base::error::Error;
use crate::base::real::Real;
use crate::base::simd::{dispatch, multiply_add};

/// Columns that a loop advances by.
const LANES: usize = 16;

/// The borders that wait for their neighbours.
pub struct Carry<T> {
    /// Size of a tile, and from one start to the next: (rows, cols).
    tile: (usize, usize),
    step: (usize, usize),
    /// Columns of `left`: those that tiles share, made whole lanes where the tile is as wide. In the
    /// others stands what the row above left.
    lead: usize,
    left: Aligned<T>,
    /// 1 where `left` is the tile's own, 0 where it is what the row above left.
    kept: Aligned<T>,
    /// Rows that tiles share, over all columns from `origin` on.
    above: Aligned<T>,
    span: usize,
    origin: usize,
    /// Whether there is a row above.
    below: bool,
}

impl<T: Real> Carry<T> {
    /// For rows of tiles whose first pixels are `origin` to `last`.
    pub fn new(
        tile: (usize, usize),
        step: (usize, usize),
        origin: usize,
        last: usize,
    ) -> Result<Self, Error> {
        let lead = (tile.1 - step.1).next_multiple_of(LANES).min(tile.1);
        let span = last + tile.1 - origin;
        let mut kept = Aligned::zeroed(lead)?;
        kept[..tile.1 - step.1].fill(T::one());
        Ok(Self {
            tile,
            step,
            lead,
            left: Aligned::zeroed(tile.0 * lead)?,
            kept,
            above: Aligned::zeroed((tile.0 - step.0) * span)?,
            span,
            origin,
            below: false,
        })
    }

    /// Room that `pixels` need behind the tile's own: what is read there is not used.
    pub const MARGIN: usize = LANES;

    /// Before the first tile of a row: nothing stands left of it.
    pub fn begin_row(&mut self) {
        let shared = self.tile.0 - self.step.0;
        for (y, left) in self.left.chunks_exact_mut(self.lead.max(1)).enumerate() {
            if self.below && y < shared {
                left.copy_from_slice(&self.above[y * self.span..][..self.lead]);
            } else {
                left.fill(T::zero());
            }
        }
    }

    /// Weights the pixels of the tile that starts at column `start` and adds what came before.
    pub fn add(&self, start: usize, pixels: &mut [T], weights: (&[T], &[T])) {
        let shared = if self.below { self.tile.0 - self.step.0 } else { 0 };
        let above = self.above.get(start - self.origin..).unwrap_or(&[]);
        add(pixels, weights, &self.left, self.lead, above, self.span, shared);
    }

    /// Keeps the borders of the tile that starts at column `start`; `last` ends its row.
    pub fn keep(&mut self, start: usize, pixels: &[T], last: bool) {
        let (at, width) = (start - self.origin, self.tile.1);
        if !last {
            let next = at + self.step.1;
            let shared = if self.below { self.tile.0 - self.step.0 } else { 0 };
            let above = self.above.get(next..).unwrap_or(&[]);
            let left = &mut self.left[..];
            hand_on(left, &self.kept, pixels, (width, self.step.1), above, self.span, shared);
        }
        let count = if last { width } else { self.step.1 };
        let lines = self.above.chunks_exact_mut(self.span);
        for (above, pixels) in lines.zip(pixels.chunks_exact(width).skip(self.step.0)) {
            above[at..at + count].copy_from_slice(&pixels[..count]);
        }
        self.below |= last;
    }
}

/// `left` of the next tile: this one's columns from `step` on; behind them, in the first `shared` rows,
/// what the row above left.
#[dispatch]
fn hand_on<const LEVEL: u8, T: Real>(
    left: &mut [T],
    kept: &[T],
    pixels: &[T],
    steps: (usize, usize),
    above: &[T],
    span: usize,
    shared: usize,
) {
    let (width, step) = steps;
    for (y, left) in left.chunks_exact_mut(kept.len().max(1)).enumerate() {
        let from = &pixels[y * width + step..][..left.len()];
        let kept = &kept[..left.len()];
        if y < shared {
            let above = &above[y * span..][..left.len()];
            for i in 0..left.len() {
                left[i] = kept[i] * from[i] + (T::one() - kept[i]) * above[i];
            }
        } else {
            for i in 0..left.len() {
                left[i] = kept[i] * from[i];
            }
        }
    }
}

/// pixels = weight * pixels + what came before: `left` in the first `lead` columns, and in the first
/// `shared` rows `above` in the others.
#[dispatch]
fn add<const LEVEL: u8, T: Real>(
    pixels: &mut [T],
    weights: (&[T], &[T]),
    left: &[T],
    lead: usize,
    above: &[T],
    span: usize,
    shared: usize,
) {
    let (wy, wx) = weights;
    let (lead_weights, weights) = wx.split_at(lead);
    for (y, (&wy, pixels)) in wy.iter().zip(pixels.chunks_exact_mut(wx.len())).enumerate() {
        let (head, tail) = pixels.split_at_mut(lead);
        let left = &left[y * lead..][..head.len()];
        for i in 0..head.len() {
            head[i] = multiply_add::<T, LEVEL>(wy * lead_weights[i], head[i], left[i]);
        }
        let weights = &weights[..tail.len()];
        if y < shared {
            let above = &above[y * span + lead..][..tail.len()];
            for i in 0..tail.len() {
                tail[i] = multiply_add::<T, LEVEL>(wy * weights[i], tail[i], above[i]);
            }
        } else {
            for i in 0..tail.len() {
                tail[i] = wy * weights[i] * tail[i];
            }
        }
    }
}
