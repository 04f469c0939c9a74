//! Cosines and sines along one axis of a dense product, in the order that its loops read them.

use std::f64::consts::TAU;

use crate::base::aligned::Aligned;
use crate::base::error::Error;
use crate::base::real::Real;

/// Sums that stand together in a table: one AVX-512 register of float32, or two of float64.
pub const LANES: usize = 16;

/// What the sums along one axis are multiplied by.
pub struct Tables<T> {
    /// How the pixels of the axis share their sums.
    pub symmetry: Symmetry,
    /// Values of k, made even in number by one more of zeros.
    pub terms: usize,
    /// In the first pass, for each sum the cosines of all k, then the sines. In the second, blocks of
    /// LANES sums; in a block for each k the cosines, then the sines.
    pub values: Aligned<T>,
}

/// How many pixels a sum makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// Pixels i and n-1-i.
    Halves,
    /// Also n/2-1-i and n/2+i.
    Quarters,
}

impl Symmetry {
    #[inline]
    pub const fn of(n: usize) -> Self {
        if n.is_multiple_of(4) && padded(n / 4) < padded(n.div_ceil(2)) {
            Self::Quarters
        } else {
            Self::Halves
        }
    }

    #[inline]
    pub const fn sums(self, n: usize) -> usize {
        match self {
            Self::Halves => n.div_ceil(2),
            Self::Quarters => n / 4,
        }
    }
}

/// n, or one more.
#[inline]
pub const fn even(n: usize) -> usize {
    n + n % 2
}

#[inline]
pub const fn padded(n: usize) -> usize {
    n.div_ceil(LANES) * LANES
}

/// Where the first pass has the cosine of sum i and index k, and how far behind it the sine.
#[inline]
pub const fn by_sum(i: usize, k: usize, terms: usize) -> (usize, usize) {
    (2 * terms * i + k, terms)
}

/// The same for the second pass.
#[inline]
pub const fn in_blocks(i: usize, k: usize, terms: usize) -> (usize, usize) {
    (i / LANES * 2 * LANES * terms + k * 2 * LANES + i % LANES, LANES)
}

/// Columns kx > 0 stand for their mirrors as well.
#[inline]
pub const fn mirrored(k: usize) -> f64 {
    if k > 0 { 2.0 } else { 1.0 }
}

impl<T: Real> Tables<T> {
    /// For n pixels and `count` values of k; `place(i, k, terms)` is where the cosine of sum i stands,
    /// and how far behind it the sine.
    pub fn new(
        n: usize,
        count: usize,
        weight: impl Fn(usize) -> f64,
        place: impl Fn(usize, usize, usize) -> (usize, usize),
    ) -> Result<Self, Error> {
        let symmetry = Symmetry::of(n);
        let terms = even(count);
        let sums = symmetry.sums(n);
        let mut values = Aligned::zeroed(2 * terms * padded(sums))?;
        for i in 0..sums {
            for k in 0..count {
                // Reduced as an integer first: exact for any size.
                let turns = ((2 * i + 1) * k % (2 * n)) as f64 / (2 * n) as f64;
                let (sin, cos) = libm::sincos(TAU * turns);
                let (at, further) = place(i, k, terms);
                values[at] = T::of(weight(k) * cos);
                values[at + further] = T::of(weight(k) * sin);
            }
        }
        Ok(Self { symmetry, terms, values })
    }
}
