//! Flakes before a camera that stands still, drawn in the picture: each keeps its depth and crosses the
//! picture at a constant speed, on a torus a little larger than the picture.
//!
//! Every flake has five numbers of the stream: its depth, its place across and down, its size, and
//! where it is in its swing.

use ndarray::{ArrayViewMut2, Axis};

use crate::base::error::{Cancel, Error, collected};
use crate::base::random::Hash;
use crate::particles::looks::size_fade;

/// What flakes are like, and what sees them.
#[derive(Debug, Clone, Copy)]
pub struct Crossing<'a> {
    /// Depths, and how many flakes there are up to each, in any unit; both rise.
    pub depths: &'a [f64],
    /// See `depths`.
    pub sums: &'a [f64],
    /// (width, height), px.
    pub size: [f64; 2],
    /// px.
    pub focal: f64,
    /// How far outside the picture a flake may be seen in it: world units, and px.
    pub room: (f64, f64),
    /// By how much each has moved since time 0, world units.
    pub way: [f64; 2],
    /// Amplitude, world units, and the angle of one whose number is 0, radians.
    pub sway: (f64, f64),
    /// Diameters at even shares of the flakes, world units: at least two, and linear between.
    pub sizes: &'a [f64],
    /// Of a resting one's middle.
    pub opacity: f64,
    /// Sigma in px from which they fade, and at which they are gone.
    pub fade: (f64, f64),
}

/// Cells of the table that finds a depth's place.
const CELLS: usize = 256;

/// Flakes between two looks at the cancel flag.
const LOOK: usize = 4096;

/// Writes the flakes that are seen, in their order, and returns how many.
///
/// `points` is (n, 3) in camera axes; `parts` is (n, 4): radius, opacity, the share of the picture that
/// one is expected to cover, and its angle in the swing.
pub fn cross(
    mut points: ArrayViewMut2<'_, f64>,
    mut parts: ArrayViewMut2<'_, f64>,
    law: &Crossing<'_>,
    seed: i64,
    stream: i64,
    cancel: &Cancel,
) -> Result<usize, Error> {
    let count = points.nrows();
    let sound = points.ncols() == 3
        && parts.dim() == (count, 4)
        && law.depths.len() == law.sums.len()
        && law.sums.is_sorted()
        && law.sums.len() >= 2
        && law.sizes.len() >= 2
        && law.sums[law.sums.len() - 1] > law.sums[0];
    if !sound {
        return Err(Error::Internal(format!("no flakes cross like {law:?}")));
    }
    let inverse = Inverse::new(law.depths, law.sums)?;
    let hash = Hash::seeded(seed).word(stream);
    let mut kept = 0;
    for index in 0..count {
        if index % LOOK == 0 {
            cancel.check()?;
        }
        let number = |k: usize| hash.word((5 * index + k) as i64).unit();
        let z = inverse.at(number(0));
        let pixels = law.focal / z;
        let radius = 0.5 * between(law.sizes, number(3));
        let sigma = pixels * radius / 3.0;
        let opacity = law.opacity * size_fade(sigma, law.fade);
        if opacity <= 0.0 {
            continue;
        }
        let margin = 2.0 * (law.room.0 * pixels + law.room.1);
        let over = law.size.map(|size| size + margin);
        let mut place = [0.0; 2];
        for axis in 0..2 {
            let way = number(1 + axis) + law.way[axis] * pixels / over[axis];
            place[axis] = (way - way.floor() - 0.5) * over[axis] / pixels;
        }
        let angle = law.sway.1 + std::f64::consts::TAU * number(4);
        if law.sway.0 != 0.0 {
            place[0] += law.sway.0 * libm::sin(angle);
        }
        let cover = std::f64::consts::TAU * opacity * sigma * sigma / (over[0] * over[1]);
        let (mut point, mut rest) =
            (points.index_axis_mut(Axis(0), kept), parts.index_axis_mut(Axis(0), kept));
        (point[0], point[1], point[2]) = (place[0], place[1], z);
        (rest[0], rest[1], rest[2], rest[3]) = (radius, opacity, cover, angle);
        kept += 1;
    }
    Ok(kept)
}

/// The diameter of which a share of all, 0 to 1, are smaller.
#[inline(always)]
fn between(sizes: &[f64], share: f64) -> f64 {
    let place = share * (sizes.len() - 1) as f64;
    let at = (place as usize).min(sizes.len() - 2);
    sizes[at] + (place - at as f64) * (sizes[at + 1] - sizes[at])
}

/// The inverse of a rising piecewise linear function, as `numpy.interp` has it.
struct Inverse<'a> {
    depths: &'a [f64],
    sums: &'a [f64],
    /// For each cell of the range an interval that is not behind it.
    first: Vec<u32>,
}

impl<'a> Inverse<'a> {
    fn new(depths: &'a [f64], sums: &'a [f64]) -> Result<Self, Error> {
        let total = sums[sums.len() - 1];
        let first = collected((0..CELLS).map(|cell| {
            let start = total * cell as f64 / CELLS as f64;
            let behind = sums.partition_point(|&sum| sum <= start);
            behind.saturating_sub(2).min(sums.len() - 2) as u32
        }))?;
        Ok(Self { depths, sums, first })
    }

    /// Up to which depth there is this share of all, 0 to 1.
    #[inline(always)]
    fn at(&self, share: f64) -> f64 {
        let (depths, sums) = (self.depths, self.sums);
        let last = sums.len() - 2;
        let wanted = share * sums[last + 1];
        let cell = ((share * CELLS as f64) as usize).min(CELLS - 1);
        let mut at = (self.first[cell] as usize).min(last);
        while at < last && sums[at + 1] <= wanted {
            at += 1;
        }
        let slope = (depths[at + 1] - depths[at]) / (sums[at + 1] - sums[at]);
        slope * (wanted - sums[at]) + depths[at]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_is_the_function_s() {
        // Many depths in one cell, and one over many cells.
        let depths: Vec<f64> = (0..=128).map(|i| 0.4 + 0.05 * f64::from(i)).collect();
        let mut sums = vec![0.0];
        for depth in &depths[1..] {
            sums.push(sums[sums.len() - 1] + depth.powi(4));
        }
        let inverse = Inverse::new(&depths, &sums).unwrap();
        for i in 0..10_000 {
            let share = f64::from(i) / 10_000.0;
            let depth = inverse.at(share);
            let at = depths.partition_point(|&d| d <= depth).clamp(1, 128) - 1;
            let part = (depth - depths[at]) / (depths[at + 1] - depths[at]);
            let back = sums[at] + part * (sums[at + 1] - sums[at]);
            assert!((back / sums[128] - share).abs() < 1e-12, "{share} {depth}");
        }
        assert_eq!(inverse.at(0.0), 0.4);
        assert!((inverse.at(1.0) - depths[128]).abs() < 1e-12);
    }
}
