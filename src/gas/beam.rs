//! The light of lamps that a slice of gas scatters along a ray towards the eye, with extinction on both ways.
//!
//! It is the integral of exp(-k (s - s0)) * p(angle) * I exp(-k r) / max(r, R)^2 ds over a slice of extinction k that
//! begins at s0 of the ray, r the distance from a lamp of intensity I and radius R, p the phase function. Near a lamp
//! the integrand is as steep as 1 / r^2; of t = tan(angle / 2), angle the one at which the lamp sees the ray, with R
//! added to their distance, it is smooth.

use crate::base::lamps::{Lamp, Lamps, left};
use crate::base::normal::{least, most};
use crate::base::pixel::smoothstep;

/// Pixels at a time.
pub const LANES: usize = 16;

/// The rule of Gauss and Legendre on [0, 1].
const RULE: [(f32, f32); 8] = [
    (0.019_855_072, 0.050_614_27),
    (0.101_666_76, 0.111_190_52),
    (0.237_233_8, 0.156_853_32),
    (0.408_282_68, 0.181_341_89),
    (0.591_717_3, 0.181_341_89),
    (0.762_766_2, 0.156_853_32),
    (0.898_333_25, 0.111_190_52),
    (0.980_144_9, 0.050_614_27),
];

pub type Lane = [f32; LANES];

/// Some pixels of a row, and a slice on their rays.
pub struct Rays {
    /// Metres of the way for a depth of 1.
    pub length: Lane,
    pub slope: Lane,
    pub down: f32,
    /// Where the slice begins and ends on the way, metres; its extinction.
    pub from: Lane,
    pub to: Lane,
    pub extinction: Lane,
}

impl Rays {
    #[inline(always)]
    pub fn new(slope: Lane, down: f32) -> Self {
        let (from, to, extinction) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let length = slope.map(|x| (1.0 + x * x + down * down).sqrt());
        Self { length, slope, down, from, to, extinction }
    }

    /// Goes on to a slice between two depths, which ends where `end` is.
    #[inline(always)]
    pub fn at(&mut self, edges: &[f32], end: &Lane, extinction: Lane) {
        self.extinction = extinction;
        for k in 0..LANES {
            self.from[k] = edges[0] * self.length[k];
            self.to[k] = most(least(end[k], edges[1]), edges[0]) * self.length[k];
        }
    }
}

/// The part of a ray inside a spot's cone, metres, of the cosine of its rim: where
/// (a s - b)^2 >= cosine^2 ((s - foot)^2 + aside), a and b the axis along the ray and at the lamp, on the side
/// that the lamp shines to.
#[inline(always)]
fn cone(along: f32, behind: f32, foot: f32, aside: f32, cosine: f32) -> [f32; 2] {
    let square = cosine * cosine;
    let two = along * along - square;
    let two = if two.abs() < 1e-6 { 1e-6 } else { two };
    let one = square * foot - along * behind;
    let none = behind * behind - square * (foot * foot + aside);
    let root = one * one - two * none;
    let width = most(root, 0.0).sqrt() / two.abs();
    let middle = -one / two;
    let [low, high] = [middle - width, middle + width];
    if two < 0.0 {
        let lit = root > 0.0 && along * middle > behind;
        if lit { [low, high] } else { [0.0, 0.0] }
    } else if along > 0.0 {
        [high, f32::INFINITY]
    } else {
        [f32::NEG_INFINITY, low]
    }
}

/// The light of all lamps in a slice, by channels, as [`one`] has it.
#[inline(always)]
pub fn near<const LEVEL: u8>(lamps: &Lamps, rays: &Rays, reach: f32) -> [Lane; 3] {
    let (mut light, all) = (suns::<LEVEL>(lamps, rays), moments::<LEVEL>(lamps, rays, reach));
    for (light, [found, ..]) in light.iter_mut().zip(all) {
        light.iter_mut().zip(found).for_each(|(light, found)| *light += found);
    }
    light
}

/// The light of lamps that have a place, by channels, and its moments, as [`one`] has them.
#[inline(always)]
pub fn moments<const LEVEL: u8>(lamps: &Lamps, rays: &Rays, reach: f32) -> [[Lane; 3]; 3] {
    let mut all = [[[0.0; LANES]; 3]; 3];
    for lamp in &lamps.lamps {
        let Some(place) = lamp.place else { continue };
        let found = one::<LEVEL>(lamps, lamp, place, rays, reach);
        for (all, color) in all.iter_mut().zip(lamp.color) {
            for (all, found) in all.as_flattened_mut().iter_mut().zip(found.as_flattened()) {
                *all += found * color as f32;
            }
        }
    }
    all
}

