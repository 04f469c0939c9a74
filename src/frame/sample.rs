//! What a background's pixel can be: 8 and 16 bit integers of full scale 1, and floats as they are.

#![expect(unsafe_code, reason = "pixels to vectors and back, by intrinsics")]

use crate::base::lanes::{Lanes, Plain};
use crate::base::real::Real;

/// One channel of a background's pixel.
pub trait Sample: Copy + PartialEq + Send + Sync {
    /// The precision that it is composited in.
    type Working: Real;
    /// What 1 of a layer is in the background's own values.
    const SCALE: f64;
    /// Whether it is a whole number, so neither infinite, nor NaN, nor minus zero.
    const INTEGER: bool;
    type Avx512: Samples<Self>;
    type Avx2: Samples<Self>;
    type Portable: Samples<Self>;
    /// The value in the background's own units.
    fn load(self) -> Self::Working;
    /// An integer's own value: its place in a table.
    fn level(self) -> usize;
    /// Clipped and rounded to the nearest integer, ties to even; or a float as it is.
    fn store(value: Self::Working) -> Self;
}

/// Vectors that samples are read into and written from.
pub trait Samples<S: Sample>: Lanes<S::Working> {
    /// N samples from `from` on, as [`Sample::load`].
    ///
    /// # Safety
    ///
    /// As for [`Lanes::load`].
    unsafe fn read(from: *const S) -> Self;

    /// Writes them from `to` on, as [`Sample::store`].
    ///
    /// # Safety
    ///
    /// As for [`Lanes::store`].
    unsafe fn write(self, to: *mut S);
}

macro_rules! levels {
    ($real:ty) => {
        type Avx512 = <$real as Real>::Avx512;
        type Avx2 = <$real as Real>::Avx2;
        type Portable = <$real as Real>::Portable;
    };
}

macro_rules! integer_sample {
    ($integer:ty) => {
        impl Sample for $integer {
            type Working = f32;
            const SCALE: f64 = <$integer>::MAX as f64;
            const INTEGER: bool = true;
            levels!(f32);
            #[inline]
            fn load(self) -> f32 {
                f32::from(self)
            }
            #[inline]
            fn level(self) -> usize {
                usize::from(self)
            }
            #[inline]
            fn store(value: f32) -> Self {
                // Added to 2^23 a float's last bits are its value rounded to the nearest integer, ties
                // to even: a conversion with a vector form, which the saturating cast has not.
                let clipped = value.max(0.0).min(Self::SCALE as f32);
                (clipped + 8_388_608.0).to_bits() as Self
            }
        }
    };
}
integer_sample!(u8);
integer_sample!(u16);

macro_rules! float_sample {
    ($float:ty) => {
        impl Sample for $float {
            type Working = $float;
            const SCALE: f64 = 1.0;
            const INTEGER: bool = false;
            levels!($float);
            #[inline]
            fn load(self) -> $float {
                self
            }
            #[inline]
            fn level(self) -> usize {
                0
            }
            #[inline]
            fn store(value: $float) -> Self {
                value
            }
        }
    };
}
float_sample!(f32);
float_sample!(f64);

impl<S: Sample, const N: usize> Samples<S> for Plain<S::Working, N> {
    #[inline(always)]
    unsafe fn read(from: *const S) -> Self {
        // SAFETY: the caller has N samples there.
        let samples = unsafe { from.cast::<[S; N]>().read_unaligned() };
        Self::from(samples.map(S::load))
    }
    #[inline(always)]
    unsafe fn write(self, to: *mut S) {
        // SAFETY: the caller has room for N samples there.
        unsafe { to.cast::<[S; N]>().write_unaligned(<[S::Working; N]>::from(self).map(S::store)) }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::Samples;
    use crate::base::lanes::{F32x8, F32x16, F64x4, F64x8, Lanes};
    use std::arch::x86_64::*;

    macro_rules! floats {
        ($real:ty, $vector:ty) => {
            // SAFETY of both: the caller's.
            #[allow(clippy::undocumented_unsafe_blocks, reason = "one line above")]
            impl Samples<$real> for $vector {
                #[inline(always)]
                unsafe fn read(from: *const $real) -> Self {
                    unsafe { Self::load(from) }
                }
                #[inline(always)]
                unsafe fn write(self, to: *mut $real) {
                    unsafe { self.store(to) }
                }
            }
        };
    }
    floats!(f32, F32x16);
    floats!(f64, F64x8);
    floats!(f32, F32x8);
    floats!(f64, F64x4);

    /// Reading widens; writing clips, `max` taking zero for a NaN, and rounds to the nearest integer,
    /// ties to even.
    macro_rules! integers {
        ($integer:ty, $vector:ty, |$from:ident| $read:expr, |$values:ident, $to:ident| $write:expr) => {
            // SAFETY of both: the caller's.
            #[allow(clippy::undocumented_unsafe_blocks, reason = "one line above")]
            impl Samples<$integer> for $vector {
                #[inline(always)]
                unsafe fn read($from: *const $integer) -> Self {
                    unsafe { Self::from($read) }
                }
                #[inline(always)]
                unsafe fn write(self, $to: *mut $integer) {
                    unsafe {
                        let most = <$integer>::MAX.into();
                        let $values = self.max(Self::splat(0.0)).min(Self::splat(most)).into();
                        $write
                    }
                }
            }
        };
    }
    integers!(
        u8,
        F32x16,
        |from| _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(_mm_loadu_si128(from.cast()))),
        |v, to| _mm_storeu_si128(to.cast(), _mm512_cvtusepi32_epi8(_mm512_cvtps_epi32(v)))
    );
    integers!(
        u16,
        F32x16,
        |from| _mm512_cvtepi32_ps(_mm512_cvtepu16_epi32(_mm256_loadu_si256(from.cast()))),
        |v, to| _mm256_storeu_si256(to.cast(), _mm512_cvtusepi32_epi16(_mm512_cvtps_epi32(v)))
    );
    integers!(
        u8,
        F32x8,
        |from| _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(from.cast()))),
        |v, to| {
            let whole = _mm256_cvtps_epi32(v);
            let (low, high) = (_mm256_castsi256_si128(whole), _mm256_extracti128_si256::<1>(whole));
            let words = _mm_packus_epi32(low, high);
            _mm_storel_epi64(to.cast(), _mm_packus_epi16(words, words));
        }
    );
    integers!(
        u16,
        F32x8,
        |from| _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_loadu_si128(from.cast()))),
        |v, to| {
            let whole = _mm256_cvtps_epi32(v);
            let (low, high) = (_mm256_castsi256_si128(whole), _mm256_extracti128_si256::<1>(whole));
            _mm_storeu_si128(to.cast(), _mm_packus_epi32(low, high));
        }
    );
}
