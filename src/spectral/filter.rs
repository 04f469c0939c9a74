//! What the sampling in time does to a wave: aliasing and the shutter (Langer 2004, section 5.5).

use ndarray::{ArrayView2, ArrayViewMut2, Zip};

use super::band::Sum;
use super::tent::Motion;
use crate::base::error::{Error, finite, named};
use crate::base::normal::{least, most};
use crate::base::simd::multiply_add;

/// Places that a loop advances by: one AVX-512 register of float64.
pub const LANES: usize = 8;

/// A rate of half a cycle per frame has no direction, so it counts as aliased; the margin keeps
/// rounding from deciding for waves that lie exactly on it.
const NYQUIST: f64 = 0.5 - 1e-12;

/// What becomes of waves that turn half a cycle per frame or more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alias {
    /// They stay, and seem to run backwards.
    Keep,
    /// They are dropped (the paper).
    Cut,
    /// They fade out below the limit, so that nothing pops when the speed varies.
    Soft,
}

impl Alias {
    pub fn named(name: &str) -> Result<Self, Error> {
        named("alias", name, &[("keep", Self::Keep), ("cut", Self::Cut), ("soft", Self::Soft)])
    }
}

/// The gain of a wave as a function of its rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TemporalFilter {
    pub alias: Alias,
    /// Where the soft law starts, cycles per frame.
    pub soft_from: f64,
    /// Exposure in frames, centred on the frame's time; 0 is an instant.
    pub shutter: f64,
}

impl TemporalFilter {
    pub fn checked(self) -> Result<Self, Error> {
        finite("soft_from", self.soft_from)?;
        finite("shutter", self.shutter)?;
        if !(0.0..0.5).contains(&self.soft_from) {
            let message = format!("must be at least 0 and below 0.5, got {}", self.soft_from);
            return Err(Error::invalid("soft_from", message));
        }
        if self.shutter < 0.0 {
            let message = format!("must be at least 0 frames, got {}", self.shutter);
            return Err(Error::invalid("shutter", message));
        }
        Ok(self)
    }

    /// The factor of the alias law for a rate in cycles per frame.
    #[inline]
    pub fn alias_gain(&self, rate: f64) -> f64 {
        let speed = rate.abs();
        match self.alias {
            Alias::Keep => 1.0,
            _ if speed >= NYQUIST => 0.0,
            Alias::Soft if speed > self.soft_from => {
                let part = (speed - self.soft_from) / (0.5 - self.soft_from);
                libm::cos(std::f64::consts::FRAC_PI_2 * part).powi(2)
            }
            _ => 1.0,
        }
    }

    /// The mean of a wave over the exposure: sin(pi x) / (pi x), negative lobes kept.
    #[inline]
    pub fn shutter_gain(&self, rate: f64) -> f64 {
        let angle = std::f64::consts::PI * rate * self.shutter;
        // The series keeps the value 1 - angle^2/6 where the quotient would be 0/0.
        if angle.abs() < 1e-4 { 1.0 - angle * angle / 6.0 } else { libm::sin(angle) / angle }
    }

    #[inline]
    pub fn gain(&self, rate: f64) -> f64 {
        let kept = self.alias_gain(rate);
        if self.shutter == 0.0 || kept == 0.0 { kept } else { kept * self.shutter_gain(rate) }
    }
}

/// Rates to the factors of the filter, in place: [`TemporalFilter::gain`] on lanes.
#[inline(always)]
pub fn fill_gains<const LEVEL: u8>(filter: TemporalFilter, values: &mut [f64]) {
    // Polynomials cover what a usual shutter sees; beyond that each wave takes the exact way.
    let reach = reach(values);
    if filter.shutter * if filter.alias == Alias::Keep { reach } else { 0.5 } > 0.5 {
        values.iter_mut().for_each(|value| *value = filter.gain(*value));
        return;
    }
    let fades = match filter.alias {
        Alias::Soft => reach > filter.soft_from,
        Alias::Cut => true,
        Alias::Keep => false,
    };
    if filter.shutter == 0.0 && !fades {
        values.fill(1.0);
    } else if !fades {
        for value in values {
            *value = short_sinc::<LEVEL>(*value * filter.shutter);
        }
    } else {
        // The cut fades within nothing.
        let soft = filter.alias == Alias::Soft;
        let (from, by) =
            if soft { (filter.soft_from, 0.5 / (0.5 - filter.soft_from)) } else { (0.5, 0.0) };
        for value in values {
            let speed = value.abs();
            // cos(pi x), to 1e-15.
            let fade = series::<12, LEVEL>(least(most(speed - from, 0.0) * by, 0.5), 0);
            let kept = if speed < NYQUIST { fade * fade } else { 0.0 };
            // An aliased rate has gain 0 already, but its polynomial must not be infinite.
            *value = kept * short_sinc::<LEVEL>(least(speed * filter.shutter, 0.5));
        }
    }
}

/// The largest of some rates, whatever their sign. Of each lane first: one after the other they would
/// wait for each other.
#[inline(always)]
fn reach(values: &[f64]) -> f64 {
    let mut reach = [0.0_f64; 4 * LANES];
    let lanes = values.chunks_exact(reach.len());
    let rest = lanes.remainder().iter().fold(0.0, |reach, rate| most(rate.abs(), reach));
    for rates in lanes {
        for i in 0..reach.len() {
            reach[i] = most(rates[i].abs(), reach[i]);
        }
    }
    reach.into_iter().fold(rest, most)
}

/// sin(pi x) / (pi x) for |x| <= 1/2, to 1e-15.
#[inline(always)]
fn short_sinc<const LEVEL: u8>(x: f64) -> f64 {
    series::<10, LEVEL>(x, 1)
}

/// 1 - s / ((1 + o)(2 + o)) + s^2 / ((1 + o) .. (4 + o)) - ..., s = (pi x)^2.
#[inline(always)]
fn series<const TERMS: usize, const LEVEL: u8>(x: f64, offset: usize) -> f64 {
    let square = (std::f64::consts::PI * x) * (std::f64::consts::PI * x);
    let mut c = [1.0; TERMS];
    for n in 1..TERMS {
        c[n] = -c[n - 1] / ((2 * n - 1 + offset) * (2 * n + offset)) as f64;
    }
    let mut sum = c[TERMS - 1];
    for n in (0..TERMS - 1).rev() {
        sum = multiply_add::<f64, LEVEL>(sum, square, c[n]);
    }
    sum
}

/// Amplitudes after the alias law and the shutter, both on the total rate.
///
/// `renormalise` restores the power that the alias law took, before the shutter: blur then lowers
/// the contrast, as it does for real flakes. Nothing kept gives zeros.
pub fn temporal_filter(
    mut out: ArrayViewMut2<'_, f64>,
    amplitude: ArrayView2<'_, f64>,
    velocity: Motion,
    filter: TemporalFilter,
    renormalise: bool,
) -> Result<(), Error> {
    let filter = filter.checked()?;
    let shape = out.dim();
    let (mut before, mut after) = (Sum::default(), Sum::default());
    Zip::indexed(&mut out).and(amplitude).for_each(|(row, col), out, &amplitude| {
        *out = amplitude * filter.alias_gain(velocity.step_at(row, col, shape));
        before.add(amplitude * amplitude);
        after.add(*out * *out);
    });
    let restored = match after.value() {
        power if renormalise && power > 0.0 => (before.value() / power).sqrt(),
        _ => 1.0,
    };
    Zip::indexed(&mut out).for_each(|(row, col), out| {
        *out *= restored * filter.shutter_gain(velocity.step_at(row, col, shape));
    });
    Ok(())
}
