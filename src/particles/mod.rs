//! Sparse flakes in front of the texture (Langer 2004, sections 6 and 7).
//!
//! | module | what |
//! | --- | --- |
//! | [`torus`] | where the flakes are: stateless positions in a box that wraps |
//! | [`sprite`] | one flake's image: projection, near plane, size and amplitude |
//! | `project` | several flakes' images at once, by vectors |
//! | [`profile`] | the Gaussian with an end, and its motion blur |
//! | [`bins`] | which flakes touch which tile of the picture |
//! | [`balls`] | images of balls, integrated over pixels and along a way |
//! | [`draw`] | flakes drawn into one tile |
//! | [`sorted`] | flakes projected and sorted once, for pictures of any part of a frame |
//! | [`splat`] | the image of many flakes |
//! | `canvas` | what flakes are drawn on: transmittance, and which flake a pixel shows |
//! | [`closeup`] | near flakes with a shape, flakes out of focus, flakes in the light of lamps |

pub mod balls;
pub mod bins;
mod canvas;
pub mod closeup;
mod dim;
mod draw;
pub mod profile;
mod project;
pub mod sorted;
mod spare;
pub mod splat;
pub mod sprite;
mod streak;
pub mod torus;
