//! The field as an opacity (Langer 2004, section 5.6).

use crate::base::error::{Error, finite};
use crate::base::normal::{least, most};
use crate::base::real::Real;
use crate::base::simd::{dispatch, reproducible};

#[derive(Debug, Clone, Copy)]
pub enum Lifted<'l, T> {
    None,
    /// The same everywhere.
    All(T),
    /// A value for each pixel of the block, row by row.
    Each(&'l [T]),
}

/// A rectangle of the field and where its opacity goes; each row begins `stride` values after the last.
pub struct Block<'f, 'o, T> {
    pub rows: usize,
    pub cols: usize,
    pub field: (&'f [T], usize),
    pub out: (&'o mut [T], usize),
}

impl<T: Real> Block<'_, '_, T> {
    pub fn copy(self) {
        let field = self.field.0.chunks(self.field.1);
        for (out, field) in self.out.0.chunks_mut(self.out.1).zip(field).take(self.rows) {
            out[..self.cols].copy_from_slice(&field[..self.cols]);
        }
    }

    fn out_rows(&mut self) -> impl Iterator<Item = &mut [T]> {
        let cols = self.cols;
        self.out.0.chunks_mut(self.out.1).take(self.rows).map(move |row| &mut row[..cols])
    }
}

/// The map with a power of 1, or of 2 where `square`; lifted by the same everywhere.
#[dispatch]
fn map_block<const LEVEL: u8, T: Real>(
    map: Opacity,
    square: bool,
    lift: Option<T>,
    block: &mut Block<'_, '_, T>,
) {
    // A vanishing spread is a threshold: the largest factor, since infinity times 0 is NaN.
    let scale = T::of((0.5 / map.spread).min(T::max_value().wide()));
    let (mean, amount) = (T::of(map.mean), T::of(map.amount));
    let (zero, one, lifted) = (T::zero(), T::one(), lift.is_some());
    let lift = amount * lift.unwrap_or(zero);
    let (field, cols) = (block.field.0.chunks(block.field.1), block.cols);
    for (out, field) in block.out_rows().zip(field) {
        for (out, &z) in out.iter_mut().zip(&field[..cols]) {
            let base = least(most(mean + z * scale, zero), one);
            let value = amount * if square { base * base } else { base };
            *out = if lifted { least(most(value + lift, zero), amount) } else { value };
        }
    }
}

#[dispatch]
fn lift_block<const LEVEL: u8, T: Real>(
    amount: T,
    lifted: Lifted<'_, T>,
    block: &mut Block<'_, '_, T>,
) {
    // A map with a power up to 1 gains mean by blur: what is added can be below 0.
    let add = |value: T, lift: T| (value + amount * lift).max(T::zero()).min(amount);
    let cols = block.cols;
    match lifted {
        Lifted::None => {}
        Lifted::All(lift) => {
            block.out_rows().flatten().for_each(|value| *value = add(*value, lift));
        }
        Lifted::Each(lift) => {
            for (out, lift) in block.out_rows().zip(lift.chunks_exact(cols)) {
                for (value, &lift) in out.iter_mut().zip(lift) {
                    *value = add(*value, lift);
                }
            }
        }
    }
}

/// `amount * clip(mean + z / (2 spread), 0, 1) ** power` for a field of variance 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Opacity {
    /// Where the field's zero goes.
    pub mean: f64,
    /// How many standard deviations the interval [0, 1] holds on each side of 1/2.
    pub spread: f64,
    /// The exponent of the map; the paper squares.
    pub power: f64,
    /// Factor at the end, 0 to 1.
    pub amount: f64,
}

impl Opacity {
    /// Refuses values outside their ranges. `power` is the exponent's name in the call.
    pub fn checked(self, power: &'static str) -> Result<Self, Error> {
        finite("mean", self.mean)?;
        finite("spread", self.spread)?;
        finite(power, self.power)?;
        finite("amount", self.amount)?;
        if self.spread <= 0.0 {
            return Err(Error::invalid("spread", format!("must be above 0, got {}", self.spread)));
        }
        if self.power <= 0.0 {
            return Err(Error::invalid(power, format!("must be above 0, got {}", self.power)));
        }
        if !(0.0..=1.0).contains(&self.amount) {
            let message = format!("must be from 0 to 1, got {}", self.amount);
            return Err(Error::invalid("amount", message));
        }
        Ok(self)
    }

