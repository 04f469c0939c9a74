//! The image of many flakes of one color: alpha = 1 - prod(1 - alpha_i), whatever their order.

use std::ops::Range;

use ndarray::{ArrayView1, ArrayView2};

use super::sorted::Sorted;
use super::sprite::{Flake, Lens, Sprite};
use crate::base::error::{Cancel, Error, finite};
use crate::base::scan;
use crate::base::simd::dispatch;

/// Flakes as arrays: points (n, 3) in camera axes; the others have n rows, or one for all.
#[derive(Debug, Clone, Copy)]
pub struct Flakes<'a> {
    /// At mid-exposure, world units.
    pub points: ArrayView2<'a, f64>,
    /// World units.
    pub radius: ArrayView1<'a, f64>,
    /// 0 to 1.
    pub opacity: ArrayView1<'a, f64>,
    /// Flake minus camera, world units per frame.
    pub velocity: ArrayView2<'a, f64>,
    /// Frames.
    pub shutter: f64,
}

impl Flakes<'_> {
    fn check(&self, lens: &Lens) -> Result<(), Error> {
        let count = self.points.nrows();
        let fits = |length: usize| [1, count].contains(&length);
        let columns = (self.points.ncols(), self.velocity.ncols());
        let rows = [self.radius.len(), self.opacity.len(), self.velocity.nrows()];
        if columns != (3, 3) || !rows.into_iter().all(fits) {
            return Err(Error::Internal("arrays of flakes do not fit each other".into()));
        }
        for (argument, values, most, words) in [
            ("radius", &self.radius, f64::MAX, "finite and not negative"),
            ("opacity", &self.opacity, 1.0, "from 0 to 1"),
        ] {
            let whole = |values| scan::all_within(values, 0.0, most);
            if !values.as_slice().is_some_and(whole)
                && let Some(bad) = values.iter().find(|value| !(0.0..=most).contains(*value))
            {
                return Err(Error::invalid(argument, format!("must be {words}, got {bad}")));
            }
        }
        for (argument, values) in [("points", &self.points), ("velocity", &self.velocity)] {
            let finite = |values| scan::all_within(values, f64::MIN, f64::MAX);
            if !values.as_slice().is_some_and(finite)
                && !values.iter().all(|value| value.is_finite())
            {
                return Err(Error::invalid(argument, "must be finite"));
            }
        }
        lens.center.iter().chain(&lens.offset).try_for_each(|&v| finite("camera", v).map(|_| ()))
    }

    #[inline(always)]
    fn get(&self, index: usize) -> Flake {
        let row = |length: usize| if length == 1 { 0 } else { index };
        let velocity = row(self.velocity.nrows());
        Flake {
            point: [0, 1, 2].map(|axis| self.points[[index, axis]]),
            radius: self.radius[row(self.radius.len())],
            opacity: self.opacity[row(self.opacity.len())],
            travel: [0, 1, 2].map(|axis| self.shutter * self.velocity[[velocity, axis]]),
        }
    }
}

/// Adds the images of some flakes, for which there is room.
#[dispatch]
fn place<const LEVEL: u8>(
    flakes: &Flakes<'_>,
    lens: &Lens,
    range: Range<usize>,
    images: &mut Vec<(Sprite, i32)>,
) {
    for index in range {
        if let Some(sprite) = Sprite::of(&flakes.get(index), lens) {
            images.push((sprite, index as i32));
        }
    }
}

/// Projects and sorts the flakes of a frame of `shape`.
pub fn sorted(
    flakes: &Flakes<'_>,
    lens: &Lens,
    shape: (usize, usize),
    cancel: &Cancel,
) -> Result<Sorted, Error> {
    flakes.check(lens)?;
    let images = |range, images: &mut Vec<(Sprite, i32)>| place(flakes, lens, range, images);
    Sorted::new(flakes.points.nrows(), images, None, shape, cancel)
}

/// A rough estimate of the work in nanoseconds.
pub fn estimate(shape: (usize, usize), flakes: &Flakes<'_>) -> f64 {
    2.0 * (shape.0 * shape.1) as f64 + 300.0 * flakes.points.nrows() as f64
}
