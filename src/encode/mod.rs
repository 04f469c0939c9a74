//! Pixels as files hold them, where a library's own way is slow: half floats.

pub mod half;
