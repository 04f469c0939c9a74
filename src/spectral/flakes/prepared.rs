//! Patterns as a frame reads them: folded to what the cosines and sines of the transform are
//! multiplied by, with the transform's tables.
//!
//! S(b) and S(-b) of a column make S(b) + S(-b) and i (S(b) - S(-b)), both conjugate. Waves of mean 0
//! stand there: the mean is not blended.

#![expect(unsafe_code, reason = "complex numbers as the pairs that they are")]

use ndarray::{ArrayView3, Axis};
use num_complex::Complex;

use crate::base::aligned::Aligned;
use crate::base::error::{Error, collected, layout};
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::dispatch;
use crate::spectral::dense::Dense;

/// Numbers of a wave: two complex sums.
pub const PARTS: usize = 4;

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
            let spectrum = spectrum.to_slice().ok_or_else(layout)?;
            let numbers = parts(spectrum);
            let trace = match T::own(numbers) {
                Some(numbers) => fold(values, numbers, (tile, half, stride)),
                None => {
                    let other = collected(numbers.iter().map(|value| T::of(value.wide())))?;
                    fold(values, &other, (tile, half, stride))
                }
            };
            if trace == T::zero() {
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

    pub fn pattern(&self, index: usize) -> &[T] {
        &self.values[index * self.size()..(index + 1) * self.size()]
    }
}

/// Real and imaginary parts in turn.
const fn parts<S>(spectrum: &[Complex<S>]) -> &[S] {
    // SAFETY: `Complex` is two numbers, one behind the other, with the alignment of one.
    unsafe { std::slice::from_raw_parts(spectrum.as_ptr().cast(), 2 * spectrum.len()) }
}

/// For each row y of pixels cosines and sines of 2 pi shear a y / M.
#[dispatch]
fn shear_turns<const LEVEL: u8, T: Real>(turns: &mut [T], shear: f64, tile: usize) {
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

/// Folds one spectrum, real and imaginary parts in turn, into `values`. The result is 0 if all numbers
/// are finite: infinity and NaN times 0 are not.
#[dispatch]
fn fold<const LEVEL: u8, T: Real>(
    values: &mut [T],
    spectrum: &[T],
    sizes: (usize, usize, usize),
) -> T {
    let (tile, half, stride) = sizes;
    let columns = 2 * (tile / 2 + 1);
    let row = |b: usize| &spectrum[b * columns..][..2 * half];
    // One for each lane: a single sum would be a chain.
    let mut traces = [T::zero(); 16];
    for (b, values) in values.chunks_exact_mut(PARTS * stride).enumerate() {
        let (up, down) = (row(b), row((tile - b) % tile));
        let (sums, differences) = values.split_at_mut(2 * stride);
        let (sum_re, sum_im) = sums.split_at_mut(stride);
        let (difference_re, difference_im) = differences.split_at_mut(stride);
        let (sum_re, sum_im) = (&mut sum_re[..half], &mut sum_im[..half]);
        let (difference_re, difference_im) =
            (&mut difference_re[..half], &mut difference_im[..half]);
        for a in 0..half {
            let (re, im) = ((up[2 * a], down[2 * a]), (up[2 * a + 1], down[2 * a + 1]));
            sum_re[a] = re.0 + re.1;
            sum_im[a] = -(im.0 + im.1);
            difference_re[a] = im.1 - im.0;
            difference_im[a] = re.1 - re.0;
        }
        for row in [&*sum_re, &*sum_im] {
            for part in row.chunks(16) {
                for (trace, value) in traces.iter_mut().zip(part) {
                    *trace += *value * T::zero();
                }
            }
        }
    }
    // b = 0 is its own opposite, and its sines are 0.
    let (first, rest) = values[..PARTS * stride].split_at_mut(2 * stride);
    for (a, wave) in row(0).chunks_exact(2).enumerate() {
        first[a] = wave[0];
        first[stride + a] = -wave[1];
    }
    rest.fill(T::zero());
    // The mean.
    first[0] = T::zero();
    first[stride] = T::zero();
    traces.iter().fold(T::zero(), |sum, &trace| sum + trace)
}
