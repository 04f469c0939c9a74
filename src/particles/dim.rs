//! What a flake lets through, eight pixels at a time: T *= 1 - weight * profile, in float64.
//!
//! Left to itself the compiler makes vectors of eight rows here, and gathers and scatters their pixels
//! one by one.

#![expect(unsafe_code, reason = "vectors by `Lanes`")]

use crate::base::lanes::Lanes;
use crate::base::real::Real;
use crate::base::simd::{AVX2, AVX512};

/// Pixels at a time.
pub const LANES: usize = 8;

/// T *= 1 - weight * profile for whole lanes; in functions that are compiled for the level.
#[inline(always)]
pub fn rows<const LEVEL: u8>(through: &mut [f64], weight: f64, profile: &[f64]) {
    let lanes = through.chunks_exact_mut(LANES).zip(profile.chunks_exact(LANES));
    for (through, profile) in lanes {
        // SAFETY: `dispatch` asks the processor before it takes a level; both hold LANES numbers.
        unsafe {
            match LEVEL {
                AVX512 => dim::<<f64 as Real>::Avx512>(through, weight, profile),
                AVX2 => dim::<<f64 as Real>::Avx2>(through, weight, profile),
                _ => dim::<<f64 as Real>::Portable>(through, weight, profile),
            }
        }
    }
}

/// # Safety
///
/// The processor has the vectors' instructions, and both slices hold LANES numbers.
#[inline(always)]
unsafe fn dim<V: Lanes<f64>>(through: &mut [f64], weight: f64, profile: &[f64]) {
    for at in (0..LANES).step_by(V::N) {
        // SAFETY: N divides LANES; the rest is the caller's.
        unsafe {
            let to = through.as_mut_ptr().add(at);
            let left =
                V::splat(weight).product_from(V::load(profile.as_ptr().add(at)), V::splat(1.0));
            left.mul(V::load(to)).store(to);
        }
    }
}
