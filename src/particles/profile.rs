//! The Gaussian that ends, and its motion blur, in units of sigma.
//!
//! Everything is made of additions, multiplications, divisions and comparisons, with no fused
//! multiply-add and no C library: the loops over lanes vectorise, and the bits are the same with
//! every instruction set.
//!
//! The footprint. Inside 3 sigma it is exp(-u^2/2) exactly; from there a smoothstep takes it to zero at
//! 4 sigma, since a hard edge makes pixels on the rim jump with the last bit of a position. What is
//! cut off is 6.3e-4 of the energy per axis (see `sprite` for what is done about it).
//!
//! Motion blur. A Gaussian swept along a segment of length L, over its plain length at rest:
//! G = (sqrt(pi/2) / L) (erf(a / sqrt 2) + erf(b / sqrt 2)), a and b the distances from the two ends
//! inwards. For short segments the difference of nearly equal numbers loses digits; there
//! G = exp(-x^2/2) sum_n (L/2)^2n / (2n+1)! He_2n(x), x from the middle, is used instead.

use crate::base::normal::{Normal, least, most, polynomial_at};
use crate::base::simd::multiply_add;

/// Where the end of the footprint begins, in sigma.
const RIM: f64 = 3.0;

pub const TERMS: usize = 7;

/// What the profiles need of a pixel's precision beyond [`Normal`].
pub trait Profile: Normal {
    /// Segments shorter than this many sigma use the series. The first term left out is below
    /// (L/2)^14 * 1.0e-7 there, and the difference of error functions loses 2.5 eps / L above.
    const SHORT: f64;

    /// erf(u / sqrt 2), for any u; its error is that of 1, also where it is small.
    fn erf<const LEVEL: u8>(u: Self) -> Self;
}

impl Profile for f32 {
    const SHORT: f64 = 2.0;

    #[inline(always)]
    fn erf<const LEVEL: u8>(u: f32) -> f32 {
        // erf(u / sqrt 2) / u as a polynomial in u^2, for u^2 / 5.25^2 from 0 to 1 brought to -1..1.
        const END: f32 = 5.25;
        let u = most(least(u, END), -END);
        let squared = multiply_add::<_, LEVEL>(u * u, 2.0 / (END * END), -1.0);
        u * polynomial_at::<_, 15, LEVEL>(
            [
                0.00047987315,
                -0.0013131567,
                0.0013295539,
                -0.002079102,
                0.005784607,
                -0.010897002,
                0.016835816,
                -0.025550522,
                0.03707727,
                -0.05008386,
                0.064062886,
                -0.07952683,
                0.09929157,
                -0.13425364,
                0.2693187,
            ],
            squared,
        )
    }
}

impl Profile for f64 {
    const SHORT: f64 = 0.45;

    #[inline(always)]
    fn erf<const LEVEL: u8>(u: f64) -> f64 {
        let inside = 1.0 - f64::tail_at::<LEVEL>(u.abs());
        if u < 0.0 { -inside } else { inside }
    }
}

/// The end of the footprint: 1 up to 3 sigma, 0 from 4 sigma on; any u, also a negative one.
#[inline(always)]
pub fn rim<P: Profile, const LEVEL: u8>(u: P) -> P {
    let t = least(most(u - P::of(RIM), P::zero()), P::one());
    let slope = multiply_add::<P, LEVEL>(t, P::of(-2.0), P::of(3.0));
    multiply_add::<P, LEVEL>(-(t * t), slope, P::one())
}

/// By how much a segment (its extents in sigma) widens a Gaussian's standard deviation on each axis.
#[inline(always)]
pub fn widening(extents: [f64; 2]) -> [f64; 2] {
    [(1.0 + extents[0] * extents[0] / 12.0).sqrt(), (1.0 + extents[1] * extents[1] / 12.0).sqrt()]
}

/// The Gaussian, without its rim; held beyond 6 sigma, where the rim is zero.
#[inline(always)]
pub fn bare<P: Profile, const LEVEL: u8>(u: P) -> P {
    let u = least(u.abs(), P::of(6.0));
    P::exp_at::<LEVEL>(P::of(-0.5) * u * u)
}

/// The Gaussian that ends, at a distance u from its middle.
///
/// Past the end the exponent is held at 4 sigma: the rim makes it zero, and a power of two that ran
/// out of its range would make it anything.
#[inline(always)]
pub fn gaussian<P: Profile, const LEVEL: u8>(u: P) -> P {
    let u = least(u.abs(), P::of(4.0));
    P::exp_at::<LEVEL>(P::of(-0.5) * u * u) * rim::<P, LEVEL>(u)
}

/// G for segments of `P::SHORT` and longer, without its factor sqrt(pi/2) / L: the error functions of
/// the distances inwards from the two ends.
#[inline(always)]
pub fn swept<P: Profile, const LEVEL: u8>(from_start: P, from_end: P) -> P {
    P::erf::<LEVEL>(from_start) + P::erf::<LEVEL>(from_end)
}

/// He_2n / (2n+1)! by descending powers of x^2.
const HERMITE: [[f64; TERMS]; TERMS] = {
    let mut rows = [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0],
        [0.0, 0.0, 0.0, 0.0, 1.0, -6.0, 3.0],
        [0.0, 0.0, 0.0, 1.0, -15.0, 45.0, -15.0],
        [0.0, 0.0, 1.0, -28.0, 210.0, -420.0, 105.0],
        [0.0, 1.0, -45.0, 630.0, -3150.0, 4725.0, -945.0],
        [1.0, -66.0, 1485.0, -13860.0, 51975.0, -62370.0, 10395.0],
    ];
    let mut factorial = 1.0;
    let mut n = 1;
    while n < TERMS {
        factorial *= (2 * n * (2 * n + 1)) as f64;
        let mut k = 0;
        while k < TERMS {
            rows[n][k] /= factorial;
            k += 1;
        }
        n += 1;
    }
    rows
};

/// The series of G for a short segment, as a polynomial in x^2 (highest power first):
/// G = exp(-x^2/2) * polynomial(x^2).
#[inline(always)]
pub fn series(length: f64) -> [f64; TERMS] {
    let squared_half = 0.25 * length * length;
    let mut coefficients = HERMITE[TERMS - 1];
    for n in (0..TERMS - 1).rev() {
        for k in 0..TERMS {
            coefficients[k] = coefficients[k] * squared_half + HERMITE[n][k];
        }
    }
    coefficients
}

/// A short segment's image at `x` along it from its middle and `q` across, without its rim: both
/// Gaussians in one. Far outside the rim the exponent is held where it stays in range.
#[inline(always)]
pub fn swept_short<P: Profile, const LEVEL: u8>(x: P, q: P, half: P, series: [P; TERMS]) -> P {
    let x = least(x.abs(), half + P::of(6.0));
    let q = least(q.abs(), P::of(6.0));
    let squared = x * x;
    let both = multiply_add::<P, LEVEL>(q, q, squared);
    P::exp_at::<LEVEL>(P::of(-0.5) * both) * polynomial_at::<P, TERMS, LEVEL>(series, squared)
}
