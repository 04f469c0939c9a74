//! Flakes projected several at once, with the bits of [`Sprite::of`].
//!
//! One flake alone waits for five divisions and two roots, one after another. Flakes that rest, or that
//! move in front of the near plane all the way, are done by vectors; one that crosses the plane goes
//! the slow way.

#![expect(unsafe_code, reason = "vectors of flakes by `Lanes`")]

use std::ops::Range;

use super::bins::{Grid, Sorter, TILE};
use super::sprite::{Flake, Lens, REACH, RIM_SHARE, Sprite};
use crate::base::error::Error;
use crate::base::lanes::Lanes;
use crate::base::real::Real;
use crate::base::sampling::{LEAST_VARIANCE, PIXEL_VARIANCE};
use crate::base::simd::{AVX2, AVX512};

/// How many: a multiple of all vectors.
const MOST: usize = 8;

type Numbers = [f64; MOST];

/// Flakes that wait to be projected together.
#[derive(Default)]
pub struct Group {
    count: usize,
    point: [Numbers; 3],
    travel: [Numbers; 3],
    radius: Numbers,
    opacity: Numbers,
    number: [i32; MOST],
    moving: bool,
}

/// What has become of them: a sprite's parts, and of resting ones the first and the last tile that they
/// reach along each axis, and how many pixels they cover.
#[derive(Default)]
struct Images {
    start: [Numbers; 2],
    along: [Numbers; 2],
    length: Numbers,
    sigma: Numbers,
    amplitude: Numbers,
    depth: Numbers,
    /// Depth at the two ends of the exposure.
    ends: [Numbers; 2],
    first: [Numbers; 2],
    last: [Numbers; 2],
    covered: [Numbers; 2],
}

impl Group {
    /// Adds a flake, and says whether there is room for no other one.
    #[inline(always)]
    pub fn push(&mut self, flake: &Flake, number: i32) -> bool {
        let at = self.count;
        for axis in 0..3 {
            self.point[axis][at] = flake.point[axis];
            self.travel[axis][at] = flake.travel[axis];
        }
        self.radius[at] = flake.radius;
        self.opacity[at] = flake.opacity;
        self.number[at] = number;
        self.moving |= flake.travel != [0.0; 3];
        self.count += 1;
        self.count == MOST
    }

    /// Hands on the sprites that can be seen, in their order; the group is empty afterwards.
    #[inline(always)]
    pub fn project<const LEVEL: u8>(
        &mut self,
        lens: &Lens,
        sorter: &mut Sorter<'_>,
    ) -> Result<(), Error> {
        let images = match LEVEL {
            AVX512 => self.images::<<f64 as Real>::Avx512>(lens, sorter.grid),
            AVX2 => self.images::<<f64 as Real>::Avx2>(lens, sorter.grid),
            _ => self.images::<<f64 as Real>::Portable>(lens, sorter.grid),
        };
        for at in 0..self.count {
            let in_front = (images.ends[0][at] >= lens.near) & (images.ends[1][at] >= lens.near);
            if !in_front {
                let crossing = if self.moving { Sprite::of(&self.flake(at), lens) } else { None };
                sorter.place(crossing, self.number[at])?;
            } else if self.moving {
                sorter.place(images.moving(at), self.number[at])?;
            } else if let Some((sprite, rows, columns)) = images.resting(at) {
                sorter.add(sprite, self.number[at], rows, columns)?;
            }
        }
        (self.count, self.moving) = (0, false);
        Ok(())
    }

    #[inline(always)]
    fn flake(&self, at: usize) -> Flake {
        Flake {
            point: self.point.map(|numbers| numbers[at]),
            radius: self.radius[at],
            opacity: self.opacity[at],
            travel: self.travel.map(|numbers| numbers[at]),
        }
    }

