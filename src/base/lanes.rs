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

    unsafe fn add(self, b: Self) -> Self;

    unsafe fn sub(self, b: Self) -> Self;

    unsafe fn mul(self, b: Self) -> Self;

    /// The smaller and the larger of two; `b` where `self` is NaN.
    unsafe fn min(self, b: Self) -> Self;

    unsafe fn max(self, b: Self) -> Self;

    /// The last one first.
    unsafe fn reversed(self) -> Self;

    /// Each of them three times: what pixels have, for the channels of their pixels.
    unsafe fn thrice(self) -> [Self; 3];

    /// `by` where `at` equals `like`, as no NaN does, and `self` elsewhere.
    unsafe fn replaced(self, at: Self, like: Self, by: Self) -> Self;
}

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
