//! The normal law on lanes: its exponential and its tail, without branches and without a C library.
//!
//! Everything is made of additions, multiplications, divisions and comparisons, with no fused
//! multiply-add: the loops over lanes vectorise, and the bits are the same with every instruction set.

use num_traits::Float;

use crate::base::real::Real;
use crate::base::simd::multiply_add;

/// What Gaussians need of a pixel's precision beyond [`Real`].
pub trait Normal: Real {
    /// erfc(u / sqrt 2) is taken as constant (and zero to rounding) beyond this u.
    const SATURATED: f64;

    /// exp(x) for x from -80 to 0, with the products of a level of [`crate::base::simd`].
    fn exp_at<const LEVEL: u8>(x: Self) -> Self;

    /// erfc(u / sqrt 2) for u >= 0, small relative error even in the tail, with the products of a level.
    fn tail_at<const LEVEL: u8>(u: Self) -> Self;
}

/// A polynomial, highest power first, as two half as long in x^2, with the products of a level: Horner's
/// one long chain of dependent operations would leave most of the processor idle.
#[inline(always)]
pub fn polynomial_at<P: Real, const N: usize, const LEVEL: u8>(coefficients: [P; N], x: P) -> P {
    let squared = x * x;
    let (mut first, mut second) = (coefficients[0], coefficients[1]);
    let mut i = 2;
    while i + 1 < N {
        first = multiply_add::<P, LEVEL>(first, squared, coefficients[i]);
        second = multiply_add::<P, LEVEL>(second, squared, coefficients[i + 1]);
        i += 2;
    }
    if N.is_multiple_of(2) {
        multiply_add::<P, LEVEL>(first, x, second)
    } else {
        let even = multiply_add::<P, LEVEL>(first, squared, coefficients[N - 1]);
        multiply_add::<P, LEVEL>(second, x, even)
    }
}

/// The less of two; `b` if one is NaN. `Float::min` must mind NaN and costs three instructions.
#[inline(always)]
pub fn least<P: Float>(a: P, b: P) -> P {
    if a < b { a } else { b }
}

/// The greater of two; `b` if one is NaN.
#[inline(always)]
pub fn most<P: Float>(a: P, b: P) -> P {
    if a > b { a } else { b }
}

// The coefficients below are Chebyshev fits made with 60 digits, highest power first.
impl Normal for f32 {
    const SATURATED: f64 = 5.7;

    #[inline(always)]
    fn exp_at<const LEVEL: u8>(x: f32) -> f32 {
        // Adding 1.5 * 2^23 rounds to an integer and leaves it in the low bits.
        const ROUND: f32 = 12_582_912.0;
        let y = x * std::f32::consts::LOG2_E;
        let shifted = y + ROUND;
        let f = y - (shifted - ROUND);
        // (2^f - 1) / f on [-1/2, 1/2], to 5e-9.
        let fraction = polynomial_at::<_, 6, LEVEL>(
            [
                1.545_316_3e-4,
                1.339_086_3e-3,
                9.618_083e-3,
                5.550_357e-2,
                0.240_226_5,
                std::f32::consts::LN_2,
            ],
            f,
        );
        let fraction = multiply_add::<_, LEVEL>(fraction, f, 1.0);
        f32::from_bits(fraction.to_bits().wrapping_add(shifted.to_bits() << 23))
    }

    #[inline(always)]
    fn tail_at<const LEVEL: u8>(u: f32) -> f32 {
        // log(erfc(u / sqrt 2)) / u on [0, 5.7]: erfc to 3e-8 of 1, and to 5e-7 of itself.
        let u = least(u, 5.7);
        f32::exp_at::<LEVEL>(
            u * polynomial_at::<_, 10, LEVEL>(
                [
                    -1.470_208_6e-8,
                    4.595_409e-7,
                    -6.151_43e-6,
                    4.464_455_2e-5,
                    -1.657_682e-4,
                    -5.594_040_3e-5,
                    4.879_426e-3,
                    -0.036_389_07,
                    -0.318_296_3,
                    -0.797_885_7,
                ],
                u,
            ),
        )
    }
}

impl Normal for f64 {
    const SATURATED: f64 = 8.7;

    #[inline(always)]
    fn exp_at<const LEVEL: u8>(x: f64) -> f64 {
        const ROUND: f64 = 6_755_399_441_055_744.0;
        let y = x * std::f64::consts::LOG2_E;
        let shifted = y + ROUND;
        let f = y - (shifted - ROUND);
        // (2^f - 1) / f on [-1/2, 1/2], to 1.1e-19.
        let fraction = polynomial_at::<_, 12, LEVEL>(
            [
                2.572_932_417_736_230_5e-11,
                4.455_817_908_336_064_5e-10,
                7.054_897_304_155_499_5e-9,
                1.017_805_708_773_394_1e-7,
                1.321_548_680_870_556_3e-6,
                1.525_273_384_155_677_3e-5,
                1.540_353_039_337_073_4e-4,
                1.333_355_814_640_647e-3,
                9.618_129_107_628_48e-3,
                0.055_504_108_664_821_625,
                0.240_226_506_959_100_72,
                std::f64::consts::LN_2,
            ],
            f,
        );
        let fraction = multiply_add::<_, LEVEL>(fraction, f, 1.0);
        f64::from_bits(fraction.to_bits().wrapping_add(shifted.to_bits() << 52))
    }

