//! Vectors of numbers, for the few loops that the compiler does not make vector code of by itself.
//!
//! A kernel that is generic over [`Lanes`] names the vectors of its level: [`Real::Avx512`],
//! [`Real::Avx2`] or [`Real::Portable`]. Functions here must be inlined into one that is compiled for
//! the level (`simd::dispatch`); anywhere else they would be calls.
//!
//! [`Real::Avx512`]: crate::base::real::Real::Avx512
//! [`Real::Avx2`]: crate::base::real::Real::Avx2
//! [`Real::Portable`]: crate::base::real::Real::Portable

#![expect(
    unsafe_code,
    reason = "vectors are read and written through pointers, and need the processor's instructions"
)]

use num_traits::Float;

/// N numbers that are worked on at once.
///
/// # Safety
///
/// Of all functions: the processor has the level's instructions; and what `load` and `store` say.
pub trait Lanes<T>: Copy {
    /// How many.
    const N: usize;

    /// The same number everywhere.
    unsafe fn splat(value: T) -> Self;

    /// N numbers from `from` on, which are there to be read.
    unsafe fn load(from: *const T) -> Self;

    /// Writes them from `to` on, where there is room for N numbers.
    unsafe fn store(self, to: *mut T);

    /// `self * b + c`, rounded once on the vector levels and twice on the portable one.
    unsafe fn multiply_add(self, b: Self, c: Self) -> Self;

    /// `c - self * b`, rounded as `multiply_add`.
    unsafe fn product_from(self, b: Self, c: Self) -> Self;

    /// `self + b`.
    unsafe fn add(self, b: Self) -> Self;

    /// `self - b`.
    unsafe fn sub(self, b: Self) -> Self;

    /// `self * b`.
    unsafe fn mul(self, b: Self) -> Self;

    /// The smaller and the larger of two; `b` where `self` is NaN.
    unsafe fn min(self, b: Self) -> Self;

    /// See `min`.
    unsafe fn max(self, b: Self) -> Self;

    /// The last one first.
    unsafe fn reversed(self) -> Self;

    /// Each of them three times: what pixels have, for the channels of their pixels.
    unsafe fn thrice(self) -> [Self; 3];

    /// `by` where `at` equals `like`, as no NaN does, and `self` elsewhere.
    unsafe fn replaced(self, at: Self, like: Self, by: Self) -> Self;
}

/// Lanes of the portable level.
#[derive(Clone, Copy)]
pub struct Plain<T, const N: usize>([T; N]);

impl<T, const N: usize> From<[T; N]> for Plain<T, N> {
    #[inline(always)]
    fn from(values: [T; N]) -> Self {
        Self(values)
    }
}

impl<T, const N: usize> From<Plain<T, N>> for [T; N] {
    #[inline(always)]
    fn from(lanes: Plain<T, N>) -> Self {
        lanes.0
    }
}

impl<T: Float, const N: usize> Lanes<T> for Plain<T, N> {
    const N: usize = N;

