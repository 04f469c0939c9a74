//! Snow over a background (Langer 2004, Eq. 7), a premultiplied layer over a background, and the
//! joint opacity of layers of one colour.

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut2, ArrayViewMut3, Axis};
use num_traits::{Float, One, Zero};

use super::sample::Sample;
use crate::error::{Cancel, Error, collected};
use crate::pool;
use crate::real::Real;
use crate::simd::dispatch;

/// `colour * alpha + (1 - alpha) * background`, exact at both ends: alpha 0 is the background's bits
/// and alpha 1 the colour's. A NaN of the background stays, whatever covers it.
#[inline]
fn mix<T: Real>(background: T, colour: T, alpha: T) -> T {
    let mixed = colour * alpha + (T::one() - alpha) * background;
    if alpha == T::zero() {
        background
    } else if alpha == T::one() && !background.is_nan() {
        colour
    } else {
        mixed
    }
}

/// Rows of an output with the matching rows of inputs, each a task of its own for the pool.
fn each_row<'o, S: Sample, A: Sync + Send>(
    out: ArrayViewMut3<'o, S>,
    background: ArrayView3<'_, S>,
    layer: &[A],
    per_row: usize,
    cancel: &Cancel,
    work: impl Fn(&mut [S], &[S], &[A]) + Sync + Send,
) -> Result<(), Error> {
    let layout = || Error::Internal("rows are not contiguous".into());
    let (height, width, channels) = out.dim();
    let out = out.into_slice().ok_or_else(layout)?;
    let background = background.to_slice().ok_or_else(layout)?;
    let mut tasks = Vec::new();
    let mut rest: &'o mut [S] = out;
    for run in pool::split(height, pool::threads()) {
        let (part, later) = rest.split_at_mut(run.len() * width * channels);
        tasks.push((run, part));
        rest = later;
    }
    pool::for_each(tasks, |(run, part)| {
        let line = width * channels;
        for (row, out) in run.zip(part.chunks_mut(line)) {
            cancel.check()?;
            work(out, &background[row * line..][..line], &layer[row * per_row..][..per_row]);
        }
        Ok(())
    })
}

/// Eq. 7 in the background's own values, for one channel or three; `intensity` has one entry per
/// channel, as a fraction of full scale.
pub fn snow<S: Sample, A: Real>(
    out: ArrayViewMut3<'_, S>,
    background: ArrayView3<'_, S>,
    alpha: ArrayView2<'_, A>,
    intensity: &[f64],
    cancel: &Cancel,
) -> Result<(), Error> {
    let (_, width, channels) = out.dim();
    let alpha = alpha.to_slice().ok_or_else(|| Error::Internal("layout".into()))?;
    let colour = OneColour::new(intensity, channels)?;
    each_row(out, background, alpha, width, cancel, |out, back, alpha| {
        colour.over(out, back, alpha)
    })
}

/// One colour laid over pixels of one channel or three (Eq. 7).
pub struct OneColour<S: Sample> {
    // The colour of a block of pixels, channel by channel: one loop over channels alike vectorises,
    // where a loop over pixels of three does not.
    values: Vec<S::Working>,
    channels: usize,
}

impl<S: Sample> OneColour<S> {
    /// The colour with one entry of `intensity` per channel, as a fraction of full scale.
    pub fn new(intensity: &[f64], channels: usize) -> Result<Self, Error> {
        if (channels != 1 && channels != 3) || intensity.len() != channels {
            let message = format!(
                "must have one channel or three, as the colour has, got {channels} and {}",
                intensity.len()
            );
            return Err(Error::invalid("background", message));
        }
        let value = |i: usize| <S::Working as Real>::of(intensity[i % channels] * S::SCALE);
        Ok(Self { values: collected((0..BLOCK * channels).map(value))?, channels })
    }

    /// Writes `colour * alpha + (1 - alpha) * background`, with one alpha per pixel.
    pub fn over<A: Real>(&self, out: &mut [S], background: &[S], alpha: &[A]) {
        let size = BLOCK * self.channels;
        // On the stack: rows must not allocate.
        let mut own = [S::Working::zero(); BLOCK];
        let blocks = out.chunks_mut(size).zip(background.chunks(size));
        for ((out, back), alpha) in blocks.zip(alpha.chunks(BLOCK)) {
            for (own, alpha) in own.iter_mut().zip(alpha) {
                *own = S::Working::of(alpha.wide());
            }
            let alpha = &own[..alpha.len()];
            if self.channels == 3 {
                mix_three::<S>(out, back, &self.values, alpha);
            } else {
                mix_row::<S>(out, back, &self.values, alpha);
            }
        }
    }
}

/// Pixels that are mixed at once; their work space stays in the first cache.
pub const BLOCK: usize = 256;

#[inline(always)]
fn mix_three_with<S: Sample, const LEVEL: u8>(
    out: &mut [S],
    background: &[S],
    colour: &[S::Working],
    alpha: &[S::Working],
) {
    let mut spread = [S::Working::zero(); 3 * BLOCK];
    for (spread, &alpha) in spread.chunks_exact_mut(3).zip(alpha) {
        spread[0] = alpha;
        spread[1] = alpha;
        spread[2] = alpha;
    }
    mix_row_with::<S, LEVEL>(out, background, colour, &spread);
}

