//! The spectrum of one tile: every wave's phase, reduced, and its amplitude after the filter.
//!
//! Waves stand in parallel arrays, so that one loop without branches does them all on vector lanes.

use super::filter::{Alias, TemporalFilter};
use super::tent::Motion;
use super::waves::{Draw, Waves};
use crate::error::{Error, collected, zeroed};
use crate::random::mix64;
use crate::real::Real;
use crate::simd::dispatch;

/// The waves of a band as parallel arrays.
pub struct Lanes {
    /// Signed indices.
    ky: Vec<i64>,
    kx: Vec<i64>,
    /// Unit vectors of the tent.
    tent_y: Vec<f64>,
    tent_x: Vec<f64>,
    /// Cycles per pixel.
    frequency_y: Vec<f64>,
    frequency_x: Vec<f64>,
    /// Cycles that the transform's sampling takes from each phase.
    offset: Vec<f64>,
    amplitude: Vec<f64>,
    wavelength: Vec<f64>,
    ring: Vec<usize>,
}

/// Buffers that [`Lanes::spectrum`] fills: one value for each wave.
pub struct Values<T> {
    /// Real part of each leader's bin.
    pub re: Vec<T>,
    /// Imaginary part.
    pub im: Vec<T>,
    phase: Vec<f64>,
    rate: Vec<f64>,
    gain: Vec<f64>,
    tent: (Vec<f64>, Vec<f64>),
}

/// What a tile is asked for. Slices have one entry per ring.
#[derive(Clone, Copy)]
pub struct TileMotion<'a> {
    /// Displacements since time 0.
    pub place: &'a [Motion],
    /// Displacements per frame.
    pub rate: &'a [Motion],
    /// What sampling in time does.
    pub filter: TemporalFilter,
    /// Waves up to this wavelength are left out (a depth limit); 0 leaves out none.
    pub shortest: f64,
}

/// Power of the waves of a tile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Power {
    /// Of the waves within the depth limit.
    pub present: f64,
    /// What the filter kept of it.
    pub kept: f64,
}

impl Lanes {
    /// The arrays of a list of waves; `offset` is the phase that the transform wants taken off.
    pub fn new(waves: &Waves, offset: impl Fn(i64, i64) -> f64) -> Result<Self, Error> {
        let list = &waves.list;
        let each = |value: &dyn Fn(&super::waves::Wave) -> f64| collected(list.iter().map(value));
        Ok(Self {
            ky: collected(list.iter().map(|wave| wave.ky))?,
            kx: collected(list.iter().map(|wave| wave.kx))?,
            tent_y: each(&|wave| wave.direction.0)?,
            tent_x: each(&|wave| wave.direction.1)?,
            frequency_y: each(&|wave| wave.frequency.0)?,
            frequency_x: each(&|wave| wave.frequency.1)?,
            offset: each(&|wave| offset(wave.ky, wave.kx))?,
            amplitude: each(&|wave| wave.amplitude)?,
            wavelength: each(&|wave| wave.wavelength)?,
            ring: collected(list.iter().map(|wave| wave.ring))?,
        })
    }

    /// Buffers for these waves.
    pub fn values<T: Real>(&self) -> Result<Values<T>, Error> {
        let n = self.ky.len();
        Ok(Values {
            re: zeroed(n)?,
            im: zeroed(n)?,
            phase: zeroed(n)?,
            rate: zeroed(n)?,
            gain: zeroed(n)?,
            tent: (zeroed(n)?, zeroed(n)?),
        })
    }

    /// Fills `values.re` and `values.im` with each leader's bin of a tile.
    pub fn spectrum<T: Real>(
        &self,
        tile: (usize, usize),
        draw: Draw,
        motion: TileMotion<'_>,
        values: &mut Values<T>,
    ) -> Power {
        let (mut tent_y, mut tent_x) = (&self.tent_y[..], &self.tent_x[..]);
        if draw.jitter {
            for i in 0..self.ky.len() {
                let (y, x) = draw.direction(self.ky[i], self.kx[i], tile);
                values.tent.0[i] = y;
                values.tent.1[i] = x;
            }
            (tent_y, tent_x) = (&values.tent.0, &values.tent.1);
        }
        let steps = |motions: &[Motion], out: &mut [f64]| match motions {
            [one] => {
                step_lanes(*one, tent_y, tent_x, &self.frequency_y, &self.frequency_x, out);
            }
            rings => {
                for (i, out) in out.iter_mut().enumerate() {
                    let frequency = (self.frequency_y[i], self.frequency_x[i]);
                    *out = rings[self.ring[i]].step((tent_y[i], tent_x[i]), frequency);
                }
            }
        };
        steps(motion.place, &mut values.phase);
        let mut power = Power { present: 1.0, kept: 1.0 };
        let plain = motion.filter.is_open() && motion.shortest <= 0.0;
        if plain {
            values.gain.copy_from_slice(&self.amplitude);
        } else {
            steps(motion.rate, &mut values.rate);
            power = self.gains(motion, &values.rate, &mut values.gain);
        }
        bins::<T>(
            draw.bits(),
            &self.ky,
            &self.kx,
            &values.phase,
            &self.offset,
            &values.gain,
            &mut values.re,
            &mut values.im,
        );
        power
    }

