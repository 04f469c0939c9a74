//! What every subject stands on.
//!
//! | module | what |
//! | --- | --- |
//! | [`error`] | what a caller can do wrong; cancelling |
//! | [`random`] | counter-based numbers |
//! | [`pool`] | the thread pool, safe across fork |
//! | [`scope`] | what one call asks for: threads, a mode |
//! | [`aligned`] | buffers that start at a cache line |
//! | [`ball`] | the opacity of a flake: a ball of even density |
//! | [`cover`] | which pixels an interval covers |
//! | [`smooth`] | the cubic by which things fade |
//! | [`sampling`] | Gaussians sampled at pixel centres |
//! | [`scan`] | whether an array's numbers are in their range |
//! | [`real`] | float32 and float64 pixels |
//! | [`normal`] | the normal law on lanes |
//! | [`simd`] | vector instructions chosen at run time |
//! | [`lanes`] | vectors as values, for loops that need them |

pub mod aligned;
pub mod ball;
pub mod cover;
pub mod error;
pub mod lamps;
pub mod lanes;
pub mod normal;
pub mod pool;
pub mod random;
pub mod real;
pub mod sampling;
pub mod scan;
pub mod scope;
pub mod simd;
pub mod smooth;
