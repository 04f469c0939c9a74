//! Patterns as a frame reads them: folded to what the cosines and sines of the transform are
//! multiplied by, with the transform's tables.
//!
//! S(b) and S(-b) of a column make S(b) + S(-b) and i (S(b) - S(-b)), both conjugate. Waves of mean 0
//! stand there: the mean is not blended.

use ndarray::{ArrayView2, ArrayView3, Axis};
use num_complex::Complex;

use crate::base::aligned::Aligned;
use crate::base::error::Error;
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::dispatch;
use crate::spectral::dense::Dense;

/// Numbers of a wave: two complex sums.
pub const PARTS: usize = 4;

/// Some patterns of a tile.
pub struct Prepared<T> {
    /// M, pixels.
    pub tile: usize,
    /// h / M.
    pub shear: f64,
    /// Indices a and b of waves are below it.
    pub half: usize,
    pub dense: Dense<T>,
    /// For each row of pixels the cosines and sines of all columns that the shear turns by.
    pub turns: Aligned<T>,
    /// Pattern by pattern for each b = 0 .. half: real parts of the sum, imaginary ones, then those of
    /// the difference.
    values: Aligned<T>,
}

impl<T: Real> Prepared<T> {
    /// From spectra (n, M, M/2 + 1) of either precision, waves of half a cycle left out.
    pub fn new<S: Real>(spectra: ArrayView3<'_, Complex<S>>, shear: f64) -> Result<Self, Error> {
        let (number, tile, columns) = spectra.dim();
        if tile == 0 || columns != tile / 2 + 1 {
            let message = format!("must be (..., M, M/2 + 1), got {tile} x {columns}");
            return Err(Error::invalid("patterns", message));
        }
        // Half a cycle is no index below `half`.
        let half = tile.div_ceil(2);
        let dense = Dense::square(tile, half)?;
        let stride = dense.stride();
        let mut turns = Aligned::zeroed(2 * tile * stride)?;
        shear_turns(&mut turns, shear, tile);
        let size = PARTS * stride * half;
        let mut values = Aligned::zeroed(number * size)?;
        let tasks = values.chunks_exact_mut(size).zip(spectra.axis_iter(Axis(0)));
        pool::for_each(tasks, |(values, spectrum)| {
            if fold(values, &spectrum, (tile, half, stride)) {
                return Ok(());
            }
            Err(Error::invalid("patterns", "must be finite, got NaN or infinity"))
        })?;
        Ok(Self { tile, shear, half, dense, turns, values })
    }

    pub fn count(&self) -> usize {
        self.values.len() / self.size()
    }

    fn size(&self) -> usize {
        PARTS * self.dense.stride() * self.half
    }

    /// The folded waves of a pattern.
    pub fn pattern(&self, index: usize) -> &[T] {
        &self.values[index * self.size()..(index + 1) * self.size()]
    }
}

/// For each row y of pixels cosines and sines of 2 pi shear a y / M.
#[inline(always)]
fn shear_turns_with<T: Real, const LEVEL: u8>(turns: &mut [T], shear: f64, tile: usize) {
    let stride = turns.len() / (2 * tile);
    for (y, row) in turns.chunks_exact_mut(2 * stride).enumerate() {
        let (cosines, sines) = row.split_at_mut(stride);
        let cycles = shear * y as f64 / tile as f64;
        let cycles = cycles - cycles.round_ties_even();
        for (a, (cos, sin)) in cosines.iter_mut().zip(sines).enumerate() {
            let phase = a as f64 * cycles;
            let turn = f64::turn::<LEVEL>(phase - phase.round_ties_even());
            (*cos, *sin) = (T::of(turn.re), T::of(turn.im));
        }
    }
}

dispatch! {
    fn shear_turns<T: Real>(turns: &mut [T], shear: f64, tile: usize) = shear_turns_with
}

/// Folds one spectrum into `values`; whether all of its numbers are finite.
fn fold<T: Real, S: Real>(
    values: &mut [T],
    spectrum: &ArrayView2<'_, Complex<S>>,
    (tile, half, stride): (usize, usize, usize),
) -> bool {
    let wave = |b: usize, a: usize| {
        let wave = spectrum[(b % tile, a)];
        (T::of(wave.re.wide()), T::of(wave.im.wide()))
    };
    let mut finite = true;
    for (b, values) in values.chunks_exact_mut(PARTS * stride).enumerate() {
        for a in 0..half {
            let (up, down) = (wave(b, a), wave(tile - b, a));
            let sum = (up.0 + down.0, -(up.1 + down.1));
            finite &= sum.0.is_finite() & sum.1.is_finite();
            // b = 0 is its own opposite, and its sines are 0.
            let difference = (down.1 - up.1, down.0 - up.0);
            let folded =
                if b > 0 { (sum, difference) } else { ((up.0, -up.1), (T::zero(), T::zero())) };
            (values[a], values[stride + a]) = folded.0;
            (values[2 * stride + a], values[3 * stride + a]) = folded.1;
        }
    }
    // The mean.
    values[0] = T::zero();
    values[stride] = T::zero();
    finite
}
