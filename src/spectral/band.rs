//! Which waves take part, and how strongly (Langer 2004, sections 5.3 and 5.4).

use ndarray::ArrayViewMut2;

use super::grid::{magnitude, signed};
use crate::base::error::{Error, finite};

/// A half-open band of wavelengths and the exponent of its spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// Waves with `shortest < wavelength <= longest`, in pixels.
    pub shortest: f64,
    pub longest: f64,
    /// Amplitude ~ |k|^-exponent; 1 gives every octave the same power.
    pub exponent: f64,
}

impl Band {
    /// Refuses a band that the grid cannot hold: half-open with shortest >= 2 it has no Nyquist bin.
    pub fn checked(self) -> Result<Self, Error> {
        let (low, high) =
            (finite("wavelengths", self.shortest)?, finite("wavelengths", self.longest)?);
        finite("exponent", self.exponent)?;
        if !(low >= 2.0 && low < high) {
            let message = format!("need 2 <= shortest < longest, got ({low}, {high})");
            return Err(Error::invalid("wavelengths", message));
        }
        Ok(self)
    }

    /// Whether the band holds a bin. Integers are compared, not square roots, so that a wave on the
    /// limit falls on the right side for every size.
    pub fn holds(&self, ky: i64, kx: i64, (height, width): (usize, usize)) -> bool {
        let shared = gcd(height, width);
        let (rows, cols) = ((height / shared) as f64, (width / shared) as f64);
        // |k'|^2 = radius / limit, with k' in cycles per pixel.
        let radius = (ky as f64 * cols).powi(2) + (kx as f64 * rows).powi(2);
        let limit = (rows * cols * shared as f64).powi(2);
        radius * self.shortest.powi(2) < limit && radius * self.longest.powi(2) >= limit
    }

    pub fn weight(&self, ky: i64, kx: i64, shape: (usize, usize)) -> f64 {
        libm::pow(magnitude(ky, kx, shape), -self.exponent)
    }

    /// The factor that makes the squares of all bins sum to 1; an error if there is no bin.
    pub fn normaliser(&self, squares: f64, (height, width): (usize, usize)) -> Result<f64, Error> {
        if squares > 0.0 && squares.is_finite() {
            return Ok(1.0 / squares.sqrt());
        }
        Err(Error::invalid(
            "wavelengths",
            format!(
                "a tile of {height} x {width} px has no usable wave longer than {} and up to {} px \
                 with exponent {}",
                self.shortest, self.longest, self.exponent
            ),
        ))
    }
}

const fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// A sum that carries its own rounding error (Neumaier).
#[derive(Debug, Clone, Copy, Default)]
pub struct Sum {
    total: f64,
    lost: f64,
}

impl Sum {
    pub fn add(&mut self, term: f64) {
        let total = self.total + term;
        self.lost += if self.total.abs() >= term.abs() {
            (self.total - total) + term
        } else {
            (term - total) + self.total
        };
        self.total = total;
    }

    pub fn value(self) -> f64 {
        self.total + self.lost
    }
}

/// The amplitude of every bin; squares sum to 1.
pub fn band_amplitude(mut out: ArrayViewMut2<'_, f64>, band: Band) -> Result<(), Error> {
    let band = band.checked()?;
    let shape = out.dim();
    let mut squares = Sum::default();
    for ((row, col), amplitude) in out.indexed_iter_mut() {
        let (ky, kx) = (signed(row, shape.0), signed(col, shape.1));
        *amplitude = if band.holds(ky, kx, shape) { band.weight(ky, kx, shape) } else { 0.0 };
        squares.add(*amplitude * *amplitude);
    }
    let factor = band.normaliser(squares.value(), shape)?;
    out.mapv_inplace(|amplitude| amplitude * factor);
    Ok(())
}
