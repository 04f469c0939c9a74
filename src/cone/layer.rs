//! One texture on the double cone: alpha = texture * fade * gain.

use std::f64::consts::TAU;

use ndarray::{ArrayView1, ArrayView2, ArrayViewMut1, ArrayViewMut2, Axis};

use super::area::Area;
use super::view::{Point, View};
use crate::base::error::{Cancel, Error};
use crate::base::pool;
use crate::base::real::Real;

#[derive(Debug, Clone, Copy)]
pub struct Layer {
    /// Tiles around; whole, so that there is no seam.
    pub repeats: u32,
    /// Tiles that the texture has come along the axis.
    pub phase: f64,
    /// How many times as long a drop is along the axis.
    pub stretch: f64,
    /// Tiles, across and along.
    pub offset: [f64; 2],
    pub gain: f64,
}

impl Layer {
    /// Place and size of a pixel's box in the texture, tiles: across, along, and both sides.
    #[inline]
    pub fn footprint(&self, point: &Point) -> [f64; 4] {
        let around = f64::from(self.repeats);
        let along = around / (TAU * self.stretch);
        [
            point.azimuth * around + self.offset[0],
            point.height * along - self.phase + self.offset[1],
            (point.azimuth_step * around).min(around),
            // A box of many tiles is their mean: no need to follow it to infinity.
            (point.height_step * along).min(1e6),
        ]
    }
}

/// Fills `out` (H, W) with the layer's alpha, 0 to 1.
pub fn layer<T: Real>(
    mut out: ArrayViewMut2<T>,
    view: &View,
    texture: &Area,
    layer: &Layer,
    cancel: &Cancel,
) -> Result<(), Error> {
    let size = texture.size() as f64;
    let rows = out.axis_iter_mut(Axis(0)).enumerate();
    pool::for_each(rows, |(row, mut line)| {
        cancel.check()?;
        for (column, pixel) in line.iter_mut().enumerate() {
            let point = view.point(column as f64 + 0.5, row as f64 + 0.5);
            if point.fade == 0.0 {
                *pixel = T::zero();
                continue;
            }
            let [u, v, width, height] = layer.footprint(&point).map(|tiles| tiles * size);
            let alpha = texture.mean(u, v, width, height) * point.fade * layer.gain;
            *pixel = T::of(alpha.clamp(0.0, 1.0));
        }
        Ok(())
    })
}

/// Fills `out` (h, W or wider) with how many of the radii, least first, lie before the depth map (h, W)
/// of the rows from `top` on; NaN hides nothing.
pub fn shown(
    mut out: ArrayViewMut2<'_, u8>,
    depth: ArrayView2<'_, f32>,
    view: &View,
    radii: &[f64],
    top: usize,
    cancel: &Cancel,
) -> Result<(), Error> {
    if out.nrows() != depth.nrows() || out.ncols() < depth.ncols() {
        return Err(Error::Internal("wrong shape".into()));
    }
    let rows = out.axis_iter_mut(Axis(0)).zip(depth.rows()).enumerate();
    pool::for_each(
        rows,
        |(row, (mut out, depth)): (usize, (ArrayViewMut1<u8>, ArrayView1<f32>))| {
            cancel.check()?;
            for (column, (out, &depth)) in out.iter_mut().zip(depth).enumerate() {
                let unit = view.depth(column as f64 + 0.5, (top + row) as f64 + 0.5);
                let limit = if depth.is_nan() { f64::INFINITY } else { f64::from(depth) };
                *out = radii.iter().filter(|&&radius| radius * unit <= limit).count() as u8;
            }
            Ok(())
        },
    )
}
