//! Vector instructions chosen at run time, so that a portable build is as fast as a native one.
//!
//! Kernels are plain generic loops over slices; [`dispatch`] compiles them once for each level and calls
//! the best that the processor has. Loops use [`multiply_add`], which is one
//! instruction with one rounding on both vector levels: these give the same bits. The portable level
//! rounds twice, so its last bits differ (see docs/internals/architecture.md).
//!
//! In the reproducible mode every level rounds twice: the portable arithmetic compiled for the vectors
//! that there are, and the same bits with all of them.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

pub use flurries_dispatch::dispatch;
use num_traits::Float;

use crate::base::error::Error;
use crate::base::scope::Scope;

/// The level that every processor of the target has.
pub const PORTABLE: u8 = 0;
/// AVX2 and FMA.
pub const AVX2: u8 = 1;
/// AVX-512 F, VL, DQ and BW.
pub const AVX512: u8 = 2;

/// The best level of this processor, or a lower one that FLURRIES_SIMD names.
pub fn level() -> u8 {
    static LEVEL: OnceLock<u8> = OnceLock::new();
    // The gate has refused what is no level.
    *LEVEL.get_or_init(|| environment().unwrap_or(AVX512).min(best()))
}

/// The level that FLURRIES_SIMD names; the highest where it is not set or empty.
pub fn environment() -> Result<u8, Error> {
    match &*std::env::var("FLURRIES_SIMD").unwrap_or_default() {
        "portable" => Ok(PORTABLE),
        "avx2" => Ok(AVX2),
        "" | "avx512" => Ok(AVX512),
        other => Err(Error::invalid(
            "FLURRIES_SIMD",
            format!("must be portable, avx2 or avx512, got {other:?}"),
        )),
    }
}

#[cfg(target_arch = "x86_64")]
fn best() -> u8 {
    let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    let avx512 = is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw");
    match (avx2, avx512) {
        (true, true) => AVX512,
        (true, false) => AVX2,
        _ => PORTABLE,
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn best() -> u8 {
    PORTABLE
}

/// What `set_reproducible` last said. 0: nothing yet, so as the environment says; 1: no; 2: yes.
static REPRODUCIBLE: AtomicU8 = AtomicU8::new(0);

/// Whether all levels give the same bits: what the call asks for, else what the process is set to;
/// FLURRIES_REPRODUCIBLE=1 sets it.
pub fn reproducible() -> bool {
    if let Some(asked) = Scope::now().reproducible {
        return asked;
    }
    match REPRODUCIBLE.load(Ordering::Relaxed) {
        0 => {
            let told = std::env::var("FLURRIES_REPRODUCIBLE").is_ok_and(|value| value == "1");
            set_reproducible(told);
            told
        }
        said => said == 2,
    }
}

/// Turns the mode of the process on or off, for kernels that start from now on.
pub fn set_reproducible(on: bool) {
    REPRODUCIBLE.store(if on { 2 } else { 1 }, Ordering::Relaxed);
}

/// `a * b + c`, fused where the level has the instruction. Elsewhere a fused call would go to a library
/// function, a hundred times slower than the loop around it.
#[inline(always)]
pub fn multiply_add<T: Float, const LEVEL: u8>(a: T, b: T, c: T) -> T {
    if LEVEL == PORTABLE { a * b + c } else { a.mul_add(b, c) }
}

/// Makes `$name` run its body, a kernel of a level, compiled for the best one. Functions take it by [`dispatch`].
macro_rules! dispatched {
    (
        $(#[$meta:meta])*
        $visibility:vis fn $name:ident<const $level:ident: u8 $(, $real:ident: $bound:path)*>
            ($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)? $body:block
    ) => {
        $(#[$meta])*
        #[allow(unsafe_code, reason = "what is compiled for a level may run where the level is there")]
        $visibility fn $name<$($real: $bound),*>($($argument: $type),*) $(-> $result)? {
            #[inline(always)]
            fn kernel<const $level: u8 $(, $real: $bound)*>($($argument: $type),*) $(-> $result)? $body
            #[cfg(target_arch = "x86_64")]
            {
                use $crate::base::simd::{AVX2, AVX512, PORTABLE};
                #[target_feature(enable = "avx2")]
                unsafe fn avx2_plain<$($real: $bound),*>($($argument: $type),*) $(-> $result)? {
                    kernel::<PORTABLE $(, $real)*>($($argument),*)
                }
                #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2")]
                unsafe fn avx512_plain<$($real: $bound),*>($($argument: $type),*) $(-> $result)? {
                    kernel::<PORTABLE $(, $real)*>($($argument),*)
                }
                #[target_feature(enable = "avx2,fma")]
                unsafe fn avx2<$($real: $bound),*>($($argument: $type),*) $(-> $result)? {
                    kernel::<AVX2 $(, $real)*>($($argument),*)
                }
                #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma")]
                unsafe fn avx512<$($real: $bound),*>($($argument: $type),*) $(-> $result)? {
                    kernel::<AVX512 $(, $real)*>($($argument),*)
                }
                let plain = $crate::base::simd::reproducible();
                // SAFETY: `level` has asked the processor for these instructions.
                unsafe {
                    match $crate::base::simd::level() {
                        AVX512 if plain => return avx512_plain::<$($real),*>($($argument),*),
                        AVX2 if plain => return avx2_plain::<$($real),*>($($argument),*),
                        AVX512 => return avx512::<$($real),*>($($argument),*),
                        AVX2 => return avx2::<$($real),*>($($argument),*),
                        _ => {}
                    }
                }
            }
            kernel::<{ $crate::base::simd::PORTABLE } $(, $real)*>($($argument),*)
        }
    };
}
pub(crate) use dispatched;
