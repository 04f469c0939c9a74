//! The light of lamps that slices of gas scatter towards the eye: once, with extinction on both ways.
//!
//! L = sum over slices of T * integral of k exp(-k (s - s0)) * p(angle) * I exp(-k r) / max(r, R)^2 ds,
//! T the transmittance up to the slice, which begins at s0 of the ray, k its extinction there, r the
//! distance from a lamp of intensity I and radius R, p the phase function. Near a lamp the integrand
//! is as steep as 1 / r^2; of t = tan(angle / 2), angle the one at which the lamp sees the ray, with
//! R added to their distance, it is smooth.
//!
//! For a slice's own k and T that integral is smooth over the picture too: it is found at every second place of the
//! slices' coarse grid, and at every pixel only near a lamp, in the light of a spot and where the scene ends the slice.

use ndarray::{Array3, ArrayViewMut2, ArrayViewMut3, Axis, Zip, s};

use super::slices::{COARSE, MARGIN, Slices, lines, pixels};
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

/// Rows of pixels of one task.
const BAND: usize = 64;

/// A lamp that is nearer than so many coarse samples wants every pixel: the grid is .2 % off there.
const STEEP: f32 = 16.0;

/// And so does gas whose optical depth in a slice, times what reaches the eye from there, changes by so much from
/// one place to the next.
const ROUGH: f32 = 0.1;

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

