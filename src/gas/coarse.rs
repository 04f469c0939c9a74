//! Large particles at half the resolution: a quarter of the work, for an eye that need not be exact.
//!
//! A Gaussian of several pixels holds nothing that a grid of every second pixel could not, and what
//! many of them let through is as smooth: cubics through the four around give it back.

use ndarray::{Array2, ArrayView2, ArrayViewMut2, Axis};

use super::splat::alpha_of;
use super::sprite::{Eye, Look, Sprite};
use crate::base::cover::pixels;
use crate::base::error::{Cancel, Error, collected, zeroed};
use crate::base::normal::{Normal, least, most};
use crate::base::pool;
use crate::base::simd::{dispatch, multiply_add};

/// From this radius on (px) particles may be drawn so. Sigma is 2.7 px of the coarse grid, whose cubics
/// err by 3/128 (1/2.7)^4 of a Gaussian's height at most: a thousandth of a particle's density.
pub const LEAST_RADIUS: f64 = 16.0;

/// Operations for each pixel that is made of coarse ones, where drawing one of a particle is 1: measured.
pub const COST: f64 = 5.0;

/// Coarse pixels beyond each border of the picture, for the cubics.
const PAD: usize = 2;

/// Rows of the picture that a task makes.
const ROWS: usize = 32;

/// Lagrange's weights a quarter of a pixel after the second of four.
const WEIGHTS: [f64; 4] = [-0.054_687_5, 0.820_312_5, 0.273_437_5, -0.039_062_5];

/// Lays particles that a picture shows over its alphas: alpha := 1 - (1 - alpha)(1 - theirs); if
/// `fresh`, over nothing.
///
/// All are products of two sampled Gaussians that nothing cuts off.
pub fn over<P: Normal>(
    out: ArrayViewMut2<'_, P>,
    sprites: &[Sprite],
    eye: &Eye,
    look: &Look,
    fresh: bool,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (height, width) = out.dim();
    let shape = (height.div_ceil(2) + 2 * PAD, width.div_ceil(2) + 2 * PAD);
    let half = collected(sprites.iter().map(|sprite| halved(sprite, shape)))?;
    let values: Vec<P> = zeroed(shape.0 * shape.1)?;
    let mut coarse = Array2::from_shape_vec(shape, values)
        .map_err(|_| Error::Internal("a coarse picture has the wrong size".into()))?;
    let none: Option<ArrayView2<'_, P>> = None;
    alpha_of(coarse.view_mut(), &half, eye, look, none, cancel)?;
    pool::for_each(out.into_iter_rows(), |(first, mut part)| {
        cancel.check()?;
        let mut line: Vec<P> = zeroed(shape.1)?;
        for (row, mut alpha) in part.rows_mut().into_iter().enumerate() {
            let Some(alpha) = alpha.as_slice_mut() else {
                return Err(Error::Internal("an output that is not contiguous".into()));
            };
            // Row 2m lies a quarter before the coarse row m, row 2m + 1 a quarter behind it.
            if fresh {
                alpha.fill(P::zero());
            }
            let row = first + row;
            let start = row / 2 + PAD - 2 + row % 2;
            let rows = [0, 1, 2, 3].map(|k| {
                let k = if row % 2 == 0 { 3 - k } else { k };
                coarse.row(start + k).to_slice().unwrap_or_default()
            });
            add(alpha, &rows, &mut line);
        }
        Ok(())
    })
}

/// The same particle on the coarse grid; no row of it where it cannot be seen.
fn halved(sprite: &Sprite, shape: (usize, usize)) -> Sprite {
    let middle = sprite.middle.map(|value| 0.5 * value + PAD as f64);
    let radius = 0.5 * sprite.radius;
    let range = |axis: usize, length: usize| {
        let range = pixels(middle[axis] - radius, middle[axis] + radius, length);
        range.map_or([0; 2], |range| [range.start as u32, range.end as u32])
    };
    let (columns, rows) = (range(0, shape.1), range(1, shape.0));
    let rows = if columns[0] < columns[1] { rows } else { [0; 2] };
    Sprite { columns, rows, middle, radius, ..*sprite }
}

dispatch! {
    /// Lays one row that four coarse ones make, the weights' order, over a row of alphas.
    fn add<P: Normal>(alpha: &mut [P], rows: &[&[P]; 4], line: &mut [P]) = add_with
}

#[inline(always)]
fn add_with<P: Normal, const LEVEL: u8>(alpha: &mut [P], rows: &[&[P]; 4], line: &mut [P]) {
    let [p, q, r, s] = WEIGHTS.map(P::of);
    let count = line.len();
    let [a, b, c, d] = [&rows[0][..count], &rows[1][..count], &rows[2][..count], &rows[3][..count]];
    for k in 0..count {
        let outer = multiply_add::<P, LEVEL>(a[k], p, d[k] * s);
        line[k] = multiply_add::<P, LEVEL>(b[k], q, multiply_add::<P, LEVEL>(c[k], r, outer));
    }
    let pairs = alpha.len() / 2;
    let (even, last) = alpha.split_at_mut(2 * pairs);
    let [a, b, c, d, e] = [
        &line[PAD - 2..PAD - 2 + pairs],
        &line[PAD - 1..PAD - 1 + pairs],
        &line[PAD..PAD + pairs],
        &line[PAD + 1..PAD + 1 + pairs],
        &line[PAD + 2..PAD + 2 + pairs],
    ];
    for (k, pair) in even.chunks_exact_mut(2).enumerate() {
        let outer = multiply_add::<P, LEVEL>(d[k], p, a[k] * s);
        let left = multiply_add::<P, LEVEL>(c[k], q, multiply_add::<P, LEVEL>(b[k], r, outer));
        let outer = multiply_add::<P, LEVEL>(b[k], p, e[k] * s);
        let right = multiply_add::<P, LEVEL>(c[k], q, multiply_add::<P, LEVEL>(d[k], r, outer));
        pair[0] = under::<P, LEVEL>(pair[0], left);
        pair[1] = under::<P, LEVEL>(pair[1], right);
    }
    for pixel in last {
        let at = |k: usize| line[PAD - 2 + pairs + k];
        let outer = multiply_add::<P, LEVEL>(at(3), p, at(0) * s);
        let left = multiply_add::<P, LEVEL>(at(2), q, multiply_add::<P, LEVEL>(at(1), r, outer));
        *pixel = under::<P, LEVEL>(*pixel, left);
    }
}

/// 1 - (1 - alpha)(1 - more). A cubic overshoots by less than it errs.
#[inline(always)]
fn under<P: Normal, const LEVEL: u8>(alpha: P, more: P) -> P {
    let more = least(most(more, P::zero()), P::one());
    multiply_add::<P, LEVEL>(P::one() - alpha, more, alpha)
}

/// A picture in runs of rows.
trait InRows<'a, P> {
    fn into_iter_rows(self) -> Vec<(usize, ArrayViewMut2<'a, P>)>;
}

impl<'a, P> InRows<'a, P> for ArrayViewMut2<'a, P> {
    fn into_iter_rows(self) -> Vec<(usize, ArrayViewMut2<'a, P>)> {
        let mut runs = Vec::new();
        let (mut rest, mut first) = (self, 0);
        while rest.nrows() > 0 {
            let height = ROWS.min(rest.nrows());
            let (run, below) = rest.split_at(Axis(0), height);
            runs.push((first, run));
            first += height;
            rest = below;
        }
        runs
    }
}
