//! One color laid over pixels (Langer 2004, Eq. 7), and the joint opacity of what lies over them.

use num_traits::{Float, One, Zero};

use super::sample::Sample;
use crate::base::error::{Error, collected};
use crate::base::real::Real;
use crate::base::simd::dispatch;

/// `color * alpha + (1 - alpha) * background`, exact at both ends: alpha 0 is the background's bits
/// and alpha 1 the color's. A NaN of the background stays, whatever covers it.
#[inline(always)]
fn mix<S: Sample>(pixel: S, color: S::Working, alpha: S::Working) -> S {
    let (zero, one) = (S::Working::zero(), S::Working::one());
    let background = pixel.load();
    let mixed = color * alpha + (one - alpha) * background;
    // Whole numbers are exact at both ends without more care.
    if S::INTEGER {
        return S::store(mixed);
    }
    let mixed = if (alpha == one) & !background.is_nan() { color } else { mixed };
    S::store(if alpha == zero { background } else { mixed })
}

/// One color laid over pixels of one channel or three.
pub struct OneColor<S: Sample> {
    // The color of a block of pixels, channel by channel: with one loop over channels alike a vector
    // holds whatever channels come next.
    values: Vec<S::Working>,
    channels: usize,
}

/// Pixels that are mixed at once; their work space stays in the first cache.
const BLOCK: usize = 256;

impl<S: Sample> OneColor<S> {
    /// The color with one entry of `intensity` per channel, as a fraction of full scale.
    pub fn new(intensity: &[f64], channels: usize) -> Result<Self, Error> {
        if (channels != 1 && channels != 3) || intensity.len() != channels {
            let message = format!(
                "must have one channel or three, as the color has, got {channels} and {}",
                intensity.len()
            );
            return Err(Error::invalid("background", message));
        }
        let value = |i: usize| <S::Working as Real>::of(intensity[i % channels] * S::SCALE);
        Ok(Self { values: collected((0..BLOCK * channels).map(value))?, channels })
    }

    /// Writes `color * alpha + (1 - alpha) * background`, with one alpha per pixel.
    pub fn over<A: Real>(&self, out: &mut [S], background: &[S], alpha: &[A]) {
        let size = BLOCK * self.channels;
        let blocks = out.chunks_mut(size).zip(background.chunks(size));
        // On the stack: rows must not allocate.
        let mut wide = [S::Working::zero(); 3 * BLOCK];
        for ((out, back), alpha) in blocks.zip(alpha.chunks(BLOCK)) {
            blend(out, back, &self.values, alpha, &mut wide);
        }
    }
}

#[inline(always)]
fn blend_with<S: Sample, A: Real, const LEVEL: u8>(
    out: &mut [S],
    background: &[S],
    color: &[S::Working],
    alpha: &[A],
    wide: &mut [S::Working; 3 * BLOCK],
) {
    let n = out.len();
    if n == 3 * alpha.len() {
        for (wide, alpha) in wide.as_chunks_mut::<3>().0.iter_mut().zip(alpha) {
            *wide = [S::Working::of(alpha.wide()); 3];
        }
    } else {
        for (wide, alpha) in wide.iter_mut().zip(alpha) {
            *wide = S::Working::of(alpha.wide());
        }
    }
    let (background, color, wide) = (&background[..n], &color[..n], &wide[..n]);
    for i in 0..n {
        out[i] = mix(background[i], color[i], wide[i]);
    }
}

dispatch! {
    /// Lays a color over a block, channel by channel.
    fn blend<S: Sample, A: Real>(
        out: &mut [S],
        background: &[S],
        color: &[S::Working],
        alpha: &[A],
        wide: &mut [S::Working; 3 * BLOCK],
    ) = blend_with
}

#[inline(always)]
fn joint_with<T: Real, const LEVEL: u8>(out: &mut [T], clear: T, alpha: &[T], more: Option<&[T]>) {
    let (n, one) = (out.len(), T::one());
    let alpha = &alpha[..n];
    match more {
        Some(more) => {
            let more = &more[..n];
            for i in 0..n {
                out[i] = one - clear * (one - alpha[i]) * (one - more[i]);
            }
        }
        None => {
            for i in 0..n {
                out[i] = one - clear * (one - alpha[i]);
            }
        }
    }
}

dispatch! {
    /// `1 - clear (1 - alpha) (1 - more)`: two layers and an even veil together.
    pub fn joint<T: Real>(out: &mut [T], clear: T, alpha: &[T], more: Option<&[T]>) = joint_with
}

#[inline(always)]
fn dim_with<T: Real, const LEVEL: u8>(alpha: &[T], through: &mut [T]) {
    for (through, &alpha) in through.iter_mut().zip(alpha) {
        *through *= T::one() - alpha;
    }
}

#[inline(always)]
fn invert_with<T: Real, const LEVEL: u8>(values: &mut [T]) {
    for value in values {
        *value = T::one() - *value;
    }
}

dispatch! {
    /// What is left of the light behind one more layer.
    pub fn dim<T: Real>(alpha: &[T], through: &mut [T]) = dim_with
}

dispatch! {
    /// Transmittance to opacity, or back.
    pub fn invert<T: Real>(values: &mut [T]) = invert_with
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_are_exact_and_nan_stays() {
        assert_eq!(mix(-0.0_f32, 1.0, 0.0).to_bits(), (-0.0_f32).to_bits());
        assert_eq!(mix(f64::INFINITY, 0.5, 1.0), 0.5);
        assert_eq!(mix(f64::INFINITY, 0.5, 0.0), f64::INFINITY);
        assert!(mix(f32::NAN, 0.5, 1.0).is_nan());
        assert_eq!((mix(255_u8, 9.5, 1.0), mix(65535_u16, 1e9, 0.0)), (10, 65535));
    }
}
