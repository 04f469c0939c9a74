//! flurries: falling snow synthesized in the frequency domain, with particles on top.
//!
//! The map. Kernels are pure functions on array views; they know nothing of Python, files or clocks.
//! Arrows point down: `python` -> `frame` -> subjects -> `base`, and a subject never reads another.
//!
//! | folder | what | source |
//! | --- | --- | --- |
//! | [`base`] | errors, random numbers, threads, vectors: what every subject stands on | |
//! | [`spectral`] | the tent, the band, phases, tiles, one frame of the field | Langer 2004, sections 4-7 |
//! | [`particles`] | the box of flakes, their image | Langer 2004, sections 6-7 |
//! | [`falling`] | flakes that live in the world: cells, drawing, texture | |
//! | [`air`] | plane waves of wind | Langer 2004, section 8 |
//! | [`cone`] | textures on a double cone around the camera | Wang 2004 |
//! | [`gas`] | splatted mist, fog and clouds | Johnson 2005 |
//! | [`frame`] | compositing; mixing, light | Langer 2004, Eq. 7 |
//! | [`encode`] | half floats | |
//! | `python` | the binding, behind the feature of that name | |

#![deny(unsafe_code)]
// Without the binding only tests and benches call kernels.
#![cfg_attr(not(feature = "python"), allow(dead_code))]

mod air;
mod base;
mod cone;
mod encode;
mod falling;
mod frame;
mod gas;
mod particles;
#[cfg(feature = "python")]
mod python;
mod spectral;
