//! Layers over a background: Langer 2004, Eq. 7, and premultiplied over.

pub mod boxes;
pub mod coding;
pub mod composite;
pub mod grid;
pub mod mix;
pub mod plate;
pub mod sample;
pub mod shade;
pub mod shown;
pub mod veil;