/// Writes the opacity of slices, (H, W), and the sum of `places`, each times the share that its slice takes, and adds
/// the light of lamps that they scatter to `light`, (H, W, 3). `grid` are the slopes of coarse columns and rows.
pub fn see(
    (mut opacity, mut far): (ArrayViewMut2<'_, f32>, ArrayViewMut2<'_, f32>),
    mut light: Option<ArrayViewMut3<'_, f32>>,
    (slices, grid, places): (&Slices<'_>, (&[f32], &[f32]), &[f32]),
    lamps: &Lamps,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (height, width) = opacity.dim();
    slices.check((height, width))?;
    let (count, rows, columns) = slices.density.dim();
    let fits = (far.dim(), places.len()) == ((height, width), count)
        && (grid.0.len(), grid.1.len()) == (columns, rows)
        && light.as_ref().is_none_or(|light| light.dim() == (height, width, 3));
    if !fits {
        return Err(Error::Internal("slices of gas do not fit their planes".into()));
    }
    let room = columns * COARSE + LANES;
    let planes = opacity.axis_chunks_iter_mut(Axis(0), BAND);
    let planes = planes.zip(far.axis_chunks_iter_mut(Axis(0), BAND));
    let mut light = light.as_mut().map(|light| light.axis_chunks_iter_mut(Axis(0), BAND));
    let light = std::iter::from_fn(|| Some(light.as_mut().and_then(Iterator::next)));
    let tasks: Vec<_> = planes.zip(light).enumerate().collect();
    pool::for_each(tasks, |(number, ((mut opacity, mut far), mut light))| {
        cancel.check()?;
        let lines_of = |count| (0..count).map(|_| zeroed(room)).collect::<Result<Vec<_>, _>>();
        let (mut line, mut end, mut slopes) = (zeroed(columns)?, zeroed(room)?, zeroed(room)?);
        let (mut dense, mut glow) = (lines_of(count)?, lines_of(3 * count)?);
        slopes[..width].copy_from_slice(slices.slopes.0);
        let first = number * BAND / COARSE;
        let last = (first + BAND / COARSE + 2 * MARGIN + 1).min(rows);
        let shape = (3 * count, last - first, columns);
        let coarse = zeroed(shape.0 * shape.1 * shape.2)?;
        let mut coarse = Array3::from_shape_vec(shape, coarse).map_err(|_| layout())?;
        let lit = if light.is_some() { 0..last - first } else { 0..0 };
        for row in lit.clone().filter(|row| row % 2 == 0 || first + row + 1 == rows) {
            samples(slices, grid, lamps, first + row, coarse.index_axis_mut(Axis(1), row));
        }
        for row in lit.filter(|row| row % 2 == 1 && first + row + 1 < last) {
            let around = (s![.., row - 1, ..], s![.., row, ..], s![.., row + 1, ..]);
            let (above, here, below) = coarse.multi_slice_mut(around);
            Zip::from(here).and(above).and(below).for_each(|here, a, b| *here = 0.5 * (*a + *b));
        }
        for (within, mut opacity) in opacity.outer_iter_mut().enumerate() {
            let row = BAND * number + within;
            slices.ends(row, &mut end)?;
            lines(&slices.density, row, &mut line, |line, plane| fill(&mut dense[plane], line))?;
            let mut light = light.as_mut().map(|light| light.index_axis_mut(Axis(0), within));
            if light.is_some() {
                let planes = coarse.view();
                lines(&planes, within, &mut line, |line, plane| fill(&mut glow[plane], line))?;
            }
            let mut far = far.row_mut(within);
            let far = far.as_slice_mut().ok_or_else(layout)?.chunks_mut(LANES);
            let opacity = opacity.as_slice_mut().ok_or_else(layout)?.chunks_mut(LANES);
            let rays = (&slopes[..], slices.slopes.1[row], &end[..]);
            for (number, (opacity, far)) in opacity.zip(far).enumerate() {
                let (at, gas) = (number * LANES, (&dense[..], &glow[..], slices.edges, places));
                let [red, green, blue, through, depth] = block(lamps, gas, rays, at);
                opacity.iter_mut().zip(through).for_each(|(opacity, left)| *opacity = 1.0 - left);
                far.copy_from_slice(&depth[..far.len()]);
                for k in 0..far.len() {
                    let Some(light) = &mut light else { break };
                    light[[at + k, 0]] += red[k];
                    light[[at + k, 1]] += green[k];
                    light[[at + k, 2]] += blue[k];
                }
            }
        }
        Ok(())
    })
}

/// Fills a row of coarse samples with the light of lamps in each slice over its extinction and what reaches the
/// eye, red, green and blue of one after the other; NaN where the samples are too far apart. Every second is found.
#[dispatch]
fn samples<const LEVEL: u8>(
    slices: &Slices<'_>,
    grid: (&[f32], &[f32]),
    lamps: &Lamps,
    row: usize,
    out: ArrayViewMut2<'_, f32>,
) {
    let (mut out, down) = (out, grid.1[row]);
    let step = most(grid.0[1] - grid.0[0], grid.1[1] - grid.1[0]);
    for (number, edges) in slices.edges.windows(2).enumerate() {
        let dense = slices.density.slice(s![number, row, ..]);
        let above = slices.density.slice(s![number, row.max(2) - 2, ..]);
        let last = dense.len() - 1;
        for at in (0..=last + 1).step_by(2 * LANES) {
            let mut rays = Rays { down, ..Rays::default() };
            for k in 0..LANES {
                let column = (at + 2 * k).min(last);
                let x = grid.0[column];
                rays.slope[k] = x;
                rays.length[k] = (1.0 + x * x + down * down).sqrt();
                rays.from[k] = edges[0] * rays.length[k];
                rays.to[k] = edges[1] * rays.length[k];
                rays.extinction[k] = dense[column];
            }
            let light = near::<LEVEL>(lamps, &rays, step);
            for k in 0..LANES.min((last + 1 - at).div_ceil(2) + 1) {
                let column = (at + 2 * k).min(last);
                let (here, beside) = (rays.extinction[k], dense[column.max(2) - 2]);
                let change = most((beside - here).abs(), (above[column] - here).abs());
                let seen = left::<f32, LEVEL>(here * rays.from[k]);
                let rough = change * (rays.to[k] - rays.from[k]) * seen > ROUGH;
                for c in 0..3 {
                    out[[3 * number + c, column]] = if rough { f32::NAN } else { light[c][k] };
                }
            }
        }
        for line in 3 * number..3 * number + 3 {
            for column in (1..last).step_by(2) {
                out[[line, column]] = 0.5 * (out[[line, column - 1]] + out[[line, column + 1]]);
            }
        }
    }
}

#[dispatch]
fn fill<const LEVEL: u8>(plane: &mut [f32], line: &[f32]) {
    for (four, three) in plane.as_chunks_mut::<COARSE>().0.iter_mut().zip(line.windows(3)) {
        *four = pixels::<LEVEL>(three);
    }
}

#[inline(always)]
fn lane(line: &[f32], at: usize) -> Lane {
    *line[at..].first_chunk().expect("lines have room for whole lanes")
}

type Lines<'a> = (&'a [Vec<f32>], &'a [Vec<f32>], &'a [f32], &'a [f32]);

/// The light of some pixels of a row from `at` on, red, green and blue, what goes through and the depth; of lines
/// of the slices' extinction and of the light that was found on the coarse grid, edges and places.
#[dispatch]
fn block<const LEVEL: u8>(
    lamps: &Lamps,
    gas: Lines<'_>,
    row: (&[f32], f32, &[f32]),
    at: usize,
) -> [Lane; 5] {
    let ((dense, glow, edges, places), (slopes, down, end)) = (gas, row);
    let ([mut red, mut green, mut blue, mut far], one) = ([[0.0; LANES]; 4], [1.0; LANES]);
    let mut rays = Rays { down, through: one, ..Rays::default() };
    for k in 0..LANES {
        let x = slopes[at + k];
        rays.slope[k] = x;
        rays.length[k] = (1.0 + x * x + down * down).sqrt();
    }
    let end = lane(end, at);
    for (number, place) in places.iter().enumerate() {
        let (from, to) = (edges[number], edges[number + 1]);
        rays.extinction = lane(&dense[number], at);
        let mut found = [0, 1, 2].map(|c| lane(&glow[3 * number + c], at));
        let mut exact = 0;
        for k in 0..LANES {
            rays.from[k] = from * rays.length[k];
            rays.to[k] = most(least(end[k], to), from) * rays.length[k];
            // Counted, since a reduction of floats or of booleans takes no vectors.
            exact += u32::from(end[k] < to) + u32::from(found[0][k].is_nan());
        }
        if exact > 0 && !lamps.lamps.is_empty() {
            found = near::<LEVEL>(lamps, &rays, 0.0);
        }
        for k in 0..LANES {
            let scale = rays.extinction[k] * rays.through[k];
            red[k] += found[0][k] * scale;
            green[k] += found[1][k] * scale;
            blue[k] += found[2][k] * scale;
            let thick = rays.extinction[k] * (rays.to[k] - rays.from[k]);
            let after = rays.through[k] * left::<f32, LEVEL>(thick);
            far[k] += place * (rays.through[k] - after);
            rays.through[k] = after;
        }
    }
    [red, green, blue, rays.through, far]
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
fn near<const LEVEL: u8>(lamps: &Lamps, rays: &Rays, step: f32) -> [Lane; 3] {
    let mut light = [[0.0; LANES]; 3];
    for lamp in &lamps.lamps {
        let found = match lamp.place {
            Some(place) => one::<LEVEL>(lamps, lamp, place, rays, step),
            None => sun::<LEVEL>(lamps, lamp.way, rays),
        };
        for (light, color) in light.iter_mut().zip(lamp.color) {
            for k in 0..LANES {
                light[k] += found[k] * color as f32;
            }
        }
    }
    light
}

/// The light of a sun, whose way through the gas is not known, in the same way.
#[inline(always)]
fn sun<const LEVEL: u8>(lamps: &Lamps, way: [f64; 3], rays: &Rays) -> Lane {
    let ([x, y, z], mut light) = (way.map(|part| part as f32), [0.0; LANES]);
    for k in 0..LANES {
        let cosine = -(x * rays.slope[k] + y * rays.down + z) / rays.length[k];
        let extinction = most(rays.extinction[k], 1e-12);
        let taken = 1.0 - left::<f32, LEVEL>(extinction * (rays.to[k] - rays.from[k]));
        light[k] = taken / extinction * lamps.phase(cosine);
    }
    light
}

/// The light of a lamp in a slice over its extinction and what reaches the eye; NaN where rays that are `step` apart
/// for a depth of 1 are too far apart for it.
#[inline(always)]
fn one<const LEVEL: u8>(
    lamps: &Lamps,
    lamp: &Lamp,
    place: [f64; 3],
    rays: &Rays,
    step: f32,
) -> Lane {
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
    let (mut from, mut to, mut light) = (rays.from, rays.to, [0.0; LANES]);
    for k in 0..LANES {
        // The nearest place of the slice to the lamp.
        let s = least(most(foot[k], from[k]), to[k]);
        let distance = (wide[k] * wide[k] + (s - foot[k]) * (s - foot[k])).sqrt();
        let steep = distance < STEEP * step * s || (spot && step > 0.0);
        light[k] = if steep { f32::NAN } else { 0.0 };
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
                let thick = rays.extinction[k] * (most(s - rays.from[k], 0.0) + distance);
                light[k] += part * left::<f32, LEVEL>(thick + air[0] * distance + air[1] * s);
            }
        }
    }
    light
}