    /// [`Sprite::of`] step by step, for a whole exposure in front of the near plane.
    #[inline(always)]
    fn images<V: Lanes<f64>>(&self, lens: &Lens, grid: &Grid) -> Images {
        let mut images = Images::default();
        let limits = [grid.shape.1, grid.shape.0].map(|limit| limit as i64 as f64);
        for at in (0..MOST).step_by(V::N) {
            // SAFETY: `at` and the N behind it lie before MOST, a multiple of N; the caller is compiled
            // for the vectors' level.
            unsafe {
                let load = |numbers: &Numbers| V::load(numbers.as_ptr().add(at));
                let point = [load(&self.point[0]), load(&self.point[1]), load(&self.point[2])];
                let travel = [load(&self.travel[0]), load(&self.travel[1]), load(&self.travel[2])];
                let (half, near) = (V::splat(0.5), V::splat(lens.near));
                let mut middle = point;
                for axis in 0..3 {
                    middle[axis] = point[axis].sub(V::splat(lens.offset[axis]));
                }
                let swing = half.mul(travel[2]);
                middle[2].sub(swing).store(images.ends[0].as_mut_ptr().add(at));
                middle[2].add(swing).store(images.ends[1].as_mut_ptr().add(at));
                let depth = middle[2].max(near);
                let raw =
                    V::splat(lens.focal).mul(load(&self.radius)).div(V::splat(3.0).mul(depth));
                let square = raw.mul(raw);
                let variance = square.add(V::splat(PIXEL_VARIANCE)).max(V::splat(LEAST_VARIANCE));
                let rim = V::splat(1.0).add(V::splat(RIM_SHARE).div(variance));
                let amplitude = load(&self.opacity).mul(square.div(variance).mul(rim));
                let sigma = variance.sqrt();
                depth.store(images.depth.as_mut_ptr().add(at));
                sigma.store(images.sigma.as_mut_ptr().add(at));
                amplitude.store(images.amplitude.as_mut_ptr().add(at));
                let focal = V::splat(lens.focal);
                let center = [V::splat(lens.center[0]), V::splat(lens.center[1])];
                if !self.moving {
                    let scale = focal.div(depth);
                    let reach = V::splat(REACH).mul(sigma);
                    for axis in 0..2 {
                        let place = center[axis].add(scale.mul(middle[axis]));
                        place.store(images.start[axis].as_mut_ptr().add(at));
                        let limit = V::splat(limits[axis]);
                        // `cover::pixels`, the first one and the one behind the last, in tiles.
                        let zero = V::splat(0.0);
                        let first = place.sub(reach).sub(half).max(zero).min(limit);
                        let first = zero.sub(zero.sub(first).floor());
                        let end = place.add(reach).add(half).max(zero).min(limit).floor();
                        let side = V::splat(1.0 / TILE as f64);
                        let last = end.sub(V::splat(1.0)).mul(side).floor();
                        first.mul(side).floor().store(images.first[axis].as_mut_ptr().add(at));
                        last.store(images.last[axis].as_mut_ptr().add(at));
                        end.sub(first).store(images.covered[axis].as_mut_ptr().add(at));
                    }
                    continue;
                }
                let (from, to) = (V::splat(-0.5), half);
                let ahead = [from, to].map(|share| middle[2].add(share.mul(travel[2])).max(near));
                let scales = [focal.div(ahead[0]), focal.div(ahead[1])];
                let (mut start, mut moved) = (center, center);
                for axis in 0..2 {
                    let places = [
                        middle[axis].add(from.mul(travel[axis])),
                        middle[axis].add(to.mul(travel[axis])),
                    ];
                    start[axis] = center[axis].add(scales[0].mul(places[0]));
                    moved[axis] = center[axis].add(scales[1].mul(places[1])).sub(start[axis]);
                    start[axis].store(images.start[axis].as_mut_ptr().add(at));
                    // The motion for now; `sprite` makes a direction of it.
                    moved[axis].store(images.along[axis].as_mut_ptr().add(at));
                }
                let length = moved[0].mul(moved[0]).add(moved[1].mul(moved[1])).sqrt();
                length.store(images.length.as_mut_ptr().add(at));
            }
        }
        images
    }
}

impl Images {
    #[inline(always)]
    fn still(&self, at: usize) -> Sprite {
        Sprite {
            start: [self.start[0][at], self.start[1][at]],
            along: [1.0, 0.0],
            length: 0.0,
            sigma: self.sigma[at],
            amplitude: self.amplitude[at],
            depth: self.depth[at],
        }
    }

    #[inline(always)]
    fn moving(&self, at: usize) -> Option<Sprite> {
        let mut sprite = self.still(at);
        sprite.sweep([self.along[0][at], self.along[1][at]], self.length[at]);
        sprite.within().then_some(sprite)
    }

    #[inline(always)]
    fn resting(&self, at: usize) -> Option<(Sprite, Range<usize>, Range<usize>)> {
        let sprite = self.still(at);
        if !(sprite.within() & (self.covered[0][at] > 0.0) & (self.covered[1][at] > 0.0)) {
            return None;
        }
        let tiles = |axis: usize| {
            // SAFETY: whole numbers of tiles in the picture, as within() says that none is NaN.
            let number = |value: f64| unsafe { value.to_int_unchecked::<i64>() as usize };
            number(self.first[axis][at])..number(self.last[axis][at]) + 1
        };
        Some((sprite, tiles(1), tiles(0)))
    }
}
