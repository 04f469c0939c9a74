//! The rays of a sheet of samples, and what a particle's middle is to them.
//!
//! With d = (sx, sy, 1) the slopes of a ray and C the particle's middle, the vector C x d is linear in
//! the sample's row and column. Its value at the sheet's corner is float64; a row goes on from there in
//! steps, in the samples' type. So the distance from the middle is right to the last bits of itself,
//! however far away the particle is.

use super::footprint::lane;
use super::sprite::{Eye, Sprite};
use crate::base::normal::Normal;
use crate::base::simd::multiply_add;

/// Samples that are worked on at once: an exponential costs as much as some pixels of a particle.
pub const PART: usize = 16;

pub type Part<P> = [P; PART];

/// Where the samples of a square sheet lie.
#[derive(Debug, Clone, Copy)]
pub struct Sheet {
    /// Slopes of the first column and row.
    pub first: [f64; 2],
    /// Slopes from sample to sample.
    pub step: f64,
    /// The least and the greatest length of its rays (sx, sy, 1).
    pub range: [f64; 2],
}

impl Sheet {
    /// `count` x `count` samples from `corner` (x, y) on, px, `step` px apart.
    pub fn of(eye: &Eye, corner: [f64; 2], step: f64, count: usize) -> Self {
        let first = [0, 1].map(|axis| (corner[axis] - eye.center[axis]) / eye.focal);
        let step = step / eye.focal;
        let last = first.map(|slope| slope + step * (count - 1) as f64);
        let (mut least, mut greatest) = (1.0, 1.0);
        for (low, high) in first.into_iter().zip(last) {
            let nearest = 0.0_f64.clamp(low, high);
            let farthest = low.abs().max(high.abs());
            least += nearest * nearest;
            greatest += farthest * farthest;
        }
        // The samples' lengths are rounded to their type.
        Self { first, step, range: [least.sqrt() * (1.0 - 1e-6), greatest.sqrt() * (1.0 + 1e-6)] }
    }
}

#[repr(C, align(64))]
#[derive(Clone)]
pub struct Rays<P, const N: usize> {
    /// sx, by column.
    across: [P; N],
    /// sy, by row.
    down: [P; N],
    /// |d|.
    length: [[P; N]; N],
    /// 1 / |d|.
    inverse: [[P; N]; N],
}

impl<P: Normal, const N: usize> Rays<P, N> {
    pub fn none() -> Self {
        let (row, plane) = ([P::zero(); N], [[P::zero(); N]; N]);
        Self { across: row, down: row, length: plane, inverse: plane }
    }

    #[inline(always)]
    pub fn fill<const LEVEL: u8>(&mut self, sheet: &Sheet) {
        for k in 0..N {
            let step = f64::from(k as i32) * sheet.step;
            self.across[k] = P::of(sheet.first[0] + step);
            self.down[k] = P::of(sheet.first[1] + step);
        }
        for row in 0..N {
            let down = multiply_add::<P, LEVEL>(self.down[row], self.down[row], P::one());
            for k in 0..N {
                let sx = self.across[k];
                let length = multiply_add::<P, LEVEL>(sx, sx, down).sqrt();
                self.length[row][k] = length;
                self.inverse[row][k] = P::one() / length;
            }
        }
    }
}

/// A particle's linear forms over a sheet.
pub struct Forms {
    /// Components of C x d at the sheet's corner, world units.
    corner: [f64; 3],
    place: [f64; 3],
    sigma: f64,
    sheet: Sheet,
}

/// A row's rays beside a particle, in sigma.
pub struct Beside<P> {
    /// C x d along x, the same for the row.
    first: P,
    /// C x d along y and the third, at the row's first sample and from sample to sample.
    second: [P; 2],
    third: [P; 2],
    /// C . d / |C| likewise: how far a ray has the particle before it, not in sigma.
    along: [P; 2],
    /// sy.
    slope: P,
}

/// What a part of a row's rays are to a particle.
pub struct Passing<P> {
    /// The squared distance, in sigma, at which a ray passes the middle.
    pub squared: Part<P>,
    /// How much nearer than the middle's depth a ray passes it, in sigma: the ray reaches a depth E at
    /// (E - z)/sigma |d| + `lean` from where it passes.
    pub lean: Part<P>,
}

impl Forms {
    pub fn of(sprite: &Sprite, sheet: &Sheet) -> Self {
        let [x, y, z] = sprite.place;
        let [sx, sy] = sheet.first;
        let corner = [y - z * sy, z * sx - x, x * sy - y * sx];
        Self { corner, place: sprite.place, sigma: sprite.sigma, sheet: *sheet }
    }

