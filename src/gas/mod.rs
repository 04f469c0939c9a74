//! Gas as splatted Gaussian particles (Johnson and McAllister 2005).

pub mod batch;
mod beam;
pub mod cut;
pub mod draw;
pub mod footprint;
pub mod glow;
pub mod light;
pub mod picture;
pub mod ray;
pub mod rays;
pub mod slices;
pub mod splat;
pub mod sprite;
