//! Flakes and drops that live in the world: near ones drawn, far ones a texture, one population.
//!
//! | module | what |
//! | --- | --- |
//! | [`law`] | how large flakes are, and how many of them show |
//! | [`cells`] | where flakes are: hashes of a cell of the air |
//! | [`air`] | a frame's request: classes of size, the eye at several times, the wind |
//! | [`sight`] | which cells the view sees |
//! | [`list`] | the flakes of a frame, evaluated at its times |
//! | [`draw`] | their images |
//! | [`sheet`] | far flakes of a layer on a torus |
//! | `stamp` | what a flake of a sheet adds to pixels |
//! | [`layers`] | sheets read into a picture whose places all move alike |
//! | [`bent`] | the same where they don't |

pub mod air;
pub mod bent;
pub mod cells;
pub mod draw;
pub mod law;
pub mod layers;
pub mod list;
pub mod sheet;
pub mod sight;
mod stamp;