dispatch! {
    fn mix_three<S: Sample>(
        out: &mut [S],
        background: &[S],
        colour: &[S::Working],
        alpha: &[S::Working],
    ) = mix_three_with
}

#[inline(always)]
fn mix_row_with<S: Sample, const LEVEL: u8>(
    out: &mut [S],
    background: &[S],
    colour: &[S::Working],
    alpha: &[S::Working],
) {
    let n = out.len();
    let (background, colour, alpha) = (&background[..n], &colour[..n], &alpha[..n]);
    for i in 0..n {
        out[i] = S::store(mix(background[i].load(), colour[i], alpha[i]));
    }
}

dispatch! {
    fn mix_row<S: Sample>(
        out: &mut [S],
        background: &[S],
        colour: &[S::Working],
        alpha: &[S::Working],
    ) = mix_row_with
}

/// A premultiplied RGBA layer (4 floats a pixel, full scale 1) over a background of 3 or 4 channels.
pub fn over<S: Sample, A: Real>(
    out: ArrayViewMut3<'_, S>,
    background: ArrayView3<'_, S>,
    layer: ArrayView3<'_, A>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (_, width, channels) = out.dim();
    let layer = layer.to_slice().ok_or_else(|| Error::Internal("layout".into()))?;
    let scale = <S::Working as Real>::of(S::SCALE);
    each_row(out, background, layer, width * 4, cancel, |out, back, layer| {
        let pixels = out.chunks_mut(channels).zip(back.chunks(channels));
        for ((out, back), layer) in pixels.zip(layer.chunks(4)) {
            let through = <S::Working as Real>::of(1.0 - layer[3].wide());
            for ((out, &back), layer) in out.iter_mut().zip(back).zip(layer) {
                let light = <S::Working as Real>::of(layer.wide());
                // An empty layer leaves the bits alone, those of minus zero and infinity too.
                *out = if light == S::Working::zero() && through == S::Working::one() {
                    back
                } else if through == S::Working::zero() && !back.load().is_nan() {
                    // Opaque hides an infinite background as well.
                    S::store(light * scale)
                } else {
                    S::store(light * scale + through * back.load())
                };
            }
        }
    })
}

/// Opacity of several layers of one colour together, behind a matte:
/// `(1 - (1 - haze) prod (1 - alpha_i)) (1 - matte)`. The order does not matter.
pub fn join<T: Real>(
    mut out: ArrayViewMut2<'_, T>,
    layers: &[ArrayView2<'_, T>],
    haze: f64,
    matte: Option<ArrayView2<'_, T>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let clear = T::of(1.0 - haze);
    let layout = || Error::Internal("rows are not contiguous".into());
    let width = out.ncols();
    let mut tasks = Vec::new();
    for run in pool::split(out.nrows(), pool::threads()) {
        let (part, rest) = out.split_at(Axis(0), run.len());
        out = rest;
        tasks.push((run, part));
    }
    pool::for_each(tasks, |(run, mut part): (std::ops::Range<usize>, ArrayViewMut2<'_, T>)| {
        for (row, mut out) in run.zip(part.rows_mut()) {
            cancel.check()?;
            let out = out.as_slice_mut().ok_or_else(layout)?;
            out.fill(clear);
            for layer in layers {
                let layer = layer.row(row);
                dim(layer.as_slice().ok_or_else(layout)?, out);
            }
            invert(out);
            if let Some(matte) = &matte {
                for (alpha, &matte) in out.iter_mut().zip(matte.row(row)).take(width) {
                    *alpha *= T::one() - matte;
                }
            }
        }
        Ok(())
    })
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
    use ndarray::{Array2, Array3};

    #[test]
    fn the_ends_are_exact_and_nan_stays() {
        assert_eq!(mix(-0.0_f32, 1.0, 0.0).to_bits(), (-0.0_f32).to_bits());
        assert_eq!(mix(f64::INFINITY, 0.5, 1.0), 0.5);
        assert_eq!(mix(f64::INFINITY, 0.5, 0.0), f64::INFINITY);
        assert!(mix(f32::NAN, 0.5, 1.0).is_nan());
    }

    #[test]
    fn integers_round_to_the_nearest() {
        let background = Array3::from_elem((1, 1, 3), 100_u8);
        let alpha = Array2::from_elem((1, 1), 0.5_f32);
        let mut out = Array3::zeros((1, 1, 3));
        let white = [250.0 / 255.0, 1.0, 0.0];
        snow(out.view_mut(), background.view(), alpha.view(), &white, &Cancel::new()).unwrap();
        assert_eq!(out.as_slice().unwrap(), [175, 178, 50]);
    }

    #[test]
    fn layers_join_in_any_order() {
        let layer = |a: f64| Array2::from_elem((2, 3), a);
        let (a, b, matte) = (layer(0.25), layer(0.5), layer(0.5));
        let mut out = layer(f64::NAN);
        let views = [a.view(), b.view()];
        join(out.view_mut(), &views, 0.2, Some(matte.view()), &Cancel::new()).unwrap();
        assert!(out.iter().all(|&v| (v - (1.0 - 0.8 * 0.75 * 0.5) * 0.5).abs() < 1e-15));
    }
}
