//! What a background's pixel can be: 8 and 16 bit integers of full scale 1, and floats as they are.

use crate::base::normal::{least, most};
use crate::base::real::Real;

/// One channel of a background's pixel.
pub trait Sample: Copy + PartialEq + Send + Sync {
    /// The precision that it is composited in.
    type Working: Real;
    /// What 1 of a layer is in the background's own values.
    const SCALE: f64;
    /// Whether it is a whole number, so neither infinite, nor NaN, nor minus zero.
    const INTEGER: bool;
    /// The value in the background's own units.
    fn load(self) -> Self::Working;
    /// Clipped and rounded to the nearest integer, ties to even; or a float as it is.
    fn store(value: Self::Working) -> Self;
    /// Pixels that hold single floats, as these.
    fn floats(_pixels: &mut [Self]) -> Option<&mut [f32]> {
        None
    }
}

macro_rules! integer_sample {
    ($integer:ty) => {
        impl Sample for $integer {
            type Working = f32;
            const SCALE: f64 = <$integer>::MAX as f64;
            const INTEGER: bool = true;
            #[inline(always)]
            fn load(self) -> f32 {
                f32::from(self)
            }
            #[inline(always)]
            fn store(value: f32) -> Self {
                // Added to 2^23 a float's last bits are its value rounded to the nearest integer, ties
                // to even: a conversion with a vector form, which the saturating cast has not.
                let clipped = least(most(value, 0.0), Self::SCALE as f32);
                (clipped + 8_388_608.0).to_bits() as Self
            }
        }
    };
}
integer_sample!(u8);
integer_sample!(u16);

macro_rules! float_sample {
    ($float:ty $(, $floats:item)?) => {
        impl Sample for $float {
            $($floats)?
            type Working = $float;
            const SCALE: f64 = 1.0;
            const INTEGER: bool = false;
            #[inline(always)]
            fn load(self) -> $float {
                self
            }
            #[inline(always)]
            fn store(value: $float) -> Self {
                value
            }
        }
    };
}
float_sample!(
    f32,
    fn floats(pixels: &mut [f32]) -> Option<&mut [f32]> {
        Some(pixels)
    }
);
float_sample!(f64);
