//! Snow over a background (Langer 2004, Eq. 7), a premultiplied layer over a background, and the
//! joint opacity of layers of one color.

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut2, ArrayViewMut3};
use num_traits::{Float, One, Zero};

use super::mix::{OneColor, dim, invert};
use super::sample::Sample;
use crate::base::error::{Cancel, Error, collected, layout};
use crate::base::pool;
use crate::base::real::Real;

/// Rows of an output with the matching rows of inputs, each a task of its own for the pool.
fn each_row<S: Sample, A: Sync + Send>(
    out: ArrayViewMut3<'_, S>,
    background: ArrayView3<'_, S>,
    layer: &[A],
    per_row: usize,
    cancel: &Cancel,
    work: impl Fn(&mut [S], &[S], &[A]) + Sync + Send,
) -> Result<(), Error> {
    let (_, width, channels) = out.dim();
    let background = background.to_slice().ok_or_else(layout)?;
    pool::for_each(pool::rows(out, pool::threads()), |(run, part)| {
        let (line, part) = (width * channels, part.into_slice().ok_or_else(layout)?);
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
    let alpha = alpha.to_slice().ok_or_else(layout)?;
    let color = OneColor::new(intensity, channels)?;
    each_row(out, background, alpha, width, cancel, |out, back, alpha| color.over(out, back, alpha))
}

/// A premultiplied RGBA layer (4 floats a pixel, full scale 1) over a background of 3 or 4 channels.
pub fn over<S: Sample, A: Real>(
    out: ArrayViewMut3<'_, S>,
    background: ArrayView3<'_, S>,
    layer: ArrayView3<'_, A>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (_, width, channels) = out.dim();
    let layer = layer.to_slice().ok_or_else(layout)?;
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

/// Opacity of several layers of one color together, behind a matte:
/// `(1 - (1 - haze) prod (1 - alpha_i)) (1 - matte)`. The order does not matter.
pub fn join<T: Real>(
    out: ArrayViewMut2<'_, T>,
    layers: &[ArrayView2<'_, T>],
    haze: f64,
    matte: Option<ArrayView2<'_, T>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let clear = T::of(1.0 - haze);
    let width = out.ncols();
    let mut planes = collected(layers.iter().map(|_| &[][..]))?;
    for (plane, layer) in planes.iter_mut().zip(layers) {
        *plane = layer.to_slice().ok_or_else(layout)?;
    }
    pool::for_each(pool::rows(out, pool::threads()), |(run, mut part)| {
        for (row, mut out) in run.zip(part.rows_mut()) {
            cancel.check()?;
            let out = out.as_slice_mut().ok_or_else(layout)?;
            out.fill(clear);
            planes.iter().for_each(|plane| dim(&plane[row * width..][..width], out));
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
