//! Particles as arrays, and what is refused of them.

use ndarray::{ArrayView1, ArrayView2};

use super::sprite::Particle;
use crate::base::error::Error;

/// Particles as arrays: centers (n, 3) in camera axes; the others have n rows, or one for all.
#[derive(Debug, Clone, Copy)]
pub struct Cloud<'a> {
    /// World units.
    pub centers: ArrayView2<'a, f64>,
    /// Three sigma, world units.
    pub radius: ArrayView1<'a, f64>,
    /// Opacity of the middle, 0 to 1.
    pub density: ArrayView1<'a, f64>,
    /// Linear RGB, (1 or n, 3).
    pub colors: &'a [[f64; 3]],
}

impl Cloud<'_> {
    /// Refuses what has no image.
    pub fn check(&self) -> Result<(), Error> {
        let count = self.centers.nrows();
        if self.centers.ncols() != 3 {
            return Err(Error::invalid("centers", "must be (n, 3)"));
        }
        if count > u32::MAX as usize {
            return Err(Error::invalid("centers", "must hold fewer than 2^32 particles"));
        }
        let rows = |length: usize| length == 1 || length == count;
        if !rows(self.radius.len()) {
            return Err(Error::invalid("radius", "must be one number, or one for each particle"));
        }
        if !rows(self.density.len()) {
            return Err(Error::invalid("density", "must be one number, or one for each particle"));
        }
        if self.colors.is_empty() || !rows(self.colors.len()) {
            return Err(Error::invalid("color", "must be one color, or one for each particle"));
        }
        if !self.centers.iter().all(|value| value.is_finite()) {
            return Err(Error::invalid("centers", "must be finite"));
        }
        if let Some(bad) = self.radius.iter().find(|&&r| !(r > 0.0 && r.is_finite())) {
            return Err(Error::invalid("radius", format!("must be positive, got {bad}")));
        }
        if let Some(bad) = self.density.iter().find(|&&d| !(0.0..=1.0).contains(&d)) {
            return Err(Error::invalid("density", format!("must be from 0 to 1, got {bad}")));
        }
        if !self.colors.iter().flatten().all(|value| value.is_finite()) {
            return Err(Error::invalid("color", "must be finite"));
        }
        Ok(())
    }

    /// One particle.
    pub fn get(&self, index: usize) -> Particle {
        let row = |length: usize| if length == 1 { 0 } else { index };
        Particle {
            center: [0, 1, 2].map(|axis| self.centers[[index, axis]]),
            radius: self.radius[row(self.radius.len())],
            density: self.density[row(self.density.len())],
        }
    }
}
