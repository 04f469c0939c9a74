//! What every subject stands on.

pub mod aligned;
pub mod ball;
pub mod error;
pub mod lamps;
pub mod lanes;
pub mod normal;
pub mod pixel;
pub mod pool;
pub mod random;
pub mod real;
pub mod scan;
pub mod scope;
pub mod simd;
