//! Toroidal textures of drops and flakes: alpha = 1 - prod(1 - alpha_i), every distance the shortest
//! one around the torus.

use std::f64::consts::{PI, TAU};

use ndarray::{ArrayView1, ArrayView2, ArrayViewMut2, Axis};

use crate::base::error::{Cancel, Error, collected, zeroed};
use crate::base::pixel::sampled;
use crate::base::pool;
use crate::base::real::Real;

/// A Gaussian ends here, where it is 8e-7.
const REACH: f64 = 5.3;

/// One drop: a segment along v with a Gaussian around it.
struct Drop {
    center: [f64; 2],
    sigma: f64,
    half: f64,
    opacity: f64,
}

/// The shortest way around the torus.
#[inline]
fn around(distance: f64, size: f64) -> f64 {
    distance - size * (distance / size).round()
}

/// The integral of a drop's footprint.
fn area(sigma2: f64, half: f64) -> f64 {
    2.0 * half * (2.0 * PI * sigma2).sqrt() + TAU * sigma2
}

impl Drop {
    fn of(row: &[f64]) -> Self {
        let (sigma2, half) = (row[2] * row[2], row[3]);
        // Smaller than a texel: wider and fainter, as flakes are.
        let wide = sampled(sigma2);
        let opacity = row[4] * area(sigma2, half) / area(wide, half);
        Self { center: [row[0], row[1]], sigma: wide.sqrt(), half, opacity }
    }

    /// Multiplies what the drop lets through into a row of texels.
    fn draw(&self, clear: &mut [f64], row: usize) {
        let size = clear.len() as f64;
        let along = around(row as f64 + 0.5 - self.center[1], size).abs() - self.half;
        let along = along.max(0.0) / self.sigma;
        let reach = REACH * self.sigma;
        if along > REACH {
            return;
        }
        let peak = self.opacity * libm::exp(-0.5 * along * along);
        let whole = 2.0 * reach + 1.0 >= size;
        let first = if whole { 0 } else { (self.center[0] - reach - 0.5).ceil() as i64 };
        let last =
            if whole { clear.len() as i64 - 1 } else { (self.center[0] + reach - 0.5) as i64 };
        for column in first..=last {
            let column = column.rem_euclid(clear.len() as i64) as usize;
            let across = around(column as f64 + 0.5 - self.center[0], size) / self.sigma;
            clear[column] *= 1.0 - peak * libm::exp(-0.5 * across * across);
        }
    }
}

/// Fills `out` (n, n). Rows of `drops` are u, v, sigma, half the length (texels), opacity.
pub fn tile<T: Real>(
    mut out: ArrayViewMut2<'_, T>,
    drops: ArrayView2<'_, f64>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (rows, size) = out.dim();
    if rows != size || drops.ncols() != 5 {
        return Err(Error::Internal("a tile is square, a drop five numbers".into()));
    }
    let of = |row: ArrayView1<'_, f64>| Drop::of(&[row[0], row[1], row[2], row[3], row[4]]);
    let drops = collected(drops.rows().into_iter().map(of))?;
    let lines = out.axis_iter_mut(Axis(0)).enumerate();
    pool::for_each(lines, |(row, mut line)| {
        cancel.check()?;
        let mut clear = zeroed(size)?;
        clear.fill(1.0);
        for drop in &drops {
            drop.draw(&mut clear, row);
        }
        for (texel, clear) in line.iter_mut().zip(clear) {
            *texel = T::of(1.0 - clear);
        }
        Ok(())
    })
}
