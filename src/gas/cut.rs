//! What cuts a particle off: the near plane before it, what stands in the picture behind it.
//!
//! The share of a line integral between two places along a ray is that of the normal law. Error
//! functions are evaluated only where this share is not 1 to the samples' last bits: most particles of
//! a tile are farther from both ends than that.

use super::rays::{Forms, PART, Part, Sheet};
use super::sprite::{Footprint, Look, Sprite};
use crate::base::normal::{Normal, most};

/// What stands in the picture, over one tile.
pub struct Ground<'a, P, const N: usize> {
    /// Depth, by pixel; infinity where nothing stands.
    pub depth: &'a [[P; N]; N],
    /// The nearest and the farthest of them.
    pub range: [f64; 2],
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wall {
    None,
    /// It cuts into the particle at its depth along the ray.
    Ray,
    /// It hides the whole particle, by pixel, if it is nearer than where the ray passes the middle.
    RayHard,
    /// It cuts into the particle at its planar depth.
    Plane,
    /// It hides the whole particle, by pixel, if its planar depth is less than the middle's.
    PlaneHard,
}

/// What cuts a particle off within a sheet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// Whether the near plane ends the line integral.
    pub near: bool,
    pub wall: Wall,
}

impl Cut {
    pub const CLEAR: Self = Self { near: false, wall: Wall::None };
}

/// What cuts a particle off; the ranges of the sheet settle it for most. None if all of it is hidden.
pub fn cut<P: Normal>(
    sprite: &Sprite,
    look: &Look,
    sheet: &Sheet,
    last: usize,
    ground: Option<[f64; 2]>,
) -> Option<Cut> {
    let volume = sprite.model == Footprint::Volume;
    if ground.is_none() && !volume {
        return Some(Cut::CLEAR);
    }
    // Beyond this many sigma the normal law has reached 0 or 1.
    let saturated = P::SATURATED * sprite.sigma;
    let depth = sprite.place[2];
    let mut cut = Cut::CLEAR;
    if volume {
        // A ray that passes at q sigma meets the near plane at t sigma from there with q^2 + t^2 no less
        // than the distance of the middle from it, so what is cut off is at most the normal law's tail
        // at that distance, times the density.
        cut.near = !(sprite.away - look.near * sheet.range[1] > saturated && depth > 0.0);
        if cut.near && Forms::of(sprite, sheet).before(look.near, last) > saturated {
            return None;
        }
    }
    let Some([nearest, farthest]) = ground else { return Some(cut) };
    let saturated = P::SATURATED * sprite.sigma;
    if look.hard && sprite.model != Footprint::Viewpoint {
        let level = P::of(depth).wide();
        if farthest <= level {
            return None;
        }
        if nearest <= level {
            cut.wall = Wall::PlaneHard;
        }
        return Some(cut);
    }
    if sprite.model.by_ray() {
        let edge = if look.hard { 0.0 } else { saturated };
        if volume && nearest * sheet.range[0] - sprite.away > saturated {
            return Some(cut);
        }
        let forms = Forms::of(sprite, sheet);
        if forms.before(nearest, last) > edge {
            return Some(cut);
        }
        let behind = forms.behind(farthest, last);
        if if look.hard { behind >= 0.0 } else { behind > saturated } {
            return None;
        }
        cut.wall = if look.hard { Wall::RayHard } else { Wall::Ray };
    } else if depth - farthest > saturated {
        return None;
    } else if nearest - depth <= saturated {
        cut.wall = Wall::Plane;
    }
    Some(cut)
}

/// What the ends leave of a particle in a part of a row.
pub enum Share<P> {
    Hidden,
    Whole,
    /// By sample, 0 to 1.
    Part(Part<P>),
}

/// Where a particle's ends are, in units of its sigma.
pub struct Ends<P> {
    /// The middle's depth: rounded to the samples' type, and the rest.
    depth: [P; 2],
    inverse: P,
    near: P,
    /// From here on nothing is cut off, and nothing left before it.
    settled: P,
    cut: Cut,
}

