//! Opacities from each pixel's ray: the models `viewpoint` and `volume`, and what cuts the gas off.
//!
//! With d = (sx, sy, 1) the slopes of a pixel's ray and C the particle's middle, the vectors C x d and
//! the product C . d are linear in the pixel's row and column. Their values at the tile's corner are
//! float64; a row goes on from there in steps, in the pixels' type. So the distance from the middle
//! is right to the last bits of itself, however far away the particle is.

use super::draw::{PIXELS, TILE};
use super::footprint::{RIM, Scale, lane};
use super::sprite::{Eye, Footprint, Look, Sprite};
use crate::base::normal::{Normal, most};
use crate::base::simd::multiply_add;

/// The rays of a tile's pixels, (sx, sy, 1).
pub struct Rays {
    /// Slopes of the tile's first column and row.
    pub first: [f64; 2],
    /// Slopes from pixel to pixel.
    pub step: f64,
    /// |d|, by pixel.
    pub length: Vec<f64>,
    /// The least and the greatest of the lengths.
    pub range: [f64; 2],
}

impl Rays {
    /// The rays of the tile whose corner is at `origin` (x, y).
    pub fn of(eye: &Eye, origin: [usize; 2], length: &mut Vec<f64>) -> Self {
        let step = 1.0 / eye.focal;
        let first = [0, 1].map(|axis| (origin[axis] as f64 + 0.5 - eye.center[axis]) * step);
        length.clear();
        let mut range = [f64::INFINITY, 0.0_f64];
        for row in 0..TILE {
            let sy = first[1] + row as f64 * step;
            for column in 0..TILE {
                let sx = first[0] + column as f64 * step;
                let value = (1.0 + sx * sx + sy * sy).sqrt();
                range = [range[0].min(value), range[1].max(value)];
                length.push(value);
            }
        }
        Self { first, step, length: std::mem::take(length), range }
    }
}

/// A particle's linear forms over a tile, in units that the model wants.
pub struct Forms {
    /// Components of C x d along x and y and the third, at the tile's corner.
    corner: [f64; 3],
    /// C . d at the corner.
    along: f64,
    place: [f64; 3],
    step: f64,
    /// What the cross product is divided by, to be in sigma.
    scale: f64,
}

impl Forms {
    /// The forms of a sprite.
    pub fn of(sprite: &Sprite, rays: &Rays) -> Self {
        let [x, y, z] = sprite.place;
        let [sx, sy] = rays.first;
        Self {
            corner: [y - z * sy, z * sx - x, x * sy - y * sx],
            along: x * sx + y * sy + z,
            place: sprite.place,
            step: rays.step,
            scale: 1.0 / sprite.sigma,
        }
    }

    /// Fills `q2`, one row of the tile, with the squared distance in sigma.
    #[inline(always)]
    pub fn distance<P: Normal, const LEVEL: u8>(
        &self,
        model: Footprint,
        rays: &Rays,
        row: usize,
        q2: &mut [P; TILE],
    ) {
        let [x, y, z] = self.place;
        let down = row as f64 * self.step;
        let scale = self.scale;
        let v1 = P::of((self.corner[0] - z * down) * scale);
        let (v2, v2_step) = (P::of(self.corner[1] * scale), P::of(z * self.step * scale));
        let (v3, v3_step) =
            (P::of((self.corner[2] + x * down) * scale), P::of(-y * self.step * scale));
        let v1 = v1 * v1;
        if model == Footprint::Viewpoint {
            let away = 1.0 / libm::hypot(libm::hypot(x, y), z);
            let m = P::of((self.along + y * down) * away);
            let m_step = P::of(x * self.step * away);
            for (k, value) in q2.iter_mut().enumerate() {
                let k = lane::<P>(k);
                let a = multiply_add::<P, LEVEL>(k, v2_step, v2);
                let b = multiply_add::<P, LEVEL>(k, v3_step, v3);
                let c = multiply_add::<P, LEVEL>(k, m_step, m);
                let squared = multiply_add::<P, LEVEL>(a, a, multiply_add::<P, LEVEL>(b, b, v1));
                // A ray that points away from the particle misses it. Not a branch: it would cost half.
                let c = most(c, P::of(1e-15));
                *value = squared / (c * c);
            }
        } else {
            let lengths = &rays.length[row * TILE..(row + 1) * TILE];
            for (k, (value, length)) in q2.iter_mut().zip(lengths).enumerate() {
                let k = lane::<P>(k);
                let a = multiply_add::<P, LEVEL>(k, v2_step, v2);
                let b = multiply_add::<P, LEVEL>(k, v3_step, v3);
                let squared = multiply_add::<P, LEVEL>(a, a, multiply_add::<P, LEVEL>(b, b, v1));
                let length = P::of(*length);
                *value = squared / (length * length);
            }
        }
    }

