//! Vectors of numbers, for the few loops that the compiler does not make vector code of by itself.
//!
//! A kernel that is generic over [`Lanes`] names the vectors of its level: [`Real::Avx512`],
//! [`Real::Avx2`] or [`Real::Portable`]. Functions here must be inlined into one that is compiled for
//! the level (`simd::dispatch`); anywhere else they would be calls.
//!
//! [`Real::Avx512`]: crate::base::real::Real::Avx512
//! [`Real::Avx2`]: crate::base::real::Real::Avx2
//! [`Real::Portable`]: crate::base::real::Real::Portable

use num_traits::Float;

/// N numbers that are worked on at once.
pub trait Lanes<T>: Copy {
    /// How many.
    const N: usize;

    /// The same number everywhere.
    ///
    /// # Safety
    ///
    /// This and all other functions: the processor has the level's instructions.
    unsafe fn splat(value: T) -> Self;

    /// N numbers from `from` on.
    ///
    /// # Safety
    ///
    /// They are there to be read.
    unsafe fn load(from: *const T) -> Self;

    /// Writes them from `to` on.
    ///
    /// # Safety
    ///
    /// There is room for N numbers.
    unsafe fn store(self, to: *mut T);

    /// `self * b + c`, rounded once on the vector levels and twice on the portable one.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn multiply_add(self, b: Self, c: Self) -> Self;

    /// `c - self * b`, rounded as `multiply_add`.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn product_from(self, b: Self, c: Self) -> Self;

    /// `self + b`.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn add(self, b: Self) -> Self;

    /// `self - b`.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn sub(self, b: Self) -> Self;

    /// `self * b`.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn mul(self, b: Self) -> Self;

    /// `self / b`.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn div(self, b: Self) -> Self;

    /// The square root.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn sqrt(self) -> Self;

    /// The whole number that is not above.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn floor(self) -> Self;

    /// The smaller and the larger of two; `b` where `self` is NaN.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn min(self, b: Self) -> Self;

    /// See `min`.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn max(self, b: Self) -> Self;

    /// The last one first.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn reversed(self) -> Self;

    /// Each of them three times: what pixels have, for the channels of their pixels.
    ///
    /// # Safety
    ///
    /// As for all.
    unsafe fn thrice(self) -> [Self; 3];