    /// Maps a block; what is lifted is added before the amount and the upper clip (see
    /// [`Self::mean_of`]).
    pub fn map_block<T: Real>(&self, mut block: Block<'_, '_, T>, mut lifted: Lifted<'_, T>) {
        // The two powers that people use avoid the general one, which costs ten times as much, and are
        // lifted on the way where it is by the same everywhere.
        if self.power == 2.0 || self.power == 1.0 {
            let lift = if let Lifted::All(lift) = lifted { Some(lift) } else { None };
            if lift.is_some() {
                lifted = Lifted::None;
            }
            map_block(*self, self.power == 2.0, lift, &mut block);
        } else {
            map_block(Self { amount: 1.0, ..*self }, false, None, &mut block);
            let (power, amount) = (T::of(self.power), T::of(self.amount));
            let plain = reproducible();
            let raised = |value: T| {
                if plain { T::of(libm::pow(value.wide(), self.power)) } else { value.powf(power) }
            };
            for value in block.out_rows().flatten() {
                *value = amount * raised(*value);
            }
        }
        if !matches!(lifted, Lifted::None) {
            lift_block(T::of(self.amount), lifted, &mut block);
        }
    }

    /// Mean of the map before `amount`, for a Gaussian field of the given variance.
    ///
    /// `E = integral_0^1 u^p gauss(u) du + P(u > 1)`, u of mean `mean` and deviation
    /// sqrt(variance) / (2 spread). Blurring the field and squaring is not blurring the opacity: the
    /// mean falls, and what it falls by is the difference of two of these. Without clipping and with
    /// p = 2 the difference is sigma^2 (1 - kept power).
    pub fn mean_of(&self, variance: f64) -> f64 {
        let deviation = variance.max(0.0).sqrt() / (2.0 * self.spread);
        if deviation < 1e-9 {
            return libm::pow(self.mean.clamp(0.0, 1.0), self.power);
        }
        if self.power == 2.0 {
            return self.mean_of_square(deviation);
        }
        let z = |u: f64| (u - self.mean) / deviation;
        let above = 0.5 * libm::erfc(z(1.0) * std::f64::consts::FRAC_1_SQRT_2);
        let (low, high) = (z(0.0).max(-9.0), z(1.0).min(9.0));
        if low >= high {
            return above;
        }
        // Simpson's rule; the integrand is smooth between the clips.
        const INTERVALS: usize = 128;
        let step = (high - low) / INTERVALS as f64;
        let inside = (0..=INTERVALS)
            .map(|i| {
                let g = low + step * i as f64;
                let weight =
                    if i == 0 || i == INTERVALS { 1.0 } else { 2.0 + 2.0 * (i % 2) as f64 };
                let u = (self.mean + deviation * g).clamp(0.0, 1.0);
                weight * libm::pow(u, self.power) * libm::exp(-0.5 * g * g)
            })
            .sum::<f64>();
        above + inside * step / 3.0 / (2.0 * std::f64::consts::PI).sqrt()
    }

    /// The integral for p = 2 in closed form, by parts.
    fn mean_of_square(&self, s: f64) -> f64 {
        let m = self.mean;
        let (a, b) = (-m / s, (1.0 - m) / s);
        let above = |x: f64| 0.5 * libm::erfc(x * std::f64::consts::FRAC_1_SQRT_2);
        let density = |x: f64| libm::exp(-0.5 * x * x) / (2.0 * std::f64::consts::PI).sqrt();
        let inside = above(a) - above(b);
        // m + s a = 0 at the lower clip, m + s b = 1 at the upper.
        let edges = m * density(a) - (m + 1.0) * density(b);
        ((m * m + s * s) * inside + s * edges + above(b)).max(0.0)
    }
}