    /// How far along each ray of a row it comes closest to the middle: C . d / |d|, world units.
    #[inline(always)]
    fn approach(&self, lengths: &[f64], row: usize) -> [f64; TILE] {
        let [x, y, _] = self.place;
        let (along, step) = (self.along + y * row as f64 * self.step, x * self.step);
        let mut approach = [0.0; TILE];
        for (k, (approach, length)) in approach.iter_mut().zip(lengths).enumerate() {
            *approach = (along + f64::from(k as i32) * step) / length;
        }
        approach
    }

    /// How far the nearest and the farthest depth of a tile lie behind and before the closest approach, at
    /// least, world units.
    fn clearance(&self, rays: &Rays, [near, far]: [f64; 2]) -> [f64; 2] {
        let [x, y, z] = self.place;
        let last = TILE - 1;
        let (mut most, mut behind) = (f64::NEG_INFINITY, f64::INFINITY);
        for at in [0, last, last * TILE, last * TILE + last] {
            let [down, right] = [at / TILE, at % TILE].map(|steps| steps as f64 * self.step);
            let (along, length) = (self.along + y * down + x * right, rays.length[at]);
            most = most.max(along);
            // Where this is positive at the corners it is not less between them: C . d >= c |d| + D |d|^2
            // holds for a convex set of rays.
            behind = behind.min(along / length - far * length);
        }
        let away = libm::hypot(libm::hypot(x, y), z);
        let approach = away.min(most / rays.range[if most > 0.0 { 0 } else { 1 }]);
        [near * rays.range[0] - approach, behind]
    }
}

/// Turns squared distances into opacities.
#[inline(always)]
pub fn opacities<P: Normal, const LEVEL: u8>(
    values: &mut [P; TILE],
    scale: Scale<P>,
    square: bool,
) {
    for value in values.iter_mut() {
        let q2 = *value;
        let g = P::exp_at::<LEVEL>(most(P::of(-0.5) * q2, P::of(-80.0)));
        let alpha = most(multiply_add::<P, LEVEL>(scale.gain, g, -scale.floor), P::zero());
        *value = if square && q2 > P::of(9.0) { P::zero() } else { alpha };
    }
}

/// What stands in the picture, over one tile.
pub struct Ground<'a, P> {
    /// Depth, by pixel; infinity where nothing stands.
    pub depth: &'a [P; PIXELS],
    /// The nearest and the farthest of them.
    pub range: [f64; 2],
}

/// What cuts a particle off within a tile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cut {
    /// Nothing.
    Clear,
    /// All of it is hidden.
    Hidden,
    /// What stands in the picture hides it whole, pixel by pixel: at its planar depth, or for
    /// [`Footprint::Viewpoint`] where the ray comes closest to its middle.
    Hard,
    /// What stands in the picture cuts into it, at the same place.
    Soft,
    /// The near plane and what stands in the picture end the line integral.
    Line,
}

/// What cuts a particle off; the ranges of the tile settle it for most.
pub fn cut<P: Normal>(
    sprite: &Sprite,
    look: &Look,
    rays: Option<&Rays>,
    ground: Option<&Ground<'_, P>>,
) -> Cut {
    let (model, near, hard) = (sprite.model, look.near, look.hard);
    if ground.is_none() && model != Footprint::Volume {
        return Cut::Clear;
    }
    let [x, y, depth] = sprite.place;
    let sigma = sprite.sigma;
    // Beyond this many sigma the normal law has reached 0 or 1.
    let saturated = P::SATURATED * sigma;
    let far = ground.map_or([f64::INFINITY; 2], |ground| ground.range);
    if let (Footprint::Viewpoint, Some(rays)) = (model, rays) {
        let [before, behind] = Forms::of(sprite, rays).clearance(rays, far);
        return match hard {
            _ if before > if hard { 0.0 } else { saturated } => Cut::Clear,
            true if behind >= 0.0 => Cut::Hidden,
            true => Cut::Hard,
            false if behind > saturated => Cut::Hidden,
            false => Cut::Soft,
        };
    }
    if hard && ground.is_some() {
        let level = P::of(depth).wide();
        if far[1] <= level {
            return Cut::Hidden;
        }
        if far[0] <= level {
            // The near plane of `volume` is minded as well.
            return if model == Footprint::Volume { Cut::Line } else { Cut::Hard };
        }
    }
    if let (Footprint::Volume, Some(rays)) = (model, rays) {
        let away = libm::hypot(libm::hypot(x, y), depth);
        let before = sprite.nearest() - near * rays.range[1] > saturated && depth > 0.0;
        let behind = hard || far[0] * rays.range[0] - away > saturated;
        return if before && behind { Cut::Clear } else { Cut::Line };
    }
    if hard || far[0] - depth > saturated {
        Cut::Clear
    } else if depth - far[1] > saturated {
        Cut::Hidden
    } else {
        Cut::Soft
    }
}

