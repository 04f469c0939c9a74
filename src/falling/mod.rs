//! Flakes and drops that live in the world: near ones drawn, far ones a texture, one population.
//!
//! | module | what |
//! | --- | --- |
//! | [`ball`] | the opacity of a flake: a ball of even density |

pub mod ball;
