//! Which flakes are near or out of focus, and their pictures over a frame.

use ndarray::{ArrayView2, ArrayViewMut2, Axis};

use super::aperture::Blur;
use super::patch::{Line, Patch};
use super::shape::{Kind, Tumble};
use crate::base::error::{Cancel, Error, layout};
use crate::base::pool;
use crate::base::simd::dispatch;
use crate::particles::sorted::Part;

/// How flakes are looked at from near.
#[derive(Debug, Clone, Copy)]
pub struct Closeup {
    /// What near ones look like; None where sprites are all.
    pub kind: Option<Kind>,
    /// Sigma in px between which a sprite gives way to a shape.
    pub switch: (f64, f64),
    /// The lens, if it has an opening.
    pub blur: Option<Blur>,
    pub tumble: Tumble,
}

/// Circles of confusion in px between which a blurred sprite gives way to a disc.
pub const DISC: (f64, f64) = (6.0, 9.0);

const BAND: usize = 32;

/// Joins the pictures with the opacity in a part of the frame; `depth`, of the whole frame, hides.
pub fn draw(
    mut out: ArrayViewMut2<'_, f32>,
    patches: &[Patch],
    part: Part,
    depth: Option<ArrayView2<'_, f32>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    if patches.is_empty() {
        return Ok(());
    }
    let [top, _, left, right] = part;
    let bands: Vec<_> = out.axis_chunks_iter_mut(Axis(0), BAND).enumerate().collect();
    pool::for_each(bands, |(number, mut band)| {
        cancel.check()?;
        let first = top + number * BAND;
        let end = first + band.nrows();
        let mut room = Line::default();
        for patch in patches {
            let (upper, lower) = patch.bounds(1);
            for y in upper.max(first)..lower.min(end) {
                let mut line = band.row_mut(y - first);
                let line = line.as_slice_mut().ok_or_else(layout)?;
                let (x, alphas) = patch.row(y, left..right, &mut room);
                let line = &mut line[x - left..][..alphas.len()];
                let Some(map) = depth else {
                    join(line, alphas);
                    continue;
                };
                let map = map.index_axis_move(Axis(0), y);
                for ((out, alpha), &ground) in line.iter_mut().zip(alphas).zip(map.iter().skip(x)) {
                    // NaN hides nothing.
                    let hidden = ground < patch.depth as f32;
                    *out += if hidden { 0.0 } else { alpha * (1.0 - *out) };
                }
            }
        }
        Ok(())
    })
}

/// Writes the flake of each picture into `numbers` where its alpha is above the greatest so far, `most`, or as
/// great and it comes first; both are of a part of the frame.
pub fn number(
    mut numbers: ArrayViewMut2<'_, i32>,
    mut most: ArrayViewMut2<'_, f32>,
    patches: &[Patch],
    part: Part,
    depth: Option<ArrayView2<'_, f32>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let [top, bottom, left, right] = part;
    let mut room = Line::default();
    for patch in patches {
        cancel.check()?;
        let (upper, lower) = patch.bounds(1);
        for y in upper.max(top)..lower.min(bottom) {
            let (x, alphas) = patch.row(y, left..right, &mut room);
            for (x, &alpha) in (x..).zip(alphas) {
                let at = [y - top, x - left];
                let first = alpha == most[at] && patch.index < numbers[at];
                let hidden = depth.is_some_and(|map| map[[y, x]] < patch.depth as f32);
                if (alpha > most[at] || first) && alpha > 0.0 && !hidden {
                    (most[at], numbers[at]) = (alpha, patch.index);
                }
            }
        }
    }
    Ok(())
}

/// Joins opacities with those that are there.
#[dispatch]
fn join<const LEVEL: u8>(out: &mut [f32], alphas: &[f32]) {
    for (out, alpha) in out.iter_mut().zip(alphas) {
        *out += alpha * (1.0 - *out);
    }
}
