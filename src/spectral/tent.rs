//! The tent surface: the dispersion relation of falling snow (Langer 2004, Eq. 6, sign of Eq. 1).
//!
//! `rate(k) = -(a kx' + b ky') / |k'|` cycles per frame, for a drift of (a, b) cycles per frame.
//! Along its direction a wave of wavelength L then moves by |(a, b)| L pixels per frame: small waves
//! stand for distant snow and move slowly. Displacements obey the same formula as rates.

use ndarray::{ArrayView2, ArrayViewMut2, Zip};

use super::grid::{direction, odd_frequency, reduce, signed};

/// Motion of a tile: a drift on the tent and a shift of all waves alike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Displacement (or velocity) of the wave of one pixel, (x, y): pixels of the longest wave
    /// divided by its wavelength, that is cycles.
    pub drift: [f64; 2],
    /// Displacement (or velocity) of every wave, (x, y) in pixels (camera rotation).
    pub shift: [f64; 2],
}

impl Motion {
    /// The phase step in cycles of a wave with unit vector `direction` and `frequency`, both (y, x).
    #[inline]
    pub fn step(&self, direction: (f64, f64), frequency: (f64, f64)) -> f64 {
        let tent = self.drift[0] * direction.1 + self.drift[1] * direction.0;
        let plane = self.shift[0] * frequency.1 + self.shift[1] * frequency.0;
        -(tent + plane)
    }

    /// The step of the bin at array position (row, col).
    #[inline]
    pub fn step_at(&self, row: usize, col: usize, shape: (usize, usize)) -> f64 {
        let (ky, kx) = (signed(row, shape.0), signed(col, shape.1));
        self.step(direction(ky, kx, shape), odd_frequency(ky, kx, shape))
    }
}

/// The temporal frequency of every bin, cycles per frame; with a loop of so many frames, rounded to
/// whole turns of it (half to even, which is odd).
pub fn tent_rate(mut out: ArrayViewMut2<'_, f64>, drift: [f64; 2], repeat: Option<f64>) {
    let shape = out.dim();
    let motion = Motion { drift, shift: [0.0; 2] };
    Zip::indexed(&mut out).for_each(|(row, col), rate| {
        let step = motion.step_at(row, col, shape);
        *rate = repeat.map_or(step, |frames| (step * frames).round_ties_even() / frames);
    });
}

/// Phases displaced by a motion, reduced to [-1/2, 1/2).
pub fn advance_phase(mut out: ArrayViewMut2<'_, f64>, phase: ArrayView2<'_, f64>, motion: Motion) {
    let shape = out.dim();
    Zip::indexed(&mut out).and(phase).for_each(|(row, col), out, &phase| {
        *out = reduce(phase + motion.step_at(row, col, shape));
    });
}
