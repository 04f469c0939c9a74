//! Gas as splatted Gaussian particles (Johnson and McAllister 2005).

mod batch;
pub mod cloud;
pub(crate) mod cut;
pub(crate) mod draw;
pub mod footprint;
mod lattice;
pub(crate) mod light;
pub(crate) mod picture;
pub(crate) mod ray;
pub(crate) mod rays;
pub(crate) mod slices;
pub mod splat;
pub mod sprite;
