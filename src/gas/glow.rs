//! The light of lamps that slices of gas scatter towards the eye: once, with extinction on both ways.
//!
//! L = sum over slices of T * integral of k exp(-k (s - s0)) * p(angle) * I exp(-k r) / max(r, R)^2 ds,
//! T the transmittance up to the slice, which begins at s0 of the ray, k its extinction there, r the
//! distance from a lamp of intensity I and radius R, p the phase function. Near a lamp the integrand
//! is as steep as 1 / r^2; of t = tan(angle / 2), angle the one at which the lamp sees the ray, with
//! R added to their distance, it is smooth.

use ndarray::{ArrayViewMut3, Axis};

use super::slices::{COARSE, Slices, pixels};
use crate::base::error::{Cancel, Error, layout, zeroed};
use crate::base::lamps::{Lamp, Lamps, left};
use crate::base::normal::{least, most};
use crate::base::pixel::smoothstep;
use crate::base::pool;
use crate::base::simd::dispatch;

/// Pixels at a time.
const LANES: usize = 16;

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

type Lane = [f32; LANES];

/// Some pixels of a row, and a slice on their rays.
#[derive(Default)]
struct Rays {
    /// Metres of the way for a depth of 1.
    length: Lane,
    slope: Lane,
    down: f32,
    /// Where the slice begins and ends on the way, metres; its extinction, and what reaches the eye
    /// from its near end.
    from: Lane,
    to: Lane,
    extinction: Lane,
    through: Lane,
}

/// Adds the light that slices scatter to `out` (H, W, 3).
pub fn add(
    mut out: ArrayViewMut3<'_, f32>,
    slices: &Slices<'_>,
    lamps: &Lamps,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (height, width, _) = out.dim();
    slices.check((height, width))?;
    let (count, _, columns) = slices.density.dim();
    let room = columns * COARSE + LANES;
    let tasks: Vec<_> = out.axis_chunks_iter_mut(Axis(0), 16).enumerate().collect();
    pool::for_each(tasks, |(number, mut band)| {
        cancel.check()?;
        let (mut line, mut end) = (zeroed::<f32>(columns)?, zeroed::<f32>(room)?);
        let mut dense = (0..count).map(|_| zeroed(room)).collect::<Result<Vec<_>, _>>()?;
        let mut slopes = zeroed::<f32>(room)?;
        slopes[..width].copy_from_slice(slices.slopes.0);
        for (row, mut out) in band.outer_iter_mut().enumerate() {
            let row = 16 * number + row;
            slices.ends(row, &mut end)?;
            let mut planes = dense.iter_mut();
            slices.lines(row, &mut line, |line, _| {
                if let Some(plane) = planes.next() {
                    fill(plane, line);
                }
            })?;
            let pixels = (&slopes[..], slices.slopes.1[row], &end[..]);
            let (out, _) = out.as_slice_mut().ok_or_else(layout)?.as_chunks_mut::<3>();
            for (number, out) in out.chunks_mut(LANES).enumerate() {
                let light = block(lamps, &dense, slices.edges, pixels, number * LANES);
                for (k, out) in out.iter_mut().enumerate() {
                    (0..3).for_each(|c| out[c] += light[c][k]);
                }
            }
        }
        Ok(())
    })
}

#[dispatch]
fn fill<const LEVEL: u8>(plane: &mut [f32], line: &[f32]) {
    for (four, three) in plane.as_chunks_mut::<COARSE>().0.iter_mut().zip(line.windows(3)) {
        *four = pixels::<LEVEL>(three);
    }
}

/// The light of some pixels of a row from `at` on, by channels.
#[dispatch]
fn block<const LEVEL: u8>(
    lamps: &Lamps,
    dense: &[Vec<f32>],
    edges: &[f32],
    row: (&[f32], f32, &[f32]),
    at: usize,
) -> [Lane; 3] {
    let ((slopes, down, end), mut light) = (row, [[0.0; LANES]; 3]);
    let mut rays = Rays { down, through: [1.0; LANES], ..Rays::default() };
    for k in 0..LANES {
        let x = slopes[at + k];
        rays.slope[k] = x;
        rays.length[k] = (1.0 + x * x + down * down).sqrt();
    }
    for (plane, edges) in dense.iter().zip(edges.windows(2)) {
        for k in 0..LANES {
            let stop = most(least(end[at + k], edges[1]), edges[0]);
            rays.from[k] = edges[0] * rays.length[k];
            rays.to[k] = stop * rays.length[k];
            rays.extinction[k] = plane[at + k];
        }
        for lamp in &lamps.lamps {
            let mut found = [0.0; LANES];
            if let Some(place) = lamp.place {
                found = near::<LEVEL>(lamps, lamp, place, &rays);
            } else {
                // A sun's way through the gas is not known.
                let [x, y, z] = lamp.way.map(|part| part as f32);
                for k in 0..LANES {
                    let cosine = -(x * rays.slope[k] + y * down + z) / rays.length[k];
                    let thick = rays.extinction[k] * (rays.to[k] - rays.from[k]);
                    let taken = rays.through[k] * (1.0 - left::<f32, LEVEL>(thick));
                    found[k] = taken * lamps.phase(cosine);
                }
            }
            for (light, color) in light.iter_mut().zip(lamp.color) {
                for k in 0..LANES {
                    light[k] += found[k] * color as f32;
                }
            }
        }
        for k in 0..LANES {
            rays.through[k] *= left::<f32, LEVEL>(rays.extinction[k] * (rays.to[k] - rays.from[k]));
        }
    }
    light
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

/// The light of a lamp in a slice.
#[inline(always)]
fn near<const LEVEL: u8>(lamps: &Lamps, lamp: &Lamp, place: [f64; 3], rays: &Rays) -> Lane {
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
    let (mut from, mut to) = (rays.from, rays.to);
    if outer > 0.0 {
        for k in 0..LANES {
            let [first, last] = cone(along[k], behind, foot[k], aside[k], outer);
            from[k] = least(most(from[k], first), to[k]);
            to[k] = most(least(to[k], last), from[k]);
        }
    }
    let air = [lamp.air.0 as f32, lamp.air.1 as f32];
    let mut light = [0.0; LANES];
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
                let thick = rays.extinction[k] * (most(s - rays.from[k], 0.0) + distance);
                light[k] += part * left::<f32, LEVEL>(thick + air[0] * distance + air[1] * s);
            }
        }
    }
    for k in 0..LANES {
        light[k] *= rays.extinction[k] * rays.through[k];
    }
    light
}