    /// Amplitudes after the filter and the depth limit.
    fn gains(&self, motion: TileMotion<'_>, rate: &[f64], gain: &mut [f64]) -> Power {
        gain_lanes(motion.filter, rate, gain);
        let mut power = Power { present: 0.0, kept: 0.0 };
        for (i, gain) in gain.iter_mut().enumerate() {
            if self.wavelength[i] <= motion.shortest {
                *gain = 0.0;
                continue;
            }
            let amplitude = self.amplitude[i];
            power.present += 2.0 * amplitude * amplitude;
            *gain *= amplitude;
            power.kept += 2.0 * *gain * *gain;
        }
        power
    }
}

#[inline(always)]
fn step_lanes_with<const LEVEL: u8>(
    motion: Motion,
    tent_y: &[f64],
    tent_x: &[f64],
    frequency_y: &[f64],
    frequency_x: &[f64],
    out: &mut [f64],
) {
    let tent = tent_y.iter().zip(tent_x);
    let frequency = frequency_y.iter().zip(frequency_x);
    for ((out, (&ty, &tx)), (&fy, &fx)) in out.iter_mut().zip(tent).zip(frequency) {
        *out = motion.step((ty, tx), (fy, fx));
    }
}

#[inline(always)]
fn gain_lanes_with<const LEVEL: u8>(filter: TemporalFilter, rate: &[f64], gain: &mut [f64]) {
    // Polynomials cover what a usual shutter sees; beyond that each wave takes the exact way.
    let reach = rate.iter().fold(0.0_f64, |most, r| most.max(r.abs()));
    if filter.shutter * if filter.alias == Alias::Keep { reach } else { 0.5 } > 0.5 {
        for (gain, &rate) in gain.iter_mut().zip(rate) {
            *gain = filter.gain(rate);
        }
        return;
    }
    match filter.alias {
        Alias::Soft if reach > filter.soft_from => {
            for (gain, &rate) in gain.iter_mut().zip(rate) {
                *gain = filter.alias_gain(rate);
            }
        }
        Alias::Cut => {
            for (gain, &rate) in gain.iter_mut().zip(rate) {
                *gain = filter.alias_gain(rate);
            }
        }
        _ => gain.fill(1.0),
    }
    if filter.shutter > 0.0 {
        for (gain, &rate) in gain.iter_mut().zip(rate) {
            // An aliased rate has gain 0 already, but its polynomial must not be infinite.
            let turns = (rate * filter.shutter).abs().min(0.5);
            *gain *= short_sinc(turns);
        }
    }
}

/// sin(pi x) / (pi x) for |x| <= 1/2, to 1e-15.
#[inline(always)]
fn short_sinc(x: f64) -> f64 {
    let square = (std::f64::consts::PI * x) * (std::f64::consts::PI * x);
    // 1 - s/6 + s^2/120 - ...: each coefficient is the last one over -(2n)(2n + 1).
    const C: [f64; 10] = {
        let mut c = [1.0; 10];
        let mut n = 1;
        while n < 10 {
            c[n] = -c[n - 1] / ((2 * n) * (2 * n + 1)) as f64;
            n += 1;
        }
        c
    };
    let mut sum = C[9];
    let mut n = 9;
    while n > 0 {
        n -= 1;
        sum = sum * square + C[n];
    }
    sum
}

/// Bins from phases: hash, add, reduce, turn, scale.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "parallel arrays, one by one")]
fn bins_with<T: Real, const LEVEL: u8>(
    tile: u64,
    ky: &[i64],
    kx: &[i64],
    phase: &[f64],
    offset: &[f64],
    gain: &[f64],
    re: &mut [T],
    im: &mut [T],
) {
    let n = re.len();
    let (ky, kx, phase) = (&ky[..n], &kx[..n], &phase[..n]);
    let (offset, gain, im) = (&offset[..n], &gain[..n], &mut im[..n]);
    for i in 0..n {
        let hash = mix64(mix64(tile ^ ky[i] as u64) ^ kx[i] as u64);
        // 52 of the hash's bits as the fraction of a number in [1, 2): the 53rd is below any pixel's
        // precision, and this conversion has a vector form everywhere.
        let turns = f64::from_bits((hash >> 12) | 0x3FF0_0000_0000_0000) + (phase[i] - offset[i]);
        let turn = T::turn(turns - turns.round_ties_even());
        re[i] = turn.re * T::of(gain[i]);
        im[i] = turn.im * T::of(gain[i]);
    }
}

dispatch! {
    fn step_lanes(
        motion: Motion,
        tent_y: &[f64],
        tent_x: &[f64],
        frequency_y: &[f64],
        frequency_x: &[f64],
        out: &mut [f64],
    ) = step_lanes_with
}

dispatch! {
    fn gain_lanes(filter: TemporalFilter, rate: &[f64], gain: &mut [f64]) = gain_lanes_with
}

dispatch! {
    fn bins<T: Real>(
        tile: u64,
        ky: &[i64],
        kx: &[i64],
        phase: &[f64],
        offset: &[f64],
        gain: &[f64],
        re: &mut [T],
        im: &mut [T],
    ) = bins_with
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_short_sinc_is_the_sinc() {
        for i in 1..=500 {
            let x = f64::from(i) / 1000.0;
            let angle = std::f64::consts::PI * x;
            assert!((short_sinc(x) - angle.sin() / angle).abs() < 1e-15, "{x}");
        }
        assert_eq!(short_sinc(0.0), 1.0);
    }
}
