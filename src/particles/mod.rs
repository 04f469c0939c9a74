//! Sparse flakes in front of the texture (Langer 2004, sections 6 and 7).

pub mod balls;
pub mod bins;
mod canvas;
pub mod closeup;
mod draw;
pub mod profile;
pub mod sorted;
pub mod splat;
pub mod sprite;
mod streak;
pub mod torus;
