//! Pixels as files hold them, where a library's own way is slow: half floats, and the rows of a PNG.

pub mod half;
pub mod png;