/// Multiplies one row's opacities by what the cut leaves of them.
#[inline(always)]
pub fn cut_row<P: Normal>(
    alpha: &mut [P; TILE],
    cut: Cut,
    sprite: &Sprite,
    look: &Look,
    rays: Option<&Rays>,
    ground: Option<&Ground<'_, P>>,
    row: usize,
) {
    let (near, hard) = (look.near, look.hard);
    let part = row * TILE..(row + 1) * TILE;
    let depth = sprite.place[2];
    let map = ground.map(|ground| &ground.depth[part.clone()]);
    let inverse = 1.0 / sprite.sigma;
    let lengths = rays.map(|rays| &rays.length[part]);
    let approach = rays.zip(lengths).filter(|_| sprite.model.by_ray());
    let approach = approach.map(|(rays, all)| (Forms::of(sprite, rays).approach(all, row), all));
    if let (Footprint::Viewpoint, Some((approach, lengths)), Some(map)) =
        (sprite.model, &approach, map)
    {
        for k in 0..TILE {
            let clear = map[k].wide() * lengths[k] - approach[k];
            let shown = if cut == Cut::Soft {
                below(P::of(clear * inverse))
            } else if clear > 0.0 {
                P::one()
            } else {
                P::zero()
            };
            alpha[k] *= shown;
        }
        return;
    }
    if (cut == Cut::Hard || (cut == Cut::Line && hard))
        && let Some(map) = map
    {
        let level = P::of(depth);
        for (alpha, ground) in alpha.iter_mut().zip(map) {
            *alpha = if level < *ground { *alpha } else { P::zero() };
        }
    }
    match (cut, map, approach) {
        (Cut::Soft, Some(map), _) => {
            for (alpha, ground) in alpha.iter_mut().zip(map) {
                let u = P::of((ground.wide() - depth) * inverse);
                *alpha *= below(u);
            }
        }
        (Cut::Line, map, Some((approach, lengths))) => {
            let mut end = [f64::INFINITY; TILE];
            if let (Some(map), false) = (map, hard) {
                for (end, ground) in end.iter_mut().zip(map) {
                    *end = ground.wide();
                }
            }
            for (k, (alpha, length)) in alpha.iter_mut().zip(lengths).enumerate() {
                let from = P::of((near * length - approach[k]) * inverse);
                let to = P::of((end[k] * length - approach[k]) * inverse);
                *alpha *= between(from, to);
            }
        }
        _ => {}
    }
}

/// The normal law up to u.
#[inline(always)]
fn below<P: Normal>(u: P) -> P {
    let half = P::of(0.5) * P::tail(u.abs());
    if u > P::zero() { P::one() - half } else { half }
}

/// The normal law between two places, 0 if they are in the wrong order; subtracted in the tail.
#[inline(always)]
fn between<P: Normal>(from: P, to: P) -> P {
    let (a, b) = (P::of(0.5) * P::tail(from.abs()), P::of(0.5) * P::tail(to.abs()));
    let right = from > P::zero();
    let left = to < P::zero();
    let share = if right {
        a - b
    } else if left {
        b - a
    } else {
        P::one() - (a + b)
    };
    if to > from { most(share, P::zero()) } else { P::zero() }
}

/// The tapered Gaussian at a distance q in sigma, float64.
pub fn tapered(q: f64) -> f64 {
    ((libm::exp(-0.5 * q * q) - RIM) / (1.0 - RIM)).max(0.0)
}
