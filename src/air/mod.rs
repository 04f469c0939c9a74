//! The air itself: plane waves of wind.

pub mod waves;