    /// `by` where `at` equals `like`, as no NaN does, and `self` elsewhere.
    ///
    /// # Safety
    ///
    /// As for all.
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
    unsafe fn div(self, b: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] / b.0[i]))
    }
    #[inline(always)]
    unsafe fn sqrt(self) -> Self {
        Self(std::array::from_fn(|i| self.0[i].sqrt()))
    }
    #[inline(always)]
    unsafe fn floor(self) -> Self {
        Self(std::array::from_fn(|i| self.0[i].floor()))
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
mod x86 {
    use super::Lanes;
    use std::arch::x86_64::*;

    macro_rules! lanes {
        (
            $(#[$meta:meta])* $name:ident, $real:ty, $n:literal, $vector:ty,
            $splat:ident, $load:ident, $store:ident, $fmadd:ident, $fnmadd:ident,
            $add:ident, $sub:ident, $mul:ident, $div:ident, $sqrt:ident, $min:ident, $max:ident,
            |$v:ident| $reversed:expr, |$w:ident| $thrice:expr, |$x:ident| $floor:expr,
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
                unsafe fn div(self, b: Self) -> Self {
                    Self(unsafe { $div(self.0, b.0) })
                }
                #[inline(always)]
                unsafe fn sqrt(self) -> Self {
                    Self(unsafe { $sqrt(self.0) })
                }
                #[inline(always)]
                unsafe fn floor(self) -> Self {
                    let $x = self.0;
                    Self(unsafe { $floor })
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
        _mm512_add_ps, _mm512_sub_ps, _mm512_mul_ps, _mm512_div_ps, _mm512_sqrt_ps, _mm512_min_ps, _mm512_max_ps,
        |v| _mm512_permutexvar_ps(
            _mm512_setr_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0), v
        ),
        |v| [
            _mm512_setr_epi32(0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, 5),
            _mm512_setr_epi32(5, 5, 6, 6, 6, 7, 7, 7, 8, 8, 8, 9, 9, 9, 10, 10),
            _mm512_setr_epi32(10, 11, 11, 11, 12, 12, 12, 13, 13, 13, 14, 14, 14, 15, 15, 15),
        ]
        .map(|from| _mm512_permutexvar_ps(from, v)),
        |v| _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(v),
        |v, at, like, by| _mm512_mask_blend_ps(_mm512_cmp_ps_mask::<_CMP_EQ_OQ>(at, like), v, by)
    );
    lanes!(
        /// An AVX-512 register of float64.
        F64x8, f64, 8, __m512d,
        _mm512_set1_pd, _mm512_loadu_pd, _mm512_storeu_pd, _mm512_fmadd_pd, _mm512_fnmadd_pd,
        _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_div_pd, _mm512_sqrt_pd, _mm512_min_pd, _mm512_max_pd,
        |v| _mm512_permutexvar_pd(_mm512_setr_epi64(7, 6, 5, 4, 3, 2, 1, 0), v),
        |v| [
            _mm512_setr_epi64(0, 0, 0, 1, 1, 1, 2, 2),
            _mm512_setr_epi64(2, 3, 3, 3, 4, 4, 4, 5),
            _mm512_setr_epi64(5, 5, 6, 6, 6, 7, 7, 7),
        ]
        .map(|from| _mm512_permutexvar_pd(from, v)),
        |v| _mm512_roundscale_pd::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(v),
        |v, at, like, by| _mm512_mask_blend_pd(_mm512_cmp_pd_mask::<_CMP_EQ_OQ>(at, like), v, by)
    );
    lanes!(
        /// An AVX register of float32.
        F32x8, f32, 8, __m256,
        _mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps, _mm256_fmadd_ps, _mm256_fnmadd_ps,
        _mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps, _mm256_div_ps, _mm256_sqrt_ps, _mm256_min_ps, _mm256_max_ps,
        |v| _mm256_permutevar8x32_ps(v, _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0)),
        |v| [
            _mm256_setr_epi32(0, 0, 0, 1, 1, 1, 2, 2),
            _mm256_setr_epi32(2, 3, 3, 3, 4, 4, 4, 5),
            _mm256_setr_epi32(5, 5, 6, 6, 6, 7, 7, 7),
        ]
        .map(|from| _mm256_permutevar8x32_ps(v, from)),
        |v| _mm256_floor_ps(v),
        |v, at, like, by| _mm256_blendv_ps(v, by, _mm256_cmp_ps::<_CMP_EQ_OQ>(at, like))
    );
    lanes!(
        /// An AVX register of float64.
        F64x4, f64, 4, __m256d,
        _mm256_set1_pd, _mm256_loadu_pd, _mm256_storeu_pd, _mm256_fmadd_pd, _mm256_fnmadd_pd,
        _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_div_pd, _mm256_sqrt_pd, _mm256_min_pd, _mm256_max_pd,
        |v| _mm256_permute4x64_pd::<0b00_01_10_11>(v),
        |v| [
            _mm256_permute4x64_pd::<0b01_00_00_00>(v),
            _mm256_permute4x64_pd::<0b10_10_01_01>(v),
            _mm256_permute4x64_pd::<0b11_11_11_10>(v),
        ],
        |v| _mm256_floor_pd(v),
        |v, at, like, by| _mm256_blendv_pd(v, by, _mm256_cmp_pd::<_CMP_EQ_OQ>(at, like))
    );
}

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
        let mut out = vec![T::zero(); 15 * V::N];
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
            x.div(y).store(out[12 * V::N..].as_mut_ptr());
            x.sqrt().store(out[13 * V::N..].as_mut_ptr());
            y.floor().store(out[14 * V::N..].as_mut_ptr());
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
            let got = [12, 13, 14].map(|op| out[op * V::N + i]);
            assert_eq!(got, [x / y, x.sqrt(), y.floor()], "lane {i}");
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
