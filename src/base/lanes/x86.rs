//! AVX and AVX-512 registers as [`Lanes`].

#![expect(unsafe_code, reason = "the intrinsics of vectors")]

use super::Lanes;
use std::arch::x86_64::*;

macro_rules! lanes {
    (
        $(#[$meta:meta])* $name:ident, $real:ty, $n:literal, $vector:ty,
        $splat:ident, $load:ident, $store:ident, $fmadd:ident, $fnmadd:ident,
        $add:ident, $sub:ident, $mul:ident, $min:ident, $max:ident,
        |$v:ident| $reversed:expr, |$w:ident| $thrice:expr,
        |$from:ident, $at:ident, $like:ident, $by:ident| $replaced:expr
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy)]
        pub struct $name($vector);

        impl From<$vector> for $name {
            #[inline(always)]
            fn from(vector: $vector) -> Self {
                Self(vector)
            }
        }

        impl From<$name> for $vector {
            #[inline(always)]
            fn from(lanes: $name) -> Self {
                lanes.0
            }
        }

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
            #[inline(always)]
            unsafe fn thrice(self) -> [Self; 3] {
                let $w = self.0;
                unsafe { $thrice }.map(Self)
            }
            #[inline(always)]
            unsafe fn replaced(self, at: Self, like: Self, by: Self) -> Self {
                let ($from, $at, $like, $by) = (self.0, at.0, like.0, by.0);
                Self(unsafe { $replaced })
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
    ),
    |v| [
        _mm512_setr_epi32(0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, 5),
        _mm512_setr_epi32(5, 5, 6, 6, 6, 7, 7, 7, 8, 8, 8, 9, 9, 9, 10, 10),
        _mm512_setr_epi32(10, 11, 11, 11, 12, 12, 12, 13, 13, 13, 14, 14, 14, 15, 15, 15),
    ]
    .map(|from| _mm512_permutexvar_ps(from, v)),
    |v, at, like, by| _mm512_mask_blend_ps(_mm512_cmp_ps_mask::<_CMP_EQ_OQ>(at, like), v, by)
);
lanes!(
    /// An AVX-512 register of float64.
    F64x8, f64, 8, __m512d,
    _mm512_set1_pd, _mm512_loadu_pd, _mm512_storeu_pd, _mm512_fmadd_pd, _mm512_fnmadd_pd,
    _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_min_pd, _mm512_max_pd,
    |v| _mm512_permutexvar_pd(_mm512_setr_epi64(7, 6, 5, 4, 3, 2, 1, 0), v),
    |v| [
        _mm512_setr_epi64(0, 0, 0, 1, 1, 1, 2, 2),
        _mm512_setr_epi64(2, 3, 3, 3, 4, 4, 4, 5),
        _mm512_setr_epi64(5, 5, 6, 6, 6, 7, 7, 7),
    ]
    .map(|from| _mm512_permutexvar_pd(from, v)),
    |v, at, like, by| _mm512_mask_blend_pd(_mm512_cmp_pd_mask::<_CMP_EQ_OQ>(at, like), v, by)
);
lanes!(
    /// An AVX register of float32.
    F32x8, f32, 8, __m256,
    _mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps, _mm256_fmadd_ps, _mm256_fnmadd_ps,
    _mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps, _mm256_min_ps, _mm256_max_ps,
    |v| _mm256_permutevar8x32_ps(v, _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0)),
    |v| [
        _mm256_setr_epi32(0, 0, 0, 1, 1, 1, 2, 2),
        _mm256_setr_epi32(2, 3, 3, 3, 4, 4, 4, 5),
        _mm256_setr_epi32(5, 5, 6, 6, 6, 7, 7, 7),
    ]
    .map(|from| _mm256_permutevar8x32_ps(v, from)),
    |v, at, like, by| _mm256_blendv_ps(v, by, _mm256_cmp_ps::<_CMP_EQ_OQ>(at, like))
);
lanes!(
    /// An AVX register of float64.
    F64x4, f64, 4, __m256d,
    _mm256_set1_pd, _mm256_loadu_pd, _mm256_storeu_pd, _mm256_fmadd_pd, _mm256_fnmadd_pd,
    _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_min_pd, _mm256_max_pd,
    |v| _mm256_permute4x64_pd::<0b00_01_10_11>(v),
    |v| [
        _mm256_permute4x64_pd::<0b01_00_00_00>(v),
        _mm256_permute4x64_pd::<0b10_10_01_01>(v),
        _mm256_permute4x64_pd::<0b11_11_11_10>(v),
    ],
    |v, at, like, by| _mm256_blendv_pd(v, by, _mm256_cmp_pd::<_CMP_EQ_OQ>(at, like))
);
