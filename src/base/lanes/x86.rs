//! AVX and AVX-512 registers as [`Lanes`].

#![expect(unsafe_code, reason = "the intrinsics of vectors")]

use super::Lanes;
use std::arch::x86_64::*;

macro_rules! lanes {
    (
        $(#[$meta:meta])* $name:ident, $real:ty, $n:literal, $vector:ty,
        $splat:ident, $load:ident, $store:ident, $fmadd:ident, $fnmadd:ident,
        $add:ident, $sub:ident, $mul:ident, $min:ident, $max:ident,
        |$v:ident| $reversed:expr
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy)]
        pub struct $name($vector);

        // SAFETY of every block: the caller answers for the instructions and the memory.
        #[allow(clippy::undocumented_unsafe_blocks, reason = "one line above for all")]
        impl Lanes<$real> for $name {
            const N: usize = $n;

            #[inline(always)]
            unsafe fn splat(value: $real) -> Self {
                Self(unsafe { $splat(value) })
            }
            #[inline(always)]
            unsafe fn load(from: *const $real) -> Self {
                Self(unsafe { $load(from) })
            }
            #[inline(always)]
            unsafe fn store(self, to: *mut $real) {
                unsafe { $store(to, self.0) }
            }
            #[inline(always)]
            unsafe fn multiply_add(self, b: Self, c: Self) -> Self {
                Self(unsafe { $fmadd(self.0, b.0, c.0) })
            }
            #[inline(always)]
            unsafe fn product_from(self, b: Self, c: Self) -> Self {
                Self(unsafe { $fnmadd(self.0, b.0, c.0) })
            }
            #[inline(always)]
            unsafe fn add(self, b: Self) -> Self {
                Self(unsafe { $add(self.0, b.0) })
            }
            #[inline(always)]
            unsafe fn sub(self, b: Self) -> Self {
                Self(unsafe { $sub(self.0, b.0) })
            }
            #[inline(always)]
            unsafe fn mul(self, b: Self) -> Self {
                Self(unsafe { $mul(self.0, b.0) })
            }
            #[inline(always)]
            unsafe fn min(self, b: Self) -> Self {
                Self(unsafe { $min(self.0, b.0) })
            }
            #[inline(always)]
            unsafe fn max(self, b: Self) -> Self {
                Self(unsafe { $max(self.0, b.0) })
            }
            #[inline(always)]
            unsafe fn reversed(self) -> Self {
                let $v = self.0;
                Self(unsafe { $reversed })
            }
        }
    };
}

lanes!(
    /// An AVX-512 register of float32.
    F32x16, f32, 16, __m512,
    _mm512_set1_ps, _mm512_loadu_ps, _mm512_storeu_ps, _mm512_fmadd_ps, _mm512_fnmadd_ps,
    _mm512_add_ps, _mm512_sub_ps, _mm512_mul_ps, _mm512_min_ps, _mm512_max_ps,
    |v| _mm512_permutexvar_ps(
        _mm512_setr_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0), v
    )
);
lanes!(
    /// An AVX-512 register of float64.
    F64x8, f64, 8, __m512d,
    _mm512_set1_pd, _mm512_loadu_pd, _mm512_storeu_pd, _mm512_fmadd_pd, _mm512_fnmadd_pd,
    _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_min_pd, _mm512_max_pd,
    |v| _mm512_permutexvar_pd(_mm512_setr_epi64(7, 6, 5, 4, 3, 2, 1, 0), v)
);
lanes!(
    /// An AVX register of float32.
    F32x8, f32, 8, __m256,
    _mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps, _mm256_fmadd_ps, _mm256_fnmadd_ps,
    _mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps, _mm256_min_ps, _mm256_max_ps,
    |v| _mm256_permutevar8x32_ps(v, _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0))
);
lanes!(
    /// An AVX register of float64.
    F64x4, f64, 4, __m256d,
    _mm256_set1_pd, _mm256_loadu_pd, _mm256_storeu_pd, _mm256_fmadd_pd, _mm256_fnmadd_pd,
    _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_min_pd, _mm256_max_pd,
    |v| _mm256_permute4x64_pd::<0b00_01_10_11>(v)
);
