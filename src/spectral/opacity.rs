//! The field as an opacity (Langer 2004, section 5.6).

use crate::error::{Error, finite};
use crate::real::Real;
use crate::simd::{dispatch, reproducible};

#[inline(always)]
fn map_with<T: Real, const SQUARE: bool>(map: Opacity, field: &[T], out: &mut [T]) {
    // A vanishing spread is a threshold: the largest factor, since infinity times 0 is NaN.
    let scale = T::of((0.5 / map.spread).min(T::max_value().wide()));
    let (mean, amount) = (T::of(map.mean), T::of(map.amount));
    let n = out.len();
    let field = &field[..n];
    for i in 0..n {
        let base = (mean + field[i] * scale).max(T::zero()).min(T::one());
        out[i] = amount * if SQUARE { base * base } else { base };
    }
}

#[inline(always)]
fn map_square_with<T: Real, const LEVEL: u8>(map: Opacity, field: &[T], out: &mut [T]) {
    map_with::<T, true>(map, field, out);
}

#[inline(always)]
fn map_plain_with<T: Real, const LEVEL: u8>(map: Opacity, field: &[T], out: &mut [T]) {
    map_with::<T, false>(map, field, out);
}

#[inline(always)]
fn lift_with<T: Real, const LEVEL: u8>(amount: T, lift: &[T], out: &mut [T]) {
    let n = out.len();
    let lift = &lift[..n];
    for i in 0..n {
        // A map with a power up to 1 gains mean by blur: what is added can be below 0.
        out[i] = (out[i] + amount * lift[i]).max(T::zero()).min(amount);
    }
}

dispatch! {
    fn map_square<T: Real>(map: Opacity, field: &[T], out: &mut [T]) = map_square_with
}
dispatch! {
    fn map_plain<T: Real>(map: Opacity, field: &[T], out: &mut [T]) = map_plain_with
}
dispatch! {
    fn lift_row<T: Real>(amount: T, lift: &[T], out: &mut [T]) = lift_with
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

    /// Maps a row; `lift` is added before the amount and the upper clip (see [`Self::mean_of`]).
    pub fn map_row<T: Real>(&self, field: &[T], lift: Option<&[T]>, out: &mut [T]) {
        // The two powers that people use avoid the general one, which costs ten times as much.
        if self.power == 2.0 {
            map_square(*self, field, out);
        } else if self.power == 1.0 {
            map_plain(*self, field, out);
        } else {
            map_plain(Self { amount: 1.0, ..*self }, field, out);
            let (power, amount) = (T::of(self.power), T::of(self.amount));
            if reproducible() {
                let wide = |value: T| T::of(libm::pow(value.wide(), self.power));
                out.iter_mut().for_each(|value| *value = amount * wide(*value));
            } else {
                out.iter_mut().for_each(|value| *value = amount * value.powf(power));
            }
        }
        if let Some(lift) = lift {
            lift_row(T::of(self.amount), lift, out);
        }
    }

    /// Mean of the map before `amount`, for a Gaussian field of the given variance.
    ///
    /// `E = integral_0^1 u^p gauss(u) du + P(u > 1)`, u of mean `mean` and deviation
    /// sqrt(variance) / (2 spread). Blurring the field and squaring is not blurring the opacity: the
    /// mean falls, and what it falls by is the difference of two of these. Without clipping and with
    /// p = 2 the difference is sigma^2 (1 - kept power), the form in the specification.
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
}

impl Opacity {
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

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: Opacity = Opacity { mean: 0.5, spread: 3.0, power: 2.0, amount: 1.0 };

    #[test]
    fn the_mean_of_the_paper_map_is_known() {
        // 1/4 + sigma^2 less the clipped tails.
        assert!((PAPER.mean_of(1.0) - 0.277_64).abs() < 2e-5, "{}", PAPER.mean_of(1.0));
        assert!((PAPER.mean_of(0.0) - 0.25).abs() < 1e-12);
        let wide = Opacity { spread: 30.0, ..PAPER };
        assert!((wide.mean_of(0.3) - (0.25 + 0.3 / 3600.0)).abs() < 1e-9);
    }

    #[test]
    fn the_closed_form_is_the_integral() {
        for mean in [-0.3, 0.05, 0.5, 1.2] {
            for spread in [1.0, 2.0, 3.0, 30.0] {
                for variance in [0.01, 0.5, 1.0] {
                    let square = Opacity { mean, spread, ..PAPER };
                    // A power next to 2 takes the quadrature.
                    let near = Opacity { power: 2.0 + 1e-12, ..square };
                    let difference = square.mean_of(variance) - near.mean_of(variance);
                    assert!(difference.abs() < 2e-7, "{square:?} {variance}: {difference:e}");
                }
            }
        }
    }

    #[test]
    fn values_are_clipped_to_the_interval() {
        let mut out = [0.0; 3];
        PAPER.map_row(&[-10.0, 0.0, 10.0], None, &mut out);
        assert_eq!(out, [0.0, 0.25, 1.0]);
        PAPER.map_row(&[-10.0, 0.0, 10.0], Some(&[-1e-9, 0.25, 0.5]), &mut out);
        assert_eq!(out, [0.0, 0.5, 1.0]);
    }
}