    #[inline(always)]
    fn tail_at<const LEVEL: u8>(u: f64) -> f64 {
        // (1 + u) exp(u^2/2) erfc(u / sqrt 2) in (u - 4) / (u + 4) on [0, 8.7], to 1.1e-18.
        let u = least(u, 8.7);
        let scaled = polynomial_at::<_, 21, LEVEL>(
            [
                -1.326_895_861_088_188_6e-8,
                -9.370_448_823_321_068e-8,
                -2.197_901_552_486_525_2e-7,
                5.299_289_029_373_28e-8,
                1.134_539_443_723_137e-6,
                8.005_867_950_609_764e-7,
                -5.239_267_435_544_577_5e-6,
                -6.865_647_423_578_811e-6,
                2.725_623_814_455_813_8e-5,
                4.250_057_553_569_679_5e-5,
                -1.757_066_413_968_571_5e-4,
                -1.888_605_495_191_870_5e-4,
                1.389_794_233_161_446_5e-3,
                -5.712_461_960_191_179e-4,
                -0.010_004_757_183_908_997,
                0.035_872_194_959_533_56,
                -0.064_395_674_856_086_69,
                0.057_200_728_107_093_44,
                0.027_999_269_448_849_257,
                -0.193_406_954_653_051_52,
                0.944_106_413_019_689_3,
            ],
            (u - 4.0) / (u + 4.0),
        );
        f64::exp_at::<LEVEL>(-0.5 * u * u) * scaled / (1.0 + u)
    }
}

/// The natural logarithm of a number from 0 to 1, and a large negative number of 0.
///
/// 2 artanh(y) of y = (m - 1) / (m + 1), for a mantissa m from the root of 1/2 to that of 2.
#[inline(always)]
pub fn ln<const LEVEL: u8>(x: f32) -> f32 {
    let bits = most(x, 1e-36).to_bits();
    let steps = bits.wrapping_sub(0x3F35_04F3) as i32 >> 23;
    let m = f32::from_bits(bits.wrapping_sub((steps << 23) as u32));
    let y = (m - 1.0) / (m + 1.0);
    let odd = polynomial_at::<f32, 5, LEVEL>([2.0 / 9.0, 2.0 / 7.0, 0.4, 2.0 / 3.0, 2.0], y * y);
    multiply_add::<f32, LEVEL>(steps as f32, std::f32::consts::LN_2, y * odd)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::simd::PORTABLE;

    // erfc(u / sqrt 2), 20 digits from a multiple-precision library.
    const TAIL: [(f64, f64); 8] = [
        (0.0, 1.0),
        (0.125, 0.900_523_550_339_774_2),
        (0.5, 0.617_075_077_451_973_8),
        (1.0, 0.317_310_507_862_914_1),
        (2.0, 0.045_500_263_896_358_42),
        (3.0, 0.002_699_796_063_260_189),
        (4.0, 6.334_248_366_623_984e-5),
        (5.5, 3.797_912_493_177_544e-8),
    ];

    #[test]
    fn exp_is_right_to_the_last_digits() {
        for i in 0..=3700 {
            let x = -f64::from(i) / 100.0;
            let wide = f64::exp_at::<PORTABLE>(x) / x.exp() - 1.0;
            assert!(wide.abs() < 8e-15, "{x}: {wide:e}");
            let x = x as f32;
            let narrow = f64::from(f32::exp_at::<PORTABLE>(x)) / f64::from(x).exp() - 1.0;
            assert!(narrow.abs() < 1.5e-7 + 9e-8 * f64::from(-x), "{x}: {narrow:e}");
        }
        assert_eq!((f32::exp_at::<PORTABLE>(0.0), f64::exp_at::<PORTABLE>(0.0)), (1.0, 1.0));
    }

    #[test]
    fn tails_are_right_relative_to_themselves() {
        for (u, want) in TAIL {
            let wide = f64::tail_at::<PORTABLE>(u) / want - 1.0;
            assert!(wide.abs() < 8e-15, "{u}: {wide:e}");
            let narrow = f64::from(f32::tail_at::<PORTABLE>(u as f32)) / want - 1.0;
            assert!(narrow.abs() < 3e-6, "{u}: {narrow:e}");
            assert!((narrow * want).abs() < 2e-7, "{u}: {narrow:e}");
        }
    }
}