/// The light of suns, whose way through the gas is not known, in the same way.
#[inline(always)]
pub fn suns<const LEVEL: u8>(lamps: &Lamps, rays: &Rays) -> [Lane; 3] {
    let mut light = [[0.0; LANES]; 3];
    for lamp in lamps.lamps.iter().filter(|lamp| lamp.place.is_none()) {
        let [x, y, z] = lamp.way.map(|part| part as f32);
        for k in 0..LANES {
            let cosine = -(x * rays.slope[k] + y * rays.down + z) / rays.length[k];
            let extinction = most(rays.extinction[k], 1e-12);
            let taken = 1.0 - left::<f32, LEVEL>(extinction * (rays.to[k] - rays.from[k]));
            let found = taken / extinction * lamps.phase(cosine);
            light.iter_mut().zip(lamp.color).for_each(|(light, c)| light[k] += found * c as f32);
        }
    }
    light
}

/// The light of a lamp in a slice over its extinction and what reaches the eye, and the same times its way in the slice's gas
/// once and twice: the slopes by extinction. NaN where the lamp is nearer to the rays than `reach` for a depth of 1.
#[inline(always)]
fn one<const LEVEL: u8>(
    lamps: &Lamps,
    lamp: &Lamp,
    place: [f64; 3],
    rays: &Rays,
    reach: f32,
) -> [Lane; 3] {
    let [x, y, z] = [0, 1, 2].map(|axis| (place[axis] - lamps.eye[axis]) as f32);
    let way = lamp.way.map(|part| part as f32);
    let (radius, spot) = (lamp.radius as f32, lamp.cone.0 > -1.0);
    let (inner, outer) = (lamp.cone.0 as f32, lamp.cone.1 as f32);
    let soft = most(inner - outer, 1e-6);
    let (mut foot, mut aside, mut wide) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    // The lamp's axis along the ray, and at the lamp from the eye.
    let mut along = [0.0; LANES];
    let behind = x * way[0] + y * way[1] + z * way[2];
    for k in 0..LANES {
        let (a, b, length) = (rays.slope[k], rays.down, rays.length[k]);
        foot[k] = (x * a + y * b + z) / length;
        let cross = [y - b * z, z * a - x, x * b - y * a];
        aside[k] =
            (cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]) / (length * length);
        wide[k] = (aside[k] + radius * radius).sqrt();
        along[k] = (a * way[0] + b * way[1] + way[2]) / length;
    }
    let (mut from, mut to, mut light) = (rays.from, rays.to, [[0.0; LANES]; 3]);
    for k in 0..LANES {
        // The nearest place of the slice to the lamp.
        let s = least(most(foot[k], from[k]), to[k]);
        let distance = (wide[k] * wide[k] + (s - foot[k]) * (s - foot[k])).sqrt();
        let steep = distance < reach * s || (spot && reach > 0.0);
        light[0][k] = if steep { f32::NAN } else { 0.0 };
    }
    if outer > 0.0 {
        for k in 0..LANES {
            let [first, last] = cone(along[k], behind, foot[k], aside[k], outer);
            from[k] = least(most(from[k], first), to[k]);
            to[k] = most(least(to[k], last), from[k]);
        }
    }
    let air = [lamp.air.0 as f32, lamp.air.1 as f32];
    for sign in [-1.0_f32, 1.0] {
        // Of the half of the ray before the lamp's foot, or behind it: t at the ends of the slice.
        let (mut first, mut span, mut widest) = ([0.0; LANES], [0.0; LANES], 0.0_f32);
        for k in 0..LANES {
            let ends = [sign * (from[k] - foot[k]), sign * (to[k] - foot[k])];
            let [t0, t1] = ends.map(|u| {
                let u = most(u, 0.0);
                wide[k] / (u + (u * u + wide[k] * wide[k]).sqrt())
            });
            first[k] = least(t0, t1);
            span[k] = most(t0, t1) - first[k];
            widest = most(widest, span[k]);
        }
        if widest == 0.0 {
            continue;
        }
        for (node, weight) in RULE {
            for k in 0..LANES {
                // Close together towards the lamp's far side, where light goes on nearly straight.
                let t = first[k] + span[k] * node * node;
                let one = 1.0 / t;
                let u = 0.5 * wide[k] * (one - t);
                let step = wide[k] * (0.5 + 0.5 * one * one) * 2.0 * node * weight * span[k];
                let square = u * u + aside[k];
                let distance = square.sqrt();
                let s = foot[k] + sign * u;
                let cosine = -sign * u / most(distance, 1e-9);
                let mut part = step * lamps.phase(cosine) / most(square, radius * radius);
                if spot {
                    let axis = (s * along[k] - behind) / most(distance, 1e-9);
                    part *= smoothstep((axis - outer) / soft);
                }
                let way = most(s - rays.from[k], 0.0) + distance;
                let thick = rays.extinction[k] * way + air[0] * distance + air[1] * s;
                let part = part * left::<f32, LEVEL>(thick);
                light[0][k] += part;
                light[1][k] += part * way;
                light[2][k] += part * way * way;
            }
        }
    }
    light
}
