//! The texture of flakes: the waves of a tile have the phases of flakes at Poisson places.
//!
//! A layer of depth has some patterns, the spectra of flakes on a sheared torus ([`pattern`]). A frame
//! sums a pattern of each layer, each moved as its layer moves ([`product`]), transforms the sum to a
//! tile of optical depth and blends the tiles ([`frame`]).
//!
//! The torus has the lattice (M, 0), (h, M): a flake that leaves below comes in above h px to the side.
//! Its waves are k = (a, b - shear a) / M cycles per pixel, shear = h / M, y down.

pub mod blur;
pub mod frame;
pub mod pattern;
pub mod prepared;
pub mod product;
