//! One tile: its waves at their phases, transformed to pixels by the cheaper of two ways.

use std::sync::Arc;

use flurries_fft::{ComplexToReal, Fft};
use num_complex::Complex;

use super::dense::{Dense, Work, operations, transform};
use super::spectrum::{Columns, Power, TileMotion, Values};
use super::transform::room_for_plans;
use super::waves::{Draw, Waves};
use crate::base::error::{Error, zeroed};
use crate::base::real::Real;

/// How many multiply-adds of the dense passes cost as much as one floating-point operation of an FFT:
/// they run on full vectors from the first cache. Measured between 1.2 and 3.8
/// (docs/internals/history.md), high where the size is no power of two.
const DENSE_ADVANTAGE: f64 = 1.5;

/// Floating-point operations of the FFT's way: complex along y for the columns of the band, then every
/// row to real pixels.
fn fft_operations(waves: &Waves) -> f64 {
    let (height, width) = waves.tile;
    let log2 = |n: usize| (n as f64).log2().max(1.0);
    5.0 * (waves.columns * height) as f64 * log2(height)
        + 2.5 * (height * width) as f64 * log2(width)
}

/// Rows that are taken from the columns together: a line of the cache, in float32.
const TOGETHER: usize = 8;

/// A transform, planned for one tile size and band.
pub struct Plan<T: Real> {
    columns: Columns,
    way: Way<T>,
    tile: (usize, usize),
    /// Wavelength, pixels.
    longest: f64,
}

enum Way<T: Real> {
    Dense(Dense<T>),
    Fft { columns: usize, along_y: Arc<dyn Fft<T>>, along_x: Arc<dyn ComplexToReal<T>> },
}

/// Buffers of one worker, reused from tile to tile.
pub struct Scratch<T> {
    values: Values<T>,
    // Dense: work space.
    work: Option<Work<T>>,
    // FFT: spectrum, several half rows, work space.
    spectrum: Vec<Complex<T>>,
    line: Vec<Complex<T>>,
    work_y: Vec<Complex<T>>,
    work_x: Vec<Complex<T>>,
}

impl<T: Real> Plan<T> {
    /// Plans the transform for a set of waves, `plain` for the same bits on every processor: two dense products, or
    /// FFTs of the columns in the band and then of every row, as the operation count says; both give the same
    /// field within rounding.
    pub fn new(waves: &Waves, plain: bool) -> Result<Self, Error> {
        let (height, width) = waves.tile;
        let longest = waves.list.iter().map(|wave| wave.wavelength).fold(0.0, f64::max);
        let tile = waves.tile;
        if operations(waves) < DENSE_ADVANTAGE * fft_operations(waves) {
            let columns = Columns::new(waves, Dense::<T>::half_pixel)?;
            return Ok(Self { columns, tile, longest, way: Way::Dense(Dense::new(waves)?) });
        }
        room_for_plans::<T>(tile)?;
        Ok(Self {
            columns: Columns::new(waves, |_, _| 0.0)?,
            tile,
            longest,
            way: Way::Fft {
                columns: waves.columns,
                along_y: T::inverse(height, plain),
                along_x: T::to_real(width, plain),
            },
        })
    }

    pub fn scratch(&self) -> Result<Scratch<T>, Error> {
        let (height, width) = self.tile;
        let mut scratch = Scratch {
            values: self.columns.values()?,
            work: None,
            spectrum: Vec::new(),
            line: Vec::new(),
            work_y: Vec::new(),
            work_x: Vec::new(),
        };
        match &self.way {
            Way::Dense(dense) => scratch.work = Some(dense.work()?),
            Way::Fft { columns, along_y, along_x } => {
                scratch.spectrum = zeroed(columns * height)?;
                scratch.line = zeroed(TOGETHER * (width / 2 + 1))?;
                scratch.work_y = zeroed(along_y.get_inplace_scratch_len())?;
                scratch.work_x = zeroed(along_x.get_scratch_len())?;
            }
        }
        Ok(scratch)
    }

    /// Makes the tile's pixels, row by row, and returns the power of its waves.
    pub fn render(
        &self,
        draw: Draw,
        motion: TileMotion<'_>,
        scratch: &mut Scratch<T>,
        pixels: &mut [T],
    ) -> Result<Power, Error> {
        if motion.shortest >= self.longest {
            // Before a wall that is nearer than all waves, or where nobody looks.
            pixels.fill(T::zero());
            return Ok(Power::default());
        }
        let power = self.columns.spectrum(self.tile, draw, motion, &mut scratch.values);
        if power.kept == 0.0 {
            // Too fast for the frame rate, every wave: a transform of zeros.
            pixels.fill(T::zero());
            return Ok(power);
        }
        let (re, im) = (&scratch.values.re, &scratch.values.im);
        match &self.way {
            Way::Dense(dense) => {
                if let Some(work) = &mut scratch.work {
                    transform(dense, re, im, work, pixels);
                }
            }
            Way::Fft { columns, along_y, along_x } => {
                let height = self.tile.0;
                let (half, stride) = self.columns.size();
                for (kx, column) in scratch.spectrum.chunks_exact_mut(height).enumerate() {
                    for (ky, bin) in column[..half].iter_mut().enumerate() {
                        *bin = Complex::new(re[ky * stride + kx], im[ky * stride + kx]);
                    }
                    // The transform is in place, so the last tile's is still there.
                    column[half..height - half + 1].fill(Complex::new(T::zero(), T::zero()));
                    for (ky, bin) in column[height - half + 1..].iter_mut().rev().enumerate() {
                        let at = (half + 1 + ky) * stride + kx;
                        *bin = Complex::new(re[at], im[at]);
                    }
                }
                along_y.process_with_scratch(&mut scratch.spectrum, &mut scratch.work_y);
                self.rows(*columns, along_x.as_ref(), scratch, pixels)?;
            }
        }
        Ok(power)
    }

    /// The second half of the FFT's way: every row from the columns to pixels.
    fn rows(
        &self,
        columns: usize,
        along_x: &dyn ComplexToReal<T>,
        scratch: &mut Scratch<T>,
        pixels: &mut [T],
    ) -> Result<(), Error> {
        let (height, width) = self.tile;
        let half = width / 2 + 1;
        for (block, pixels) in pixels.chunks_mut(TOGETHER * width).enumerate() {
            // Several rows at a time: columns lie a power of two apart, and a line of the cache that is
            // read for one row alone is gone before the next.
            let first = block * TOGETHER;
            let count = pixels.len() / width;
            for (kx, column) in scratch.spectrum.chunks_exact(height).enumerate() {
                for (row, bin) in column[first..first + count].iter().enumerate() {
                    scratch.line[row * half + kx] = *bin;
                }
            }
            let lines = scratch.line.chunks_exact_mut(half);
            for (line, pixels) in lines.zip(pixels.chunks_exact_mut(width)) {
                // Beyond the columns the transform left its own work behind.
                line[columns..].fill(Complex::new(T::zero(), T::zero()));
                // Zero but for rounding, since the column of kx = 0 is Hermitian; c2r insists on zero.
                line[0].im = T::zero();
                along_x
                    .process_with_scratch(line, pixels, &mut scratch.work_x)
                    .map_err(|error| Error::Internal(error.to_string()))?;
            }
        }
        Ok(())
    }
}
