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
//! | [`tile`] | toroidal textures of drops and flakes |

pub mod area;
pub mod basis;
pub mod chart;
pub mod layer;
pub mod sheet;
pub mod stack;
pub mod table;
pub mod tile;
pub mod view;