    #[inline(always)]
    unsafe fn splat(value: T) -> Self {
        Self([value; N])
    }
    #[inline(always)]
    unsafe fn load(from: *const T) -> Self {
        // SAFETY: the caller has N numbers there.
        Self(unsafe { from.cast::<[T; N]>().read_unaligned() })
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut T) {
        // SAFETY: the caller has room for N numbers there.
        unsafe { to.cast::<[T; N]>().write_unaligned(self.0) }
    }
    #[inline(always)]
    unsafe fn multiply_add(self, b: Self, c: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] * b.0[i] + c.0[i]))
    }
    #[inline(always)]
    unsafe fn product_from(self, b: Self, c: Self) -> Self {
        Self(std::array::from_fn(|i| c.0[i] - self.0[i] * b.0[i]))
    }
    #[inline(always)]
    unsafe fn add(self, b: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + b.0[i]))
    }
    #[inline(always)]
    unsafe fn sub(self, b: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - b.0[i]))
    }
    #[inline(always)]
    unsafe fn mul(self, b: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] * b.0[i]))
    }
    #[inline(always)]
    unsafe fn min(self, b: Self) -> Self {
        Self(std::array::from_fn(|i| if self.0[i] < b.0[i] { self.0[i] } else { b.0[i] }))
    }
    #[inline(always)]
    unsafe fn max(self, b: Self) -> Self {
        Self(std::array::from_fn(|i| if self.0[i] > b.0[i] { self.0[i] } else { b.0[i] }))
    }
    #[inline(always)]
    unsafe fn reversed(self) -> Self {
        Self(std::array::from_fn(|i| self.0[N - 1 - i]))
    }
    #[inline(always)]
    unsafe fn thrice(self) -> [Self; 3] {
        std::array::from_fn(|part| Self(std::array::from_fn(|i| self.0[(part * N + i) / 3])))
    }
    #[inline(always)]
    unsafe fn replaced(self, at: Self, like: Self, by: Self) -> Self {
        Self(std::array::from_fn(|i| if at.0[i] == like.0[i] { by.0[i] } else { self.0[i] }))
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::{F32x8, F32x16, F64x4, F64x8};

#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::real::Real;
    use crate::base::simd::{Level, level};

    /// All operations on one kind of vectors, against plain numbers.
    fn check<T: Real + std::fmt::Debug, V: Lanes<T>>() {
        let numbers =
            |step: f64| (0..V::N).map(|i| T::of(1.0 + step * i as f64)).collect::<Vec<_>>();
        let (a, b) = (numbers(1.0), numbers(-0.5));
        let mut out = vec![T::zero(); 12 * V::N];
        // SAFETY: the callers have asked for the level; all vectors hold N numbers.
        unsafe {
            let (x, y) = (V::load(a.as_ptr()), V::load(b.as_ptr()));
            x.add(y).store(out.as_mut_ptr());
            x.sub(y).store(out[V::N..].as_mut_ptr());
            x.multiply_add(y, V::splat(T::of(7.0))).store(out[2 * V::N..].as_mut_ptr());
            x.reversed().store(out[3 * V::N..].as_mut_ptr());
            x.mul(y).store(out[4 * V::N..].as_mut_ptr());
            x.min(x.reversed()).store(out[5 * V::N..].as_mut_ptr());
            x.max(x.reversed()).store(out[6 * V::N..].as_mut_ptr());
            x.product_from(y, V::splat(T::of(7.0))).store(out[7 * V::N..].as_mut_ptr());
            for (part, out) in x.thrice().into_iter().zip(out[8 * V::N..11 * V::N].chunks_mut(V::N))
            {
                part.store(out.as_mut_ptr());
            }
            let middle = V::splat(a[V::N / 2]);
            x.replaced(x, middle, y).store(out[11 * V::N..].as_mut_ptr());
        }
        for (i, &value) in out[11 * V::N..12 * V::N].iter().enumerate() {
            assert_eq!(value, if i == V::N / 2 { b[i] } else { a[i] }, "replaced {i}");
        }
        for (i, &value) in out[8 * V::N..11 * V::N].iter().enumerate() {
            assert_eq!(value, a[i / 3], "channel {i}");
        }
        for i in 0..V::N {
            let (x, y) = (a[i], b[i]);
            let back = a[V::N - 1 - i];
            let sums = [x + y, x - y, x * y + T::of(7.0), back];
            let less = T::of(7.0) - x * y;
            let wanted = [sums[0], sums[1], sums[2], back, x * y, x.min(back), x.max(back), less];
            let got = [0, 1, 2, 3, 4, 5, 6, 7].map(|op| out[op * V::N + i]);
            assert_eq!(got, wanted, "lane {i}");
        }
    }

    #[test]
    fn every_kind_computes_what_plain_numbers_do() {
        check::<f32, <f32 as Real>::Portable>();
        check::<f64, <f64 as Real>::Portable>();
        if matches!(level(), Level::Avx2 | Level::Avx512) {
            check::<f32, <f32 as Real>::Avx2>();
            check::<f64, <f64 as Real>::Avx2>();
        }
        if level() == Level::Avx512 {
            check::<f32, <f32 as Real>::Avx512>();
            check::<f64, <f64 as Real>::Avx512>();
        }
    }
}
