//! Textures on a double cone around the camera (Wang 2004).

pub mod area;
pub mod basis;
pub mod chart;
pub mod layer;
pub mod sheet;
pub mod stack;
pub mod table;
pub mod tile;
pub mod view;
