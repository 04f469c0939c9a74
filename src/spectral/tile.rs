//! One tile: its waves at their phases, transformed to pixels.

use std::sync::Arc;

use flurries_fft::{ComplexToReal, Fft};
use num_complex::Complex;

use super::filter::TemporalFilter;
use super::grid::position;
use super::tent::Motion;
use super::waves::{Draw, Waves};
use crate::error::{Error, zeroed};
use crate::real::Real;

/// What one tile is asked for, apart from its random draw. Slices have one entry per ring.
pub struct TileMotion<'a> {
    /// Displacements since time 0.
    pub place: &'a [Motion],
    /// Displacements per frame, where the filter needs them.
    pub rate: Option<(&'a [Motion], TemporalFilter)>,
    /// Waves up to this wavelength are left out (a depth limit); 0 leaves out none.
    pub shortest: f64,
}

/// Power of the waves of a tile: what is in the band's depth range, and what the filter kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Power {
    /// Before the temporal filter.
    pub present: f64,
    /// After it.
    pub kept: f64,
}

/// Transforms of one tile size. Only columns that hold a wave are transformed along y.
pub struct Plan<T: Real> {
    tile: (usize, usize),
    columns: usize,
    along_y: Arc<dyn Fft<T>>,
    along_x: Arc<dyn ComplexToReal<T>>,
}

/// Buffers of one worker, reused from tile to tile.
pub struct Scratch<T> {
    spectrum: Vec<Complex<T>>,
    line: Vec<Complex<T>>,
    work_y: Vec<Complex<T>>,
    work_x: Vec<Complex<T>>,
    pixels: Vec<T>,
}

impl<T: Real> Plan<T> {
    /// Plans the transforms for a set of waves.
    pub fn new(waves: &Waves) -> Self {
        Self {
            tile: waves.tile,
            columns: waves.columns,
            along_y: T::inverse(waves.tile.0),
            along_x: T::to_real(waves.tile.1),
        }
    }

    /// Buffers for this plan.
    pub fn scratch(&self) -> Result<Scratch<T>, Error> {
        Ok(Scratch {
            spectrum: zeroed(self.columns * self.tile.0)?,
            line: zeroed(self.tile.1 / 2 + 1)?,
            work_y: zeroed(self.along_y.get_inplace_scratch_len())?,
            work_x: zeroed(self.along_x.get_scratch_len())?,
            pixels: zeroed(self.tile.0 * self.tile.1)?,
        })
    }

    /// The tile's pixels, row by row, and the power of its waves.
    pub fn render<'s>(
        &self,
        waves: &Waves,
        draw: Draw,
        motion: &TileMotion<'_>,
        scratch: &'s mut Scratch<T>,
    ) -> Result<(&'s [T], Power), Error> {
        let power = self.fill(waves, draw, motion, &mut scratch.spectrum);
        self.along_y.process_with_scratch(&mut scratch.spectrum, &mut scratch.work_y);
        let (height, width) = self.tile;
        for (y, pixels) in scratch.pixels.chunks_mut(width).enumerate() {
            for (bin, column) in scratch.line.iter_mut().zip(scratch.spectrum.chunks(height)) {
                *bin = column[y];
            }
            // Beyond the columns the transform left its own work behind.
            scratch.line[self.columns..].fill(Complex::new(T::zero(), T::zero()));
            // Zero but for rounding, since the column of kx = 0 is Hermitian; c2r insists on zero.
            scratch.line[0].im = T::zero();
            self.along_x
                .process_with_scratch(&mut scratch.line, pixels, &mut scratch.work_x)
                .map_err(|error| Error::Internal(error.to_string()))?;
        }
        Ok((&scratch.pixels, power))
    }

    /// Writes the half spectrum, column after column.
    fn fill(
        &self,
        waves: &Waves,
        draw: Draw,
        motion: &TileMotion<'_>,
        spectrum: &mut [Complex<T>],
    ) -> Power {
        let height = self.tile.0;
        spectrum.fill(Complex::new(T::zero(), T::zero()));
        let mut power = Power { present: 0.0, kept: 0.0 };
        for wave in &waves.list {
            if wave.wavelength <= motion.shortest {
                continue;
            }
            let (rest, direction) = draw.of(wave, self.tile);
            let step = motion.place[wave.ring].step(direction, wave.frequency);
            let gain = motion.rate.as_ref().map_or(1.0, |(rates, filter)| {
                filter.gain(rates[wave.ring].step(direction, wave.frequency))
            });
            power.present += 2.0 * wave.amplitude * wave.amplitude;
            let amplitude = wave.amplitude * gain;
            power.kept += 2.0 * amplitude * amplitude;
            let value = T::turn(super::phase::reduce(rest + step)).scale(T::of(amplitude));
            let column = wave.kx as usize * height;
            spectrum[column + position(wave.ky, height)] = value;
            if wave.kx == 0 {
                spectrum[position(-wave.ky, height)] = value.conj();
            }
        }
        power
    }
}
