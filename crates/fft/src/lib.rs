//! The only crate that calls the planners of RustFFT and RealFFT.
//!
//! RustFFT is generic, so its kernels are compiled wherever a planner is called. Kept in this crate,
//! they are compiled once; the kernels of flurries only see trait objects.
//!
//! Conventions: inverse transforms are unnormalised sums (no 1/n), as both libraries give them.

#![forbid(unsafe_code)]

use std::sync::Arc;

mod plain;

pub use realfft::{ComplexToReal, FftError};
pub use rustfft::{Fft, FftNum};

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// The two pixel precisions that have compiled transforms.
///
/// `plain` transforms take no vector instructions: slower, and the same bits on every processor.
pub trait Transform: FftNum + sealed::Sealed {
    /// Complex inverse transform of length `n`.
    fn inverse(n: usize, plain: bool) -> Arc<dyn Fft<Self>>;
    /// Inverse transform of a half spectrum (n/2 + 1 bins) to `n` real samples.
    fn to_real(n: usize, plain: bool) -> Arc<dyn ComplexToReal<Self>>;
}

macro_rules! transform {
    ($real:ty) => {
        impl Transform for $real {
            fn inverse(n: usize, plain: bool) -> Arc<dyn Fft<Self>> {
                if plain {
                    return plain::inverse(n);
                }
                rustfft::FftPlanner::<$real>::new().plan_fft_inverse(n)
            }
            fn to_real(n: usize, plain: bool) -> Arc<dyn ComplexToReal<Self>> {
                if plain {
                    return Arc::new(plain::ToReal::new(n));
                }
                realfft::RealFftPlanner::<$real>::new().plan_fft_inverse(n)
            }
        }
    };
}

transform!(f32);
transform!(f64);
