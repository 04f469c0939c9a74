//! One color laid over pixels (Langer 2004, Eq. 7), and the joint opacity of what lies over them.

#![expect(unsafe_code, reason = "rows of pixels by `Lanes`")]

use num_traits::{One, Zero};

use super::sample::{Sample, Samples};
use crate::base::error::{Error, collected};
use crate::base::real::Real;
use crate::base::simd::{AVX2, AVX512, dispatch};

/// `color * alpha + (1 - alpha) * background`, exact at both ends: alpha 0 is the background's bits
/// and alpha 1 the color's. A NaN of the background stays, whatever covers it.
#[inline(always)]
fn mix<T: Real>(background: T, color: T, alpha: T) -> T {
    let mixed = color * alpha + (T::one() - alpha) * background;
    if alpha == T::zero() {
        background
    } else if alpha == T::one() && !background.is_nan() {
        color
    } else {
        mixed
    }
}

/// One color laid over pixels of one channel or three.
pub struct OneColor<S: Sample> {
    // The color of a block of pixels, channel by channel: with one loop over channels alike a vector
    // holds whatever channels come next.
    values: Vec<S::Working>,
    channels: usize,
}

/// Pixels that are mixed at once, a multiple of all vectors; their work space stays in the first cache.
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
        for ((out, back), alpha) in blocks.zip(alpha.chunks(BLOCK)) {
            if let Some(alpha) = S::Working::own(alpha) {
                mix_pixels(out, back, &self.values, alpha, self.channels);
            } else {
                // On the stack: rows must not allocate.
                let mut own = [S::Working::zero(); BLOCK];
                for (own, alpha) in own.iter_mut().zip(alpha) {
                    *own = S::Working::of(alpha.wide());
                }
                mix_pixels(out, back, &self.values, &own[..alpha.len()], self.channels);
            }
        }
    }
}

/// Lays a color for each value over pixels, with one alpha per pixel.
#[dispatch]
pub fn mix_pixels<const LEVEL: u8, S: Sample>(
    out: &mut [S],
    background: &[S],
    color: &[S::Working],
    alpha: &[S::Working],
    channels: usize,
) {
    match (LEVEL, channels) {
        (AVX512, 3) => pixels::<S, S::Avx512, 3>(out, background, color, alpha),
        (AVX512, _) => pixels::<S, S::Avx512, 1>(out, background, color, alpha),
        (AVX2, 3) => pixels::<S, S::Avx2, 3>(out, background, color, alpha),
        (AVX2, _) => pixels::<S, S::Avx2, 1>(out, background, color, alpha),
        (_, 3) => pixels::<S, S::Portable, 3>(out, background, color, alpha),
        _ => pixels::<S, S::Portable, 1>(out, background, color, alpha),
    }
}

#[inline(always)]
fn pixels<S: Sample, V: Samples<S>, const CHANNELS: usize>(
    out: &mut [S],
    background: &[S],
    color: &[S::Working],
    alpha: &[S::Working],
) {
    let count = alpha.len();
    let (out, background) = (&mut out[..CHANNELS * count], &background[..CHANNELS * count]);
    let color = &color[..CHANNELS * count];
    let whole = count / V::N * V::N;
    for pixel in (0..whole).step_by(V::N) {
        // SAFETY: `pixel` and the N behind it are before `count`, and all else is CHANNELS times as
        // long; the caller is compiled for the vectors' level.
        unsafe {
            let alpha = V::load(alpha.as_ptr().add(pixel));
            let alpha = if CHANNELS == 3 { alpha.thrice() } else { [alpha; 3] };
            for (part, &alpha) in alpha.iter().enumerate().take(CHANNELS) {
                let at = CHANNELS * pixel + part * V::N;
                let behind = V::read(background.as_ptr().add(at));
                let color = V::load(color.as_ptr().add(at));
                let (zero, one) = (V::splat(S::Working::zero()), V::splat(S::Working::one()));
                let mut mixed = color.mul(alpha).add(one.sub(alpha).mul(behind));
                // Whole numbers are exact at both ends without more care.
                if !S::INTEGER {
                    let opaque = behind.replaced(behind, behind, color);
                    mixed = mixed.replaced(alpha, one, opaque).replaced(alpha, zero, behind);
                }
                mixed.write(out.as_mut_ptr().add(at));
            }
        }
    }
    for i in CHANNELS * whole..CHANNELS * count {
        out[i] = S::store(mix(background[i].load(), color[i], alpha[i / CHANNELS]));
    }
}

/// What is left of the light behind one more layer.
#[dispatch]
pub fn dim<const LEVEL: u8, T: Real>(alpha: &[T], through: &mut [T]) {
    for (through, &alpha) in through.iter_mut().zip(alpha) {
        *through *= T::one() - alpha;
    }
}

/// Transmittance to opacity, or back.
#[dispatch]
pub fn invert<const LEVEL: u8, T: Real>(values: &mut [T]) {
    for value in values {
        *value = T::one() - *value;
    }
}
