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

/// A coarse field of patches, its point (i, j) at (i, j) times so many px; those pixels; and its strength.
pub type Patches<'a, T> = (ArrayView2<'a, T>, f64, f64);

/// Writes the veil's opacity. `way` is what the light comes through, (H or 1, W or 1).
pub fn veil<T: Normal>(
    out: ArrayViewMut2<'_, T>,
    way: ArrayView2<'_, T>,
    extinction: f64,
    patches: Option<Patches<'_, T>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (height, width) = out.dim();
    if ![(1, 1), (height, 1), (height, width)].contains(&way.dim()) {
        return Err(Error::Internal(format!("no veil of {:?} for {:?}", way.dim(), out.dim())));
    }
    let places = patches.map_or(Ok(Vec::new()), |(_, cell, _)| places::<T>(width, cell))?;
    let open = collected((0..width).map(|_| T::one()))?;
    pool::for_each(pool::rows(out, pool::threads()), |(run, mut part)| {
        let mut line = zeroed::<T>(patches.map_or(0, |patches| patches.0.ncols()))?;
        for (row, mut out) in run.zip(part.rows_mut()) {
            cancel.check()?;
            let out = out.as_slice_mut().ok_or_else(layout)?;
            out.fill(T::one());
            if let Some((field, cell, strength)) = patches {
                // Along the row, at its own columns; then between them.
                let (place, strength) = ((row as f64 + 0.5) / cell, T::of(strength));
                let (first, part) = (place as usize, T::of(place - place.floor()));
                let ends = field.row(first).into_iter().zip(field.row(first + 1));
                for (value, (&upper, &lower)) in line.iter_mut().zip(ends) {
                    *value = upper + part * (lower - upper);
                }
                for (density, &(first, part)) in out.iter_mut().zip(&places) {
                    let (left, right) = (line[first as usize], line[first as usize + 1]);
                    let here = left + part * (right - left);
                    *density = most(T::one() + strength * here, T::zero());
                }
            }
            let way = pool::line(way, if way.nrows() == 1 { 0 } else { row })?;
            let (one, way) = if way.len() == 1 { (way[0], &open[..]) } else { (T::one(), way) };
            dim(out, T::of(extinction) * one, way);
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

/// Densities to opacities, each times `thick` and a way.
#[dispatch]
fn dim<const LEVEL: u8, T: Normal>(values: &mut [T], thick: T, way: &[T]) {
    for (value, &way) in values.iter_mut().zip(way) {
        let depth = least(*value * thick * way, T::of(OPAQUE));
        *value = T::one() - T::exp_at::<LEVEL>(-depth);
    }
}

/// The extinction by which a mean share of the light is lost on ways, infinity where all are nothing: by Newton's
/// steps, which never go too far, since the logarithm of what is left is convex and falls.
pub fn extinction(ways: &[f64], lost: f64) -> f64 {
    let (mut found, wanted) = (0.0, (1.0 - lost) * ways.len() as f64);
    for _ in 0..60 {
        let [rest, slope] = left(ways, found);
        let step = libm::log(rest / wanted) * rest / slope;
        found += step;
        // Whose square is left; three or four are usual.
        if step <= 3e-4 * found {
            break;
        }
    }
    found
}

/// Sums of what an extinction leaves on ways, and of that times the way.
#[dispatch]
fn left<const LEVEL: u8>(ways: &[f64], thick: f64) -> [f64; 2] {
    let (lanes, rest) = ways.as_chunks::<8>();
    let mut sums = [[0.0; 8]; 2];
    let mut add = |lane: usize, way: f64| {
        let left = f64::exp_at::<LEVEL>(-least(thick * way, OPAQUE));
        sums[0][lane] += left;
        sums[1][lane] += left * way;
    };
    for ways in lanes {
        for lane in 0..8 {
            add(lane, ways[lane]);
        }
    }
    rest.iter().for_each(|&way| add(0, way));
    sums.map(|own| own.iter().sum())
}