    /// The samples [first, last) of a row, at most `count`, whose rays pass within three sigma; a few
    /// more at either end.
    #[inline(always)]
    pub fn touched(&self, row: usize, count: usize) -> Option<[usize; 2]> {
        let [x, y, z] = self.place;
        let (step, [sx, sy]) = (self.sheet.step, self.sheet.first);
        let down = row as f64 * step;
        let [v1, v2, v3] = [self.corner[0] - z * down, self.corner[1], self.corner[2] + x * down];
        let reach = 9.0 * self.sigma * self.sigma;
        let sy = sy + down;
        let (p, s) = (z * step, -y * step);
        // |C x d|^2 - 9 sigma^2 |d|^2 = a k^2 + 2 b k + c in the column k.
        let a = p * p + s * s - reach * step * step;
        let b = v2 * p + v3 * s - reach * sx * step;
        let c = v1 * v1 + v2 * v2 + v3 * v3 - reach * (1.0 + sy * sy + sx * sx);
        if a <= 1e-9 * (p * p + s * s) {
            return Some([0, count]);
        }
        let inside = b * b - a * c;
        // What rounding left of a row that is just touched.
        if inside < -1e-9 * b * b {
            return None;
        }
        let half = inside.max(0.0).sqrt();
        let (low, high) = ((-b - half) / a - 2.0, (-b + half) / a + 3.0);
        let last = count as f64;
        if high <= 0.0 || low >= last {
            return None;
        }
        Some([low.max(0.0) as usize, high.min(last).ceil() as usize])
    }

    #[inline(always)]
    pub fn row<P: Normal>(&self, row: usize) -> Beside<P> {
        let [x, y, z] = self.place;
        let (step, [sx, sy]) = (self.sheet.step, self.sheet.first);
        let down = row as f64 * step;
        let scale = 1.0 / self.sigma;
        let away = 1.0 / (x * x + y * y + z * z).sqrt();
        let pair = |start: f64, step: f64, scale: f64| [P::of(start * scale), P::of(step * scale)];
        Beside {
            first: P::of((self.corner[0] - z * down) * scale),
            second: pair(self.corner[1], z * step, scale),
            third: pair(self.corner[2] + x * down, -y * step, scale),
            along: pair(x * sx + y * (sy + down) + z, x * step, away),
            slope: P::of(sy + down),
        }
    }

    /// How far a depth lies before the place where a ray passes the middle, world units, at least; of
    /// all rays of the sheet. Less than nothing if it lies behind it.
    pub fn before(&self, depth: f64, last: usize) -> f64 {
        let [x, y, z] = self.place;
        let range = self.sheet.range;
        let most = self.corners(last).map(|(along, _)| along).fold(f64::NEG_INFINITY, f64::max);
        let approach = most / range[if most > 0.0 { 0 } else { 1 }];
        depth * range[0] - approach.min((x * x + y * y + z * z).sqrt())
    }

    /// How far a depth lies beyond that place, likewise.
    pub fn behind(&self, depth: f64, last: usize) -> f64 {
        // Where C . d >= c |d| + D |d|^2 holds at the corners it holds between them: it does for a
        // convex set of rays.
        self.corners(last)
            .map(|(along, length)| along / length - depth * length)
            .fold(f64::INFINITY, f64::min)
    }

    /// C . d and |d| at the sheet's corners.
    fn corners(&self, last: usize) -> impl Iterator<Item = (f64, f64)> + '_ {
        let [x, y, z] = self.place;
        let end = last as f64 * self.sheet.step;
        let [left, top] = self.sheet.first;
        [(left, top), (left + end, top), (left, top + end), (left + end, top + end)]
            .into_iter()
            .map(move |(sx, sy)| (x * sx + y * sy + z, (1.0 + sx * sx + sy * sy).sqrt()))
    }
}

impl<P: Normal> Passing<P> {
    #[inline(always)]
    pub fn none() -> Self {
        Self { squared: [P::zero(); PART], lean: [P::zero(); PART] }
    }
}

impl<P: Normal> Beside<P> {
    /// A part's rays beside the particle; `facing` measures the distance on a billboard that faces the
    /// eye, where it is the tangent and not the sine of the angle.
    #[inline(always)]
    pub fn passing<const N: usize, const LEVEL: u8>(
        &self,
        rays: &Rays<P, N>,
        row: usize,
        part: usize,
        facing: bool,
    ) -> Passing<P> {
        let at = part * PART;
        let (sx, inverse) = (&rays.across[at..at + PART], &rays.inverse[row][at..at + PART]);
        let sx: &Part<P> = sx.try_into().expect("PART of them");
        let inverse: &Part<P> = inverse.try_into().expect("PART of them");
        let mut passing = Passing::none();
        let first = self.first * self.first;
        for k in 0..PART {
            let place = lane::<P>(at + k);
            let a = multiply_add::<P, LEVEL>(place, self.second[1], self.second[0]);
            let b = multiply_add::<P, LEVEL>(place, self.third[1], self.third[0]);
            let squared = multiply_add::<P, LEVEL>(a, a, multiply_add::<P, LEVEL>(b, b, first));
            passing.squared[k] = squared * (inverse[k] * inverse[k]);
            let lean = multiply_add::<P, LEVEL>(sx[k], a, -(self.slope * self.first));
            passing.lean[k] = lean * inverse[k];
        }
        if facing {
            let tiny = P::of(1e-15);
            for k in 0..PART {
                let place = lane::<P>(at + k);
                let c = multiply_add::<P, LEVEL>(place, self.along[1], self.along[0]);
                // A ray that points away from the particle misses it. Not a branch: it would cost half.
                let c = (if c > tiny { c } else { tiny }) * inverse[k];
                passing.squared[k] = passing.squared[k] / (c * c);
            }
        }
        passing
    }
}

impl<P: Normal, const N: usize> Rays<P, N> {
    #[inline(always)]
    pub fn lengths(&self, row: usize, part: usize) -> &Part<P> {
        let at = part * PART;
        self.length[row][at..at + PART].try_into().expect("PART of them")
    }
}
