//! Gas as splatted Gaussian particles (Johnson and McAllister 2005).
//!
//! | module | what |
//! | --- | --- |
//! | [`footprint`] | the kernel's image along one axis: point, pixel box, table; its end |
//! | [`sprite`] | one particle's image: projection, size, near plane, bounds |
//! | [`rays`] | the rays of samples, and how they pass a particle |
//! | [`cut`] | what the near plane and what stands in the picture leave of a particle |
//! | [`ray`] | opacities along rays, drawn row by row |
//! | `lattice` | particles that change slowly: drawn on few samples, from which pixels follow |
//! | [`bins`] | which particles touch which band of the picture |
//! | [`draw`] | particles drawn into one tile |
//! | `batch` | the same for a few at a time, products of two vectors |
//! | [`cloud`] | particles as arrays, and what is refused of them |
//! | [`picture`] | the tiles of a picture, their buffers and pixels |
//! | [`splat`] | the image of many particles |
//! | [`light`] | how much light of a direction reaches each particle |
//! | [`slices`] | the optical depth of a bank, whose density is known on a coarse grid |

mod batch;
pub mod bins;
pub mod cloud;
pub mod cut;
pub mod draw;
pub mod footprint;
mod lattice;
pub mod light;
pub mod picture;
pub mod ray;
pub mod rays;
pub mod slices;
pub mod splat;
pub mod sprite;
