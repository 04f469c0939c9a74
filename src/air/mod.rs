//! Sums of plane waves of vectors at many points: gusts and swirls (Langer 2004, section 8).

use ndarray::{ArrayView2, ArrayViewMut2, Axis};

use crate::base::error::{Cancel, Error, layout};
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::{dispatch, multiply_add};

/// Points that go through all waves together; their sums stay in the first cache.
const LANES: usize = 64;

/// Points of a task for the pool.
const RUN: usize = 4096;

/// Sums of at most this many numbers at each point.
pub const MOST_CHANNELS: usize = 15;

/// `out[i, c] = sum_m re[m, c] cos(2 pi k_m . p_i) - im[m, c] sin(2 pi k_m . p_i)`.
///
/// `points` is (n, 3); `k` (m, 3) in cycles per unit; `weights` (m, 2 c), the real parts first. Waves are
/// added in their order at each point, so that bits depend on neither threads nor the other points.
pub fn sum(
    mut out: ArrayViewMut2<'_, f64>,
    points: ArrayView2<'_, f64>,
    k: ArrayView2<'_, f64>,
    weights: ArrayView2<'_, f64>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (count, channels) = out.dim();
    if points.dim() != (count, 3) || k.ncols() != 3 {
        return Err(Error::invalid("points", "must be (n, 3)"));
    }
    if channels > MOST_CHANNELS || weights.dim() != (k.nrows(), 2 * channels) {
        return Err(Error::invalid("weights", "must have two numbers for each wave and channel"));
    }
    let (k, weights) = (k.to_slice().ok_or_else(layout)?, weights.to_slice().ok_or_else(layout)?);
    let tasks = out.axis_chunks_iter_mut(Axis(0), RUN).zip(points.axis_chunks_iter(Axis(0), RUN));
    pool::for_each(tasks, |(mut out, points)| {
        let mut places = [[0.0; LANES]; 3];
        let mut sums = [[0.0; LANES]; MOST_CHANNELS];
        for (mut out, points) in
            out.axis_chunks_iter_mut(Axis(0), LANES).zip(points.axis_chunks_iter(Axis(0), LANES))
        {
            cancel.check()?;
            for (lane, point) in points.rows().into_iter().enumerate() {
                for (axis, place) in places.iter_mut().enumerate() {
                    place[lane] = point[axis];
                }
            }
            add_waves(&places, k, weights, channels, &mut sums);
            for (lane, mut out) in out.rows_mut().into_iter().enumerate() {
                for (channel, out) in out.iter_mut().enumerate() {
                    *out = sums[channel][lane];
                }
            }
        }
        Ok(())
    })
}

#[dispatch]
fn add_waves<const LEVEL: u8>(
    places: &[[f64; LANES]; 3],
    k: &[f64],
    weights: &[f64],
    channels: usize,
    sums: &mut [[f64; LANES]; MOST_CHANNELS],
) {
    *sums = [[0.0; LANES]; MOST_CHANNELS];
    let (mut cosines, mut sines) = ([0.0; LANES], [0.0; LANES]);
    for (k, weights) in k.chunks_exact(3).zip(weights.chunks_exact(2 * channels)) {
        for lane in 0..LANES {
            let phase = multiply_add::<f64, LEVEL>(
                k[2],
                places[2][lane],
                multiply_add::<f64, LEVEL>(k[1], places[1][lane], k[0] * places[0][lane]),
            );
            let turned = f64::turn::<LEVEL>(phase - phase.round_ties_even());
            cosines[lane] = turned.re;
            sines[lane] = turned.im;
        }
        let (re, im) = weights.split_at(channels);
        for (sums, (&re, &im)) in sums.iter_mut().zip(re.iter().zip(im)) {
            for lane in 0..LANES {
                let part = multiply_add::<f64, LEVEL>(re, cosines[lane], sums[lane]);
                sums[lane] = multiply_add::<f64, LEVEL>(-im, sines[lane], part);
            }
        }
    }
}
