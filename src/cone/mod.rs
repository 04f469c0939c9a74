//! Textures on a double cone around the camera (Wang 2004).
//!
//! | module | what |
//! | --- | --- |
//! | [`basis`] | two directions across the cone's axis, by the smallest rotation |
//! | [`view`] | a pixel's azimuth, height, footprint and fade |
//! | [`area`] | the summed-area table of a toroidal texture, and its exact box |
//! | [`layer`] | one texture on the cone |
//! | [`chart`] | azimuth and height of every pixel as fractions of a tile, kept while the camera is still |
//! | [`sheet`] | one layer of several, and filtered textures by level |
//! | [`table`] | a texture, filtered for one size of footprint |
//! | [`stack`] | several layers from one chart |
//! | [`square`] | a chart by squares of pixels |
//! | [`window`] | look-ups for a square without gathers |
//! | [`tile`] | toroidal textures of drops and flakes |

pub mod area;
pub mod basis;
pub mod chart;
pub mod layer;
pub mod sheet;
pub mod square;
pub mod stack;
pub mod table;
pub mod tile;
pub mod view;
#[cfg_attr(
    not(target_arch = "x86_64"),
    allow(unused, reason = "of use with the instructions of one kind of processor")
)]
pub mod window;
