//! flurries: falling snow synthesized in the frequency domain, with particles on top.
//!
//! The map. Kernels are pure functions on array views; they know nothing of Python, files or clocks.
//!
//! | module | what | source |
//! | --- | --- | --- |
//! | [`error`] | what a caller can do wrong; cancelling | |
//! | [`cover`] | which pixels an interval covers | |
//! | [`random`] | counter-based numbers | |
//! | [`pool`] | the thread pool, safe across fork | |
//! | [`scope`] | what one call asks for: threads, a mode | |
//! | [`scan`] | whether an array's numbers are in their range | |
//! | [`real`] | float32 and float64 pixels | |
//! | [`normal`] | the normal law on lanes | |
//! | [`simd`] | vector instructions chosen at run time | |
//! | [`aligned`] | buffers that start at a cache line | |
//! | [`lanes`] | vectors as values, for loops that need them | |
//! | [`spectral`] | the tent, the band, phases, tiles, one frame of the field | Langer 2004, sections 4-7 |
//! | [`particles`] | the box of flakes, their image | Langer 2004, sections 6-7 |
//! | [`air`] | plane waves of wind | Langer 2004, section 8 |
//! | [`cone`] | textures on a double cone around the camera | Wang 2004 |
//! | [`gas`] | splatted mist, fog and clouds | Johnson 2005 |
//! | [`frame`] | compositing | Langer 2004, Eq. 7 |
//! | [`snowfall`] | texture, flakes and veil over a picture in one pass | Langer 2004, Eq. 7 |
//! | `python` | the binding, behind the feature of that name | |

pub mod air;
pub mod aligned;
pub mod cone;
pub mod cover;
pub mod error;
pub mod frame;
pub mod gas;
pub mod lanes;
pub mod normal;
pub mod particles;
pub mod pool;
#[cfg(feature = "python")]
mod python;
pub mod random;
pub mod real;
pub mod scan;
pub mod scope;
pub mod simd;
pub mod snowfall;
pub mod spectral;
