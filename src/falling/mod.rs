//! Flakes and drops that live in the world: near ones drawn, far ones a texture, one population.

pub mod air;
pub mod bent;
pub mod blur;
pub mod cells;
pub mod draw;
mod factor;
pub mod gains;
pub mod law;
pub mod layers;
pub mod list;
pub mod notes;
pub mod sheet;
pub mod sight;
pub mod stamp;
