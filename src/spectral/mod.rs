//! Falling snow as a texture whose spectrum lies on the tent surface (Langer 2004, sections 4-7).
//!
//! One frame is `z(x, y) = sum_k amplitude(k) cos 2 pi (f_k . (x, y) + phase(k))` over signed
//! frequencies `f_k = k / M` in cycles per pixel, y down. Phases are in cycles; transforms are
//! unnormalised sums; amplitudes have squares that sum to 1, so that the field has variance 1.
//!
//! [`field`] makes a whole frame; the other modules are its steps, for experiments and as judges.

pub mod band;
pub mod carry;
pub mod cosines;
pub mod dense;
pub mod field;
pub mod filter;
pub mod flakes;
pub mod grid;
pub mod lift;
pub mod opacity;
pub mod spectrum;
pub mod stripes;
pub mod tent;
pub mod tile;
pub mod tiles;
pub mod transform;
pub mod volume;
pub mod waves;
