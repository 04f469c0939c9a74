//! The two pixel precisions, and the sine and cosine of a phase in cycles.

use std::f64::consts::TAU;

use flurries_fft::Transform;
use num_complex::Complex;
use num_traits::Float;

use crate::base::lanes::{Lanes, Plain};
use crate::base::simd::multiply_add;

/// float32 or float64 pixels.
pub trait Real: Transform + Float + std::ops::AddAssign + std::ops::MulAssign {
    type Avx512: Lanes<Self>;
    type Avx2: Lanes<Self>;
    type Portable: Lanes<Self>;

    /// Rounds a float64 to this precision.
    fn of(value: f64) -> Self;
    /// This value in float64.
    fn wide(self) -> f64;
    /// Values of either precision, if they are of this one.
    fn own<A: Real>(values: &[A]) -> Option<&[Self]>;
    /// These values as float32, if they are.
    fn singles(values: &[Self]) -> Option<&[f32]>;
    /// These values as float64, if they are.
    fn doubles(values: &[Self]) -> Option<&[f64]>;
    /// `exp(2 pi i phase)` for a phase of at most half a cycle, reduced in float64 before it was rounded.
    ///
    /// Loops compiled for a level of vector instructions name it, for its fused multiply-add.
    fn turn<const LEVEL: u8>(phase: Self) -> Complex<Self>;
}

impl Real for f64 {
    #[cfg(target_arch = "x86_64")]
    type Avx512 = crate::base::lanes::F64x8;
    #[cfg(target_arch = "x86_64")]
    type Avx2 = crate::base::lanes::F64x4;
    #[cfg(not(target_arch = "x86_64"))]
    type Avx512 = Self::Portable;
    #[cfg(not(target_arch = "x86_64"))]
    type Avx2 = Self::Portable;
    type Portable = Plain<Self, 2>;

    #[inline]
    fn of(value: f64) -> Self {
        value
    }
    #[inline]
    fn wide(self) -> f64 {
        self
    }
    #[inline]
    fn own<A: Real>(values: &[A]) -> Option<&[Self]> {
        A::doubles(values)
    }
    #[inline]
    fn singles(_values: &[Self]) -> Option<&[f32]> {
        None
    }
    #[inline]
    fn doubles(values: &[Self]) -> Option<&[f64]> {
        Some(values)
    }
    /// Taylor series on an eighth of a turn, without a branch, so that a loop over waves vectorises.
    #[inline]
    fn turn<const LEVEL: u8>(phase: Self) -> Complex<Self> {
        let quarter = (4.0 * phase).round_ties_even();
        let angle = (phase - 0.25 * quarter) * TAU;
        let square = angle * angle;
        let sin = angle * series::<8, LEVEL>(square, 1.0);
        let cos = series::<9, LEVEL>(square, 0.0);
        // -2 .. 2 quarters: an odd number swaps the two, 1 and +-2 negate.
        let odd = quarter.abs() == 1.0;
        let (real, imaginary) = if odd { (sin, cos) } else { (cos, sin) };
        let half = quarter.abs() == 2.0;
        let real_sign = if half || quarter == 1.0 { -1.0 } else { 1.0 };
        let imaginary_sign = if half || quarter == -1.0 { -1.0 } else { 1.0 };
        Complex::new(real_sign * real, imaginary_sign * imaginary)
    }
}

/// `1 - s / ((1 + o)(2 + o)) (1 - s / ((3 + o)(4 + o)) (1 - ...))`: with o = 0 the series of the cosine,
/// with o = 1 that of the sine over its angle, for s the square of the angle.
#[inline(always)]
fn series<const TERMS: usize, const LEVEL: u8>(square: f64, offset: f64) -> f64 {
    let mut sum = 1.0;
    let mut n = TERMS;
    while n > 1 {
        n -= 1;
        let k = 2.0 * n as f64 + offset;
        sum = multiply_add::<f64, LEVEL>(-square, sum * (1.0 / ((k - 1.0) * k)), 1.0);
    }
    sum
}

impl Real for f32 {
    #[cfg(target_arch = "x86_64")]
    type Avx512 = crate::base::lanes::F32x16;
    #[cfg(target_arch = "x86_64")]
    type Avx2 = crate::base::lanes::F32x8;
    #[cfg(not(target_arch = "x86_64"))]
    type Avx512 = Self::Portable;
    #[cfg(not(target_arch = "x86_64"))]
    type Avx2 = Self::Portable;
    type Portable = Plain<Self, 4>;

    #[inline]
    fn of(value: f64) -> Self {
        value as Self
    }
    #[inline]
    fn wide(self) -> f64 {
        f64::from(self)
    }
    #[inline]
    fn own<A: Real>(values: &[A]) -> Option<&[Self]> {
        A::singles(values)
    }
    #[inline]
    fn singles(values: &[Self]) -> Option<&[f32]> {
        Some(values)
    }
    #[inline]
    fn doubles(_values: &[Self]) -> Option<&[f64]> {
        None
    }
    /// Polynomials on a quarter of a turn, without a branch, so that a loop over waves vectorises.
    #[inline]
    fn turn<const LEVEL: u8>(phase: Self) -> Complex<Self> {
        // The nearest half turn; what is left is at most a quarter turn, where both series are short.
        let half = (phase + phase).round_ties_even();
        let angle = (phase - 0.5 * half) * std::f32::consts::TAU;
        // `half` is -1, 0 or 1; a half turn changes both signs.
        let sign = 1.0 - 2.0 * half * half;
        let square = angle * angle;
        const SIN: [f32; 6] =
            [1.0, -1.666_666_6e-1, 8.333_333e-3, -1.984_126_9e-4, 2.755_731_9e-6, -2.505_210_8e-8];
        const COS: [f32; 7] = [
            1.0,
            -0.5,
            4.166_666_8e-2,
            -1.388_888_9e-3,
            2.480_158_7e-5,
            -2.755_732e-7,
            2.087_675_7e-9,
        ];
        let sin = angle * polynomial::<6, LEVEL>(&SIN, square);
        let cos = polynomial::<7, LEVEL>(&COS, square);
        Complex::new(sign * cos, sign * sin)
    }
}

/// `c[0] + x (c[1] + x (c[2] + ...))`.
#[inline(always)]
fn polynomial<const TERMS: usize, const LEVEL: u8>(c: &[f32; TERMS], x: f32) -> f32 {
    let mut sum = c[TERMS - 1];
    let mut n = TERMS - 1;
    while n > 0 {
        n -= 1;
        sum = multiply_add::<f32, LEVEL>(sum, x, c[n]);
    }
    sum
}
