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

/// What the loops may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// What every processor of the target has.
    Portable,
    Avx2,
    Avx512,
}

/// The best level of this processor, or a lower one that FLURRIES_SIMD names.
pub fn level() -> Level {
    static LEVEL: OnceLock<Level> = OnceLock::new();
    // The gate has refused what is no level.
    *LEVEL.get_or_init(|| match environment() {
        Ok(Some(Level::Portable)) => Level::Portable,
        Ok(Some(Level::Avx2)) if best() == Level::Avx512 => Level::Avx2,
        _ => best(),
    })
}

/// The level that FLURRIES_SIMD names; None where it is not set or empty.
pub fn environment() -> Result<Option<Level>, Error> {
    parsed(std::env::var("FLURRIES_SIMD").ok().as_deref())
}

fn parsed(value: Option<&str>) -> Result<Option<Level>, Error> {
    match value {
        None | Some("") => Ok(None),
        Some("portable") => Ok(Some(Level::Portable)),
        Some("avx2") => Ok(Some(Level::Avx2)),
        Some("avx512") => Ok(Some(Level::Avx512)),
        Some(other) => Err(Error::invalid(
            "FLURRIES_SIMD",
            format!("must be portable, avx2 or avx512, got {other:?}"),
        )),
    }
}

#[cfg(target_arch = "x86_64")]
fn best() -> Level {
    let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    let avx512 = is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw");
    match (avx2, avx512) {
        (true, true) => Level::Avx512,
        (true, false) => Level::Avx2,
        _ => Level::Portable,
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn best() -> Level {
    Level::Portable
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

/// [`Level::Portable`] as a kernel's constant.
pub const PORTABLE: u8 = 0;
pub const AVX2: u8 = 1;
pub const AVX512: u8 = 2;

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
                use $crate::base::simd::{AVX2, AVX512, Level, PORTABLE};
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
                        Level::Avx512 if plain => return avx512_plain::<$($real),*>($($argument),*),
                        Level::Avx2 if plain => return avx2_plain::<$($real),*>($($argument),*),
                        Level::Avx512 => return avx512::<$($real),*>($($argument),*),
                        Level::Avx2 => return avx2::<$($real),*>($($argument),*),
                        Level::Portable => {}
                    }
                }
            }
            kernel::<{ $crate::base::simd::PORTABLE } $(, $real)*>($($argument),*)
        }
    };
}
pub(crate) use dispatched;
