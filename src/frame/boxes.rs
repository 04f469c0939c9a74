//! What weather hides of boxes: means over all that each covers, parts of pixels as parts.

use ndarray::ArrayView2;

use crate::base::error::{Cancel, Error, zeroed};
use crate::base::pool::line;
use crate::base::real::Real;
use crate::base::simd::dispatch;

/// Adds means over boxes (x0, y0, x1, y1) px to zeros: of the opacity, of 1 where it is less than `seen`, and of the
/// opacity without that of the veil, or of `haze` where it has no rows. A box without area in the picture has none: NaN.
pub fn means<T: Real>(
    out: &mut [[f64; 3]],
    boxes: &[[f64; 4]],
    (alpha, veil): (ArrayView2<'_, T>, ArrayView2<'_, T>),
    (seen, haze): (f64, f64),
    cancel: &Cancel,
) -> Result<(), Error> {
    // A box is what lies above its lower end less what lies above its upper one, so that rows are looked at once.
    let (rows, cols) = alpha.dim();
    let inside = |of: &[f64; 4]| [0, 1, 2, 3].map(|k| of[k].clamp(0.0, [cols, rows][k % 2] as f64));
    let boxes: Vec<[f64; 4]> = boxes.iter().map(inside).collect();
    let first = boxes.iter().fold(cols, |first, of| first.min(of[0] as usize));
    let wide = boxes.iter().fold(first, |last, of| last.max(of[2].ceil() as usize)) - first;
    let ends = boxes.iter().zip(0..).flat_map(|(of, n)| [(of[1], -1.0, n), (of[3], 1.0, n)]);
    let mut ends: Vec<(f64, f64, usize)> = ends.collect();
    ends.sort_by(|one, other| one.0.total_cmp(&other.0));
    let (mut columns, mut at) = (zeroed::<f64>(3 * wide)?, ends.first().map_or(0.0, |end| end.0));
    for (end, sign, number) in ends {
        while at < end {
            cancel.check()?;
            let (row, next) = (at as usize, end.min(at.floor() + 1.0));
            let veil = if veil.is_empty() { &[][..] } else { &line(veil, row)?[first..][..wide] };
            add(&mut columns, &line(alpha, row)?[first..][..wide], veil, seen, next - at);
            at = next;
        }
        let [left, _, right, _] = boxes[number];
        for x in left as usize..right.ceil() as usize {
            let part = sign * (right.min(x as f64 + 1.0) - left.max(x as f64));
            for (out, law) in out[number].iter_mut().zip(0..) {
                *out += part * columns[law * wide + x - first];
            }
        }
    }
    for (out, [left, top, right, bottom]) in out.iter_mut().zip(boxes) {
        let area = (right - left) * (bottom - top);
        let mean = |sum: f64| if area > 0.0 { (sum / area).clamp(0.0, 1.0) } else { f64::NAN };
        *out = out.map(mean);
        if veil.is_empty() {
            out[2] = ((out[0] - haze) / (1.0 - haze).max(1e-9)).clamp(0.0, 1.0);
        }
    }
    Ok(())
}

/// Adds a part of a row to sums of columns, one law after the other.
#[dispatch]
fn add<const LEVEL: u8, T: Real>(sums: &mut [f64], alpha: &[T], veil: &[T], seen: f64, part: f64) {
    let (opacity, others) = sums.split_at_mut(alpha.len());
    let (left, own) = others.split_at_mut(alpha.len());
    for ((opacity, left), alpha) in opacity.iter_mut().zip(left).zip(alpha) {
        *opacity += part * alpha.wide();
        *left += if alpha.wide() < seen { part } else { 0.0 };
    }
    for ((own, &alpha), &veil) in own.iter_mut().zip(alpha).zip(veil) {
        *own += part * ((alpha - veil) / T::of(1e-9).max(T::one() - veil)).wide();
    }
}
