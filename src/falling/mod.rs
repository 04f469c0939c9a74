//! Flakes and drops that live in the world: near ones drawn, far ones a texture, one population.
//!
//! | module | what |
//! | --- | --- |
//! | [`ball`] | the opacity of a flake: a ball of even density |
//! | [`layers`] | sheets read into a picture |
//! | [`sheet`] | far flakes of a layer on a torus |
//! | `stamp` | what a flake of a sheet adds to pixels |

pub mod ball;
pub mod layers;
pub mod sheet;
mod stamp;
