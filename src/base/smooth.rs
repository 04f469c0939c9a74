//! The cubic by which things fade in and out.

use crate::base::real::Real;

/// 0 below 0, 1 above 1, and 3 t^2 - 2 t^3 between.
#[inline(always)]
pub fn smoothstep<T: Real>(t: T) -> T {
    let t = num_traits::clamp(t, T::zero(), T::one());
    t * t * (T::of(3.0) - T::of(2.0) * t)
}