impl<P: Normal> Ends<P> {
    #[inline(always)]
    pub fn of(sprite: &Sprite, look: &Look, cut: Cut) -> Self {
        let (depth, inverse) = (sprite.place[2], 1.0 / sprite.sigma);
        let first = P::of(depth);
        Self {
            depth: [first, P::of(depth - first.wide())],
            inverse: P::of(inverse),
            near: P::of((look.near - depth) * inverse),
            settled: P::of(P::SATURATED),
            cut,
        }
    }

    /// What the ends leave of a part of a row. Most parts of a tile that something stands in lie whole
    /// before it or behind it: error functions are for the others.
    #[inline(always)]
    pub fn share<const LEVEL: u8>(
        &self,
        lean: &Part<P>,
        length: Option<&Part<P>>,
        ground: Option<&Part<P>>,
    ) -> Share<P> {
        let (settled, Cut { mut near, mut wall }) = (self.settled, self.cut);
        let (mut from, mut to) = ([P::zero(); PART], [P::zero(); PART]);
        if let (true, Some(length)) = (near, length) {
            let (mut hidden, mut clear) = (true, true);
            for k in 0..PART {
                from[k] = self.near * length[k] + lean[k];
                hidden &= from[k] > settled;
                clear &= from[k] < -settled;
            }
            if hidden {
                return Share::Hidden;
            }
            near = !clear;
        }
        if let Some(ground) = ground.filter(|_| wall != Wall::None) {
            for (to, &ground) in to.iter_mut().zip(ground) {
                *to = ((ground - self.depth[0]) - self.depth[1]) * self.inverse;
            }
            if let (Wall::Ray | Wall::RayHard, Some(length)) = (wall, length) {
                for k in 0..PART {
                    to[k] = to[k] * length[k] + lean[k];
                }
            }
            let (mut hidden, mut clear) = (true, true);
            for &to in to.iter() {
                hidden &= to < -settled;
                clear &= to > settled;
            }
            if hidden {
                return Share::Hidden;
            }
            if clear {
                wall = Wall::None;
            }
        }
        let mut share = [P::one(); PART];
        match wall {
            Wall::None if !near => return Share::Whole,
            Wall::None => {}
            Wall::Ray if near => {
                for k in 0..PART {
                    share[k] = between::<P, LEVEL>(from[k], to[k]);
                }
                return Share::Part(share);
            }
            Wall::Ray | Wall::Plane => {
                for k in 0..PART {
                    share[k] = below::<P, LEVEL>(to[k]);
                }
            }
            Wall::RayHard => {
                for k in 0..PART {
                    share[k] = if to[k] > P::zero() { P::one() } else { P::zero() };
                }
            }
            Wall::PlaneHard => {
                let Some(ground) = ground else { return Share::Hidden };
                for k in 0..PART {
                    // The middle's depth counts as the samples' type has it.
                    share[k] = if self.depth[0] < ground[k] { P::one() } else { P::zero() };
                }
            }
        }
        if near {
            for k in 0..PART {
                share[k] *= below::<P, LEVEL>(-from[k]);
            }
        }
        Share::Part(share)
    }
}

/// The normal law up to u.
#[inline(always)]
fn below<P: Normal, const LEVEL: u8>(u: P) -> P {
    let half = P::of(0.5) * P::tail_at::<LEVEL>(u.abs());
    if u > P::zero() { P::one() - half } else { half }
}

/// The normal law between two places, 0 if they are in the wrong order; subtracted in the tail.
#[inline(always)]
fn between<P: Normal, const LEVEL: u8>(from: P, to: P) -> P {
    let half = P::of(0.5);
    let (a, b) = (half * P::tail_at::<LEVEL>(from.abs()), half * P::tail_at::<LEVEL>(to.abs()));
    let (right, left) = (a - b, b - a);
    let share = if to < P::zero() { left } else { P::one() - (a + b) };
    let share = if from > P::zero() { right } else { share };
    if to > from { most(share, P::zero()) } else { P::zero() }
}
