//! By how much a sheet's flakes must be stronger for a layer to take a mean optical depth.

use super::layers::LANES;
use super::sheet::Sheet;
use crate::base::error::{Cancel, Error, collected};
use crate::base::pool;

impl Sheet {
    /// The factor with which the sheet takes a mean optical depth, where `even` goes with it and flakes are `spread` times
    /// stronger; 0 of one without flakes.
    pub fn factor(&self, wanted: f64, gain: [f64; 2], cancel: &Cancel) -> Result<f64, Error> {
        let [spread, even] = gain;
        let place = self.place(0, cancel)?;
        let shares = pool::kept(&self.shares, || shares(&place[..place.len() - LANES]))?;
        let unit = spread * f64::from(self.stamps.unit);
        // Polynomials of what a step leaves, in four parts: a sum would wait for each of its steps.
        let taken = |factor: f64| {
            let (step, mut parts) = (libm::exp(-factor * unit), [[0.0; 2]; 4]);
            let four = (step * step) * (step * step);
            for (byte, share) in shares.iter().enumerate().rev() {
                let [sum, slope] = parts[byte % 4];
                parts[byte % 4] = [sum * four + share, slope * four + share * byte as f64];
            }
            let sum = |one: usize| parts.iter().rev().fold(0.0, |sum, part| sum * step + part[one]);
            let (left, slope) = (sum(0), sum(1));
            (factor * even - libm::log(left), even + unit * slope / left)
        };
        let rise = taken(0.0).1;
        if rise == 0.0 {
            return Ok(0.0);
        }
        // It rises ever less, so that Newton's steps come from below; three are usual.
        let (mut factor, most) = (wanted / rise, 8.0 * wanted / rise);
        for _ in 0..30 {
            let (sum, slope) = taken(factor);
            let step = (wanted - sum) / slope;
            factor = (factor + step).min(most);
            if step.abs() <= 1e-4 * factor {
                break;
            }
        }
        Ok(factor)
    }
}

/// The shares of bytes, up to the last that is there.
fn shares(bytes: &[u8]) -> Result<Vec<f64>, Error> {
    // In turns: a count that follows the same one would wait for it.
    let mut counts = [[0_u32; 256]; 4];
    for four in bytes.chunks(4) {
        four.iter().zip(&mut counts).for_each(|(&byte, own)| own[usize::from(byte)] += 1);
    }
    let share = |byte: usize| counts.iter().map(|own| own[byte]).sum::<u32>();
    let many = (0..256).rposition(|byte| share(byte) > 0).map_or(1, |last| last + 1);
    collected((0..many).map(|byte| f64::from(share(byte)) / bytes.len() as f64))
}
