//! What a flake lets through, eight pixels at a time: T *= 1 - weight * profile.
//!
//! Left to itself the compiler makes vectors of eight rows here, and gathers and scatters their pixels
//! one by one. No fused multiply-add, so that all levels give the same bits.

#![expect(unsafe_code, reason = "intrinsics: the compiler makes vectors of rows here, and gathers")]

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

#[cfg(target_arch = "x86_64")]
use crate::base::simd::{AVX2, AVX512};

/// Pixels at a time.
pub const LANES: usize = 8;

/// A pixel's precision that flakes are drawn in.
pub trait Dim: Copy {
    /// `through[k] *= 1 - weight * profile[k]`, the product in this precision and the rest in float64.
    ///
    /// # Safety
    ///
    /// The processor has the level's instructions.
    unsafe fn dim<const LEVEL: u8>(
        through: &mut [f64; LANES],
        weight: Self,
        profile: &[Self; LANES],
    );
}

impl Dim for f32 {
    #[inline(always)]
    unsafe fn dim<const LEVEL: u8>(
        through: &mut [f64; LANES],
        weight: f32,
        profile: &[f32; LANES],
    ) {
        let at = through.as_mut_ptr();
        match LEVEL {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the caller has the instructions, and both arrays hold what is read and written.
            AVX512 => unsafe {
                let alpha =
                    _mm256_mul_ps(_mm256_set1_ps(weight), _mm256_loadu_ps(profile.as_ptr()));
                let left = _mm512_sub_pd(_mm512_set1_pd(1.0), _mm512_cvtps_pd(alpha));
                _mm512_storeu_pd(at, _mm512_mul_pd(_mm512_loadu_pd(at), left));
            },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            AVX2 => unsafe {
                let alpha =
                    _mm256_mul_ps(_mm256_set1_ps(weight), _mm256_loadu_ps(profile.as_ptr()));
                let halves = [_mm256_castps256_ps128(alpha), _mm256_extractf128_ps::<1>(alpha)];
                for (i, alpha) in halves.into_iter().enumerate() {
                    let left = _mm256_sub_pd(_mm256_set1_pd(1.0), _mm256_cvtps_pd(alpha));
                    let at = at.add(4 * i);
                    _mm256_storeu_pd(at, _mm256_mul_pd(_mm256_loadu_pd(at), left));
                }
            },
            _ => {
                for k in 0..LANES {
                    through[k] *= 1.0 - f64::from(weight * profile[k]);
                }
            }
        }
    }
}

impl Dim for f64 {
    #[inline(always)]
    unsafe fn dim<const LEVEL: u8>(
        through: &mut [f64; LANES],
        weight: f64,
        profile: &[f64; LANES],
    ) {
        let at = through.as_mut_ptr();
        match LEVEL {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the caller has the instructions, and both arrays hold what is read and written.
            AVX512 => unsafe {
                let alpha =
                    _mm512_mul_pd(_mm512_set1_pd(weight), _mm512_loadu_pd(profile.as_ptr()));
                let left = _mm512_sub_pd(_mm512_set1_pd(1.0), alpha);
                _mm512_storeu_pd(at, _mm512_mul_pd(_mm512_loadu_pd(at), left));
            },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            AVX2 => unsafe {
                for at_lane in [0, 4] {
                    let at = at.add(at_lane);
                    let profile = _mm256_loadu_pd(profile.as_ptr().add(at_lane));
                    let alpha = _mm256_mul_pd(_mm256_set1_pd(weight), profile);
                    let left = _mm256_sub_pd(_mm256_set1_pd(1.0), alpha);
                    _mm256_storeu_pd(at, _mm256_mul_pd(_mm256_loadu_pd(at), left));
                }
            },
            _ => {
                for k in 0..LANES {
                    through[k] *= 1.0 - weight * profile[k];
                }
            }
        }
    }
}

/// T *= 1 - weight * profile for whole lanes; in functions that are compiled for the level.
#[inline(always)]
pub fn rows<P: Dim, const LEVEL: u8>(through: &mut [f64], weight: P, profile: &[P]) {
    let lanes = through.chunks_exact_mut(LANES).zip(profile.chunks_exact(LANES));
    for (through, profile) in lanes {
        let (Some(through), Some(profile)) = (through.first_chunk_mut(), profile.first_chunk())
        else {
            return;
        };
        // SAFETY: `dispatch` asks the processor before it takes a level.
        unsafe { P::dim::<LEVEL>(through, weight, profile) };
    }
}
