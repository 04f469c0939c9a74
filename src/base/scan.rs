//! A look at all numbers of an array, before a kernel trusts them.

use crate::base::real::Real;
use crate::base::simd::dispatch;

/// Numbers between two looks at whether the answer is known.
const RUN: usize = 1 << 12;

/// Whether all numbers are in `low..=high`; NaN is in no interval.
pub fn all_within<T: Real>(values: &[T], low: T, high: T) -> bool {
    values.chunks(RUN).all(|run| within(run, low, high))
}

#[dispatch]
fn within<const LEVEL: u8, T: Real>(values: &[T], low: T, high: T) -> bool {
    // Without an early end the loop is two comparisons of vectors.
    values.iter().fold(true, |all, &value| all & (value >= low) & (value <= high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_outside_is_found_anywhere() {
        for count in [1, 7, RUN, 3 * RUN + 5] {
            let mut values = vec![0.5_f32; count];
            (values[0], values[count - 1]) = (0.0, 1.0);
            assert!(all_within(&values, 0.0, 1.0));
            for place in [0, count / 2, count - 1] {
                let kept = values[place];
                for bad in [f32::NAN, -1e-30, 1.0 + f32::EPSILON, f32::INFINITY] {
                    values[place] = bad;
                    assert!(!all_within(&values, 0.0, 1.0), "{bad} at {place} of {count}");
                }
                values[place] = kept;
            }
        }
        assert!(all_within::<f64>(&[], 0.0, 1.0));
    }
}
