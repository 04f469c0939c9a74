//! The cubic by which things fade in and out.

use crate::base::real::Real;

/// 0 below 0, 1 above 1, and 3 t^2 - 2 t^3 between.
#[inline(always)]
pub fn smoothstep<T: Real>(t: T) -> T {
    let t = num_traits::clamp(t, T::zero(), T::one());
    t * t * (T::of(3.0) - T::of(2.0) * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_from_0_to_1_and_is_level_at_both_ends() {
        for (t, want) in
            [(-1.0, 0.0), (0.0, 0.0), (0.25, 0.15625), (0.5, 0.5), (1.0, 1.0), (9.0, 1.0)]
        {
            assert_eq!(smoothstep(t), want);
            assert_eq!(smoothstep(t as f32), want as f32);
        }
        assert!(smoothstep(1e-4) < 4e-8 && 1.0 - smoothstep(1.0 - 1e-4) < 4e-8);
        assert!(smoothstep(f64::NAN).is_nan());
    }
}
