//! Flakes and drops that live in the world: near ones drawn, far ones a texture, one population.
//!
//! | module | what |
//! | --- | --- |

pub mod air;
pub mod cells;
pub mod draw;
pub mod law;
pub mod list;
pub mod sight;
