//! What a shutter leaves of a wave: sinc(u) = sin(pi u) / (pi u), u the cycles that it moves by.
//!
//! u = a across + b down, so that the sine of the whole is made of those of the parts, and a tile needs
//! tables of these only. The waves b and -b share a division.

use crate::base::aligned::Aligned;
use crate::base::error::Error;
use crate::base::real::Real;
use crate::base::simd::multiply_add;

/// Cycles up to which a series is taken: the quotient of small numbers would lose digits.
const NEAR: f64 = 0.0625;

/// Streaks beyond it, in tiles, leave nothing; products of two stay finite.
const MOST: f64 = 1e12;

/// Cycles, whole ones taken off.
#[inline(always)]
fn reduced(cycles: f64) -> f64 {
    cycles - cycles.round_ties_even()
}

/// Writes exp(2 pi i k cycles) * gain for k = 0, 1, ..
#[inline(always)]
pub fn turns<T: Real, const LEVEL: u8>(cos: &mut [T], sin: &mut [T], cycles: f64, gain: T) {
    let cycles = reduced(cycles);
    for (k, (cos, sin)) in cos.iter_mut().zip(sin).enumerate() {
        let turn = T::turn::<LEVEL>(T::of(reduced(k as f64 * cycles)));
        *cos = gain * turn.re;
        *sin = gain * turn.im;
    }
}

pub struct Blur<T> {
    /// 0, 1, 2, ..
    index: Aligned<T>,
    /// Of each term: cosines and sines of pi a across, and of pi b down.
    across: Aligned<T>,
    down: Aligned<T>,
    /// Of each term the cycles of a = 1 and of b = 1.
    steps: Vec<[f64; 2]>,
    /// Of each term for one b: half the sum of what is left of the waves b and -b, then half the
    /// difference.
    pub rows: Aligned<T>,
}

impl<T: Real> Blur<T> {
    /// For at most so many terms.
    pub fn new(stride: usize, half: usize, terms: usize) -> Result<Self, Error> {
        let mut index = Aligned::zeroed(stride)?;
        for (a, index) in index.iter_mut().enumerate() {
            *index = T::of(a as f64);
        }
        Ok(Self {
            index,
            across: Aligned::zeroed(2 * stride * terms)?,
            down: Aligned::zeroed(2 * half * terms)?,
            steps: vec![[0.0; 2]; terms],
            rows: Aligned::zeroed(2 * stride * terms)?,
        })
    }

    #[inline(always)]
    pub fn begin<const LEVEL: u8>(
        &mut self,
        i: usize,
        steps: [f64; 2],
        (stride, half): (usize, usize),
    ) {
        // Shorter along the same way.
        let longest = steps[0].abs().max(steps[1].abs());
        let steps = steps.map(|step| step * (MOST / longest).min(1.0));
        self.steps[i] = steps;
        let (cos, sin) = self.across[2 * stride * i..][..2 * stride].split_at_mut(stride);
        turns::<T, LEVEL>(cos, sin, 0.5 * steps[0], T::one());
        let (cos, sin) = self.down[2 * half * i..][..2 * half].split_at_mut(half);
        turns::<T, LEVEL>(cos, sin, 0.5 * steps[1], T::one());
    }

    #[inline(always)]
    pub fn row<const LEVEL: u8>(&mut self, b: usize, terms: usize, (stride, half): (usize, usize)) {
        let index = &self.index[..stride];
        for i in 0..terms {
            let across = &self.across[2 * stride * i..][..2 * stride];
            let (cos, sin) = across.split_at(stride);
            let down = &self.down[2 * half * i..][..2 * half];
            let (cos_down, sin_down) = (down[b], down[half + b]);
            let (step, less_step) = long::<T>(self.steps[i][0]);
            let (along, less_along) = long::<T>(b as f64 * self.steps[i][1]);
            let rows = &mut self.rows[2 * stride * i..][..2 * stride];
            let (sums, differences) = rows.split_at_mut(stride);
            for a in 0..stride {
                // Long numbers: where the parts nearly cancel, their difference keeps its digits.
                let (long, short) = (index[a] * step, index[a] * less_step);
                let u = (long + along) + (short + less_along);
                let v = (long - along) + (short - less_along);
                let (x, y) = (sin[a] * cos_down, cos[a] * sin_down);
                let (up, back) = both::<T, LEVEL>((u, x + y), (v, x - y));
                sums[a] = T::of(0.5) * (up + back);
                differences[a] = T::of(0.5) * (up - back);
            }
        }
    }
}

/// A number as two: the first has so few digits that its product with an index is exact.
fn long<T: Real>(value: f64) -> (T, T) {
    let short = if size_of::<T>() == 4 { 40 } else { 13 };
    let first = f64::from_bits(value.to_bits() >> short << short);
    (T::of(first), T::of(value - first))
}

/// sinc of two numbers, each given with the sine of pi times it.
#[inline(always)]
fn both<T: Real, const LEVEL: u8>((u, sin_u): (T, T), (v, sin_v): (T, T)) -> (T, T) {
    let near = T::of(NEAR);
    let (small_u, small_v) = (u.abs() < near, v.abs() < near);
    let divisor_u = if small_u { T::one() } else { u };
    let divisor_v = if small_v { T::one() } else { v };
    let inverse = T::of(std::f64::consts::FRAC_1_PI) / (divisor_u * divisor_v);
    let far_u = sin_u * (divisor_v * inverse);
    let far_v = sin_v * (divisor_u * inverse);
    (
        if small_u { series::<T, LEVEL>(u) } else { far_u },
        if small_v { series::<T, LEVEL>(v) } else { far_v },
    )
}

/// sinc of a number up to NEAR: five terms are right to 2e-15 there, three to 1e-8.
#[inline(always)]
fn series<T: Real, const LEVEL: u8>(u: T) -> T {
    let x = T::of(-std::f64::consts::PI * std::f64::consts::PI) * u * u;
    let add = |sum: T, term: f64| multiply_add::<T, LEVEL>(sum, x, T::of(1.0 / term));
    let sum = T::of(1.0 / 120.0);
    let sum =
        if size_of::<T>() == 4 { sum } else { add(add(T::of(1.0 / 362_880.0), 5040.0), 120.0) };
    add(add(sum, 6.0), 1.0)
}
