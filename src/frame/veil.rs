//! A veil before what is seen: 1 - exp(-extinction * way), evenly or in patches.
//!
//! Patches are a coarse field, read between its points: the extinction is multiplied by
//! `1 + strength * field`, no less than 0.

use ndarray::{ArrayView2, ArrayViewMut2};

use crate::base::error::{Cancel, Error, collected, layout, zeroed};
use crate::base::normal::{Normal, least, most};
use crate::base::pool;
use crate::base::simd::dispatch;

/// Beyond this optical depth nothing is left to see.
const OPAQUE: f64 = 80.0;

/// A field of patches, coarser than the picture.
#[derive(Debug, Clone, Copy)]
pub struct Patches<'a, T> {
    /// Its points, (rows, cols); point (i, j) stands at (i, j) times `cell` px.
    pub field: ArrayView2<'a, T>,
    /// Pixels between two points.
    pub cell: f64,
    pub strength: f64,
}

/// Writes the veil's opacity. `way` is what the light comes through, (H or 1, W or 1).
pub fn veil<T: Normal>(
    out: ArrayViewMut2<'_, T>,
    way: ArrayView2<'_, T>,
    extinction: f64,
    patches: Option<Patches<'_, T>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (height, width) = out.dim();
    let fits = [(1, 1), (height, 1), (height, width)].contains(&way.dim());
    if !fits {
        return Err(Error::Internal(format!("no veil of {:?} for {:?}", way.dim(), out.dim())));
    }
    let places = match patches {
        Some(patches) => places::<T>(width, patches.cell)?,
        None => Vec::new(),
    };
    pool::for_each(pool::rows(out, pool::threads()), |(run, mut part)| {
        let mut line = zeroed::<T>(patches.map_or(0, |patches| patches.field.ncols()))?;
        for (row, mut out) in run.zip(part.rows_mut()) {
            cancel.check()?;
            let out = out.as_slice_mut().ok_or_else(layout)?;
            let way = pool::line(way, if way.nrows() == 1 { 0 } else { row })?;
            match patches {
                Some(patches) => {
                    patches.row(row, &mut line);
                    let strength = T::of(patches.strength);
                    for (density, &(first, part)) in out.iter_mut().zip(&places) {
                        let (left, right) = (line[first as usize], line[first as usize + 1]);
                        let here = left + part * (right - left);
                        *density = most(T::one() + strength * here, T::zero());
                    }
                    let one = if way.len() == 1 { way[0] } else { T::one() };
                    dim(out, T::of(extinction) * one, (way.len() > 1).then_some(way));
                }
                None if way.len() == 1 => {
                    let depth = least(T::of(extinction) * way[0], T::of(OPAQUE));
                    out.fill(T::one() - T::exp_negative(-depth));
                }
                None => {
                    out.copy_from_slice(way);
                    dim(out, T::of(extinction), None);
                }
            }
        }
        Ok(())
    })
}

/// Between which points of a field each pixel lies, and how far from the first.
fn places<T: Normal>(length: usize, cell: f64) -> Result<Vec<(u32, T)>, Error> {
    collected((0..length).map(|pixel| {
        let place = (pixel as f64 + 0.5) / cell;
        (place as u32, T::of(place - place.floor()))
    }))
}

impl<T: Normal> Patches<'_, T> {
    /// The field along a row of pixels, at its own columns.
    fn row(&self, row: usize, line: &mut [T]) {
        let place = (row as f64 + 0.5) / self.cell;
        let (first, part) = (place as usize, T::of(place - place.floor()));
        let (upper, lower) = (self.field.row(first), self.field.row(first + 1));
        for ((value, &upper), &lower) in line.iter_mut().zip(upper).zip(lower) {
            *value = upper + part * (lower - upper);
        }
    }
}

/// Ways to opacities, each times `thick` and, where it is given, `way`.
#[dispatch]
fn dim<const LEVEL: u8, T: Normal>(values: &mut [T], thick: T, way: Option<&[T]>) {
    let (one, end) = (T::one(), T::of(OPAQUE));
    match way {
        Some(way) => {
            for (value, &way) in values.iter_mut().zip(way) {
                let depth = least(*value * thick * way, end);
                *value = one - T::exp_at::<LEVEL>(-depth);
            }
        }
        None => {
            for value in values {
                let depth = least(*value * thick, end);
                *value = one - T::exp_at::<LEVEL>(-depth);
            }
        }
    }
}
