//! What `preserve_mean` gives back: the mean opacity that the filter took from each tile, mixed as
//! the tiles are.

use std::ops::Range;

use super::opacity::{Lifted, Opacity};
use super::spectrum::Power;
use crate::base::error::{Error, collected, zeroed};
use crate::base::real::Real;
use crate::base::simd::dispatch;

/// Of each row of tiles that still touches the picture, the tiles' values mixed across.
pub struct Lift<T> {
    map: Opacity,
    /// Whether all tiles have the same value, which is then the mix everywhere: weights sum to 1.
    alike: bool,
    /// A ring: one line for each row of tiles that can touch a pixel.
    lines: Vec<Vec<T>>,
    /// Whether a line has any that is not 0.
    lost: Vec<bool>,
    origin: usize,
    block: Vec<T>,
    /// The last tile's power and what it lost: the next one's are often the same.
    known: (Power, f64),
}

/// Adds a row of tiles' values with their share.
#[dispatch]
fn add_share<const LEVEL: u8, T: Real>(out: &mut [T], line: &[T], share: T) {
    for (out, &value) in out.iter_mut().zip(line) {
        *out += share * value;
    }
}

impl<T: Real> Lift<T> {
    /// For at most `rows` rows of tiles over a pixel, columns `span`, blocks of at most `most` pixels.
    pub fn new(
        map: Opacity,
        alike: bool,
        rows: usize,
        span: Range<usize>,
        most: usize,
    ) -> Result<Self, Error> {
        let mut lines = Vec::new();
        for _ in 0..if alike { 0 } else { rows } {
            lines.push(zeroed(span.len())?);
        }
        let none = Power { present: f64::NAN, kept: f64::NAN };
        let block = zeroed(if alike { 0 } else { most })?;
        let lost = collected(lines.iter().map(|_| false))?;
        Ok(Self { map, alike, lines, lost, origin: span.start, block, known: (none, 0.0) })
    }

    /// Before the first tile of a row.
    pub fn begin_row(&mut self, row: usize) {
        let count = self.lines.len();
        if count > 0 {
            self.lines[row % count].fill(T::zero());
            self.lost[row % count] = false;
        }
    }

    /// Adds a tile of a row, of the given power, that starts at column `start`.
    pub fn add(&mut self, power: Power, row: usize, start: usize, weights: &[T], squared: bool) {
        if power != self.known.0 {
            self.known = (power, self.lost(power));
        }
        let (value, count) = (self.known.1, self.lines.len());
        // Nothing lost is the common case, and exactly nothing must be added then.
        if count == 0 || value == 0.0 {
            return;
        }
        self.lost[row % count] = true;
        let (value, line) = (T::of(value), &mut self.lines[row % count]);
        for (sum, &w) in line[start - self.origin..].iter_mut().zip(weights) {
            *sum += value * if squared { w * w } else { w };
        }
    }

    /// What is added to a block of columns; `rows` gives, for each of its rows, the rows of tiles that
    /// touch it and their share.
    pub fn of<R: Iterator<Item = (usize, T)>>(
        &mut self,
        cols: Range<usize>,
        rows: impl Iterator<Item = R>,
    ) -> Lifted<'_, T> {
        if self.alike && self.known.1 != 0.0 {
            return Lifted::All(T::of(self.known.1));
        }
        if self.alike || !self.lost.contains(&true) {
            return Lifted::None;
        }
        let Self { lines, block, .. } = self;
        let mut count = 0;
        for (out, touching) in block.chunks_exact_mut(cols.len()).zip(rows) {
            out.fill(T::zero());
            for (row, share) in touching {
                let line = &lines[row % lines.len()];
                add_share(out, &line[cols.start - self.origin..], share);
            }
            count += cols.len();
        }
        Lifted::Each(&block[..count])
    }

    /// The mean opacity that the filter took from a tile.
    fn lost(&self, power: Power) -> f64 {
        if power.kept == power.present {
            return 0.0;
        }
        self.map.mean_of(power.present) - self.map.mean_of(power.kept)
    }
}
