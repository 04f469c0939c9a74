//! Flakes and drops near the camera, which have a shape, and those out of focus, which have a disc.
//!
//! What is small and sharp stays a sprite, what is large or out of focus becomes a [`patch::Patch`], a small picture of
//! its opacity. Between the two a flake is part one and part the other, and its energy (opacity summed over pixels)
//! is always that of its sprite.

pub mod aperture;
pub mod bank;
pub mod lit;
pub mod near;
pub mod patch;
pub mod shape;
pub mod spread;
