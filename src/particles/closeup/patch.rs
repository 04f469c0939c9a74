//! One flake's picture: its silhouette, moved during the exposure, through the opening of a lens.

use std::ops::Range;

use super::aperture::Blur;
use super::bank::{Bank, SHAPES};
use super::near::VARIANCE_OF_DISC;
use crate::base::random::Hash;
use crate::base::sampling::sampled;
use crate::particles::sprite::{Flake, Lens, RIM_SHARE, Sprite};

/// What a flake looks like from near.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// An aggregate of crystals.
    Aggregate,
    /// A drop of water.
    Drop,
    /// A round dot, out of focus.
    Dot,
}

/// How flakes tumble.
#[derive(Debug, Clone, Copy)]
pub struct Tumble {
    /// Of the random numbers.
    pub seed: i64,
    /// Seconds since frame 0.
    pub seconds: f64,
}

/// What is made of a flake.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    /// Its shape.
    pub kind: Kind,
    /// How much of it has that shape and a sharp disc; the rest is the image of a sprite.
    pub share: f64,
    /// The lens, if it has an opening.
    pub blur: Option<Blur>,
    /// How it tumbles.
    pub tumble: Tumble,
}

/// The picture of one flake's opacity.
pub struct Patch {
    /// What the flake is known by, the same in all frames.
    pub number: i64,
    /// Its place among the flakes of its source.
    pub index: i32,
    /// Pixels a texel is wide: 1, 2, 4, ...
    pub scale: usize,
    /// The first texel's first pixel, (x, y).
    pub origin: [i64; 2],
    /// Texels (across, down).
    pub size: [usize; 2],
    /// Row by row.
    pub alpha: Vec<f32>,
    /// World units.
    pub depth: f64,
    /// The flake, in camera axes.
    pub point: [f64; 3],
}

/// Texels along a side at most; what is larger has coarser ones.
const MOST: f64 = 384.0;

/// Texels that the circle of confusion is wide at most, before texels become coarser.
const FINE: f64 = 12.0;

/// A flake's greatest extent in diameters.
const REACH: f64 = 1.6;

/// A dot ends here, in sigma.
const DOT: f64 = 4.0;

/// Texels around a picture, for the least of dots and for what lies between texels.
const MARGIN: f64 = 4.0;

/// Turns per second around the vertical axis, at least and at most.
const TURNS: (f64, f64) = (0.1, 0.6);

/// The part that a drop lets through at a distance from its middle, in radii: twice through its
/// surface, by Fresnel's law at an index of 1.333.
fn through(share: f64) -> f64 {
    if share >= 1.0 {
        return 0.0;
    }
    let index = 1.333;
    let inside = share / index;
    let (a, b) = (libm::sqrt(1.0 - share * share), libm::sqrt(1.0 - inside * inside));
    let across = (a - index * b) / (a + index * b);
    let along = (index * a - b) / (index * a + b);
    let passed = 1.0 - 0.5 * (across * across + along * along);
    passed * passed
}

/// Height over width of a falling drop of a diameter in metres: Brandes, Zhang and Vivekanandan 2002
/// (J. Appl. Meteor. 41, 674), a fit to measurements in wind tunnels and of oscillating drops.
fn axis_ratio(diameter: f64) -> f64 {
    let d = (1e3 * diameter).clamp(0.5, 8.0);
    let ratio = 0.9951 + d * (0.0251 + d * (-0.03644 + d * (0.005_303 - d * 0.000_249_2)));
    ratio.clamp(0.4, 1.0)
}

impl Patch {
    /// The picture of a flake with the energy of its sprite, or None if nothing of it can be seen in a
    /// picture of `shape`.
    pub fn of(
        number: i64,
        flake: &Flake,
        lens: &Lens,
        look: &Look,
        shape: (usize, usize),
    ) -> Option<Self> {
        let blur = look.blur.as_ref();
        let sprite = Sprite::of(flake, lens)?;
        let variance = sprite.sigma * sprite.sigma;
        let energy =
            std::f64::consts::TAU * sprite.amplitude * variance / (1.0 + RIM_SHARE / variance);
        let sigma = lens.focal * flake.radius / (3.0 * sprite.depth);
        let diameter = sigma * 8.0_f64.sqrt();
        let circle = blur.map_or(0.0, |blur| blur.circle(sprite.depth));
        let way = sprite.along.map(|part| part * sprite.length);
        let middle: [f64; 2] = std::array::from_fn(|axis| sprite.start[axis] + 0.5 * way[axis]);
        let reach = REACH * diameter + circle;
        let extent = way.map(|part| 0.5 * part.abs() + reach);
        let longest = 2.0 * extent[0].max(extent[1]);
        let mut scale = 1_usize;
        while circle / scale as f64 > FINE
            || longest / scale as f64 > MOST
            || diameter / scale as f64 > 96.0
        {
            scale *= 2;
            if scale > 1 << 12 {
                return None;
            }
        }
        let side = scale as f64;
        let low: [f64; 2] =
            std::array::from_fn(|axis| ((middle[axis] - extent[axis]) / side - MARGIN).floor());
        let high: [f64; 2] =
            std::array::from_fn(|axis| ((middle[axis] + extent[axis]) / side + MARGIN).ceil());
        let limits = [shape.1 as f64 / side, shape.0 as f64 / side];
        if (0..2).any(|axis| high[axis] <= 0.0 || low[axis] >= limits[axis]) {
            return None;
        }
        let size = [0, 1].map(|axis| (high[axis] - low[axis]) as usize);
        let mut patch = Self {
            number,
            index: 0,
            scale,
            origin: low.map(|v| v as i64 * scale as i64),
            size,
            alpha: vec![0.0; size[0] * size[1]],
            depth: sprite.depth,
            point: flake.point,
        };
        let place: [f64; 2] = std::array::from_fn(|axis| middle[axis] / side - low[axis]);
        let way = way.map(|part| part / side);
        patch.fill(place, diameter / side, flake, look);
        patch.sweep(way);
        if let Some(blur) = blur.filter(|_| circle / side > 0.05) {
            patch.open(&blur.taps((circle / side).max(1.0)), circle / side);
        }
        let energy = (energy / (side * side)) as f32;
        let shaped = patch.sum();
        if look.share >= 1.0 {
            patch.scale_by(energy / shaped);
        } else {
            let share = look.share as f32;
            patch.scale_by(share * energy / shaped);
            let mut sprite = Self { alpha: vec![0.0; patch.alpha.len()], ..patch };
            let wide = sigma * sigma + circle * circle * VARIANCE_OF_DISC;
            sprite.dot(place, wide.sqrt() / side);
            sprite.sweep(way);
            sprite.scale_by((1.0 - share) * energy / sprite.sum());
            patch.alpha.iter_mut().zip(&sprite.alpha).for_each(|(a, b)| *a += b);
        }
        patch.alpha.iter_mut().for_each(|v| *v = if *v > 0.0 { v.min(1.0) } else { 0.0 });
        Some(patch)
    }

    fn sum(&self) -> f32 {
        self.alpha.iter().map(|&v| f64::from(v)).sum::<f64>() as f32
    }

    fn scale_by(&mut self, factor: f32) {
        self.alpha.iter_mut().for_each(|v| *v *= factor);
    }

    /// A Gaussian at rest; `sigma` in texels.
    fn dot(&mut self, place: [f64; 2], sigma: f64) {
        let [columns, rows] = self.size;
        let sigma = sampled(sigma * sigma).sqrt();
        let line = |count: usize, middle: f64| -> Vec<f32> {
            let value = |k: usize| {
                let away = (k as f64 + 0.5 - middle) / sigma;
                if away.abs() < DOT { libm::exp(-0.5 * away * away) as f32 } else { 0.0 }
            };
            (0..count).map(value).collect()
        };
        let (across, down) = (line(columns, place[0]), line(rows, place[1]));
        for (line, &weight) in self.alpha.chunks_exact_mut(columns).zip(&down) {
            line.iter_mut().zip(&across).for_each(|(out, &part)| *out = weight * part);
        }
    }

    /// The silhouette at rest; `diameter` in texels.
    fn fill(&mut self, place: [f64; 2], diameter: f64, flake: &Flake, look: &Look) {
        let Look { kind, tumble, .. } = look;
        let kind = *kind;
        if diameter < 2.5 || kind == Kind::Dot {
            return self.dot(place, diameter / 8.0_f64.sqrt());
        }
        let unit =
            |word: i64| Hash::seeded(tumble.seed).word(self.number).word(0x7475_6D62 + word).unit();
        let [columns, rows] = self.size;
        let own = 2.0 * flake.radius * (2.0_f64).sqrt() / 3.0;
        let (angle, ratio) = match kind {
            Kind::Aggregate => {
                let swing = 0.6
                    * libm::sin(
                        std::f64::consts::TAU * (unit(0) + (0.3 + unit(1)) * tumble.seconds),
                    );
                (std::f64::consts::TAU * unit(2) + swing, 1.0)
            }
            _ => (0.0, axis_ratio(own)),
        };
        let rate =
            (TURNS.0 + (TURNS.1 - TURNS.0) * unit(3)) * if unit(4) < 0.5 { -1.0 } else { 1.0 };
        let turns = unit(5) + rate * tumble.seconds;
        let shape = (unit(6) * SHAPES as f64) as usize;
        let view = Bank::get().look(shape, turns, 1.0 / diameter);
        let (sine, cosine) = (libm::sin(angle) as f32, libm::cos(angle) as f32);
        let inverse = (1.0 / diameter) as f32;
        let reach = (REACH * diameter) as f32;
        let (cx, cy) = (place[0] as f32 - 0.5, place[1] as f32 - 0.5);
        let last = |v: f32, count: usize| (v.ceil().max(0.0) as usize).min(count);
        let (top, bottom) = ((cy - reach).max(0.0) as usize, last(cy + reach + 1.0, rows));
        let (left, right) = ((cx - reach).max(0.0) as usize, last(cx + reach + 1.0, columns));
        // Axes of a drop of the same area, in diameters.
        let (wide, high) = ((0.5 / ratio.sqrt()) as f32, (0.5 * ratio.sqrt()) as f32);
        for row in top..bottom {
            let y = row as f32 - cy;
            for column in left..right {
                let x = column as f32 - cx;
                let value = if kind == Kind::Drop {
                    let (u, v) = (x * inverse / wide, y * inverse / high);
                    let share = (u * u + v * v).sqrt();
                    let edge = ((1.0 - share) * 0.5 * diameter as f32 + 0.5).clamp(0.0, 1.0);
                    edge * through(f64::from(share.min(0.97))) as f32
                } else {
                    let (u, v) = (x * inverse, y * inverse);
                    view.at(cosine * u + sine * v, cosine * v - sine * u)
                };
                self.alpha[row * columns + column] = value;
            }
        }
    }

    /// The mean over a way in texels, centred.
    fn sweep(&mut self, way: [f64; 2]) {
        let length = way[0].abs().max(way[1].abs());
        if length < 0.25 {
            return;
        }
        let count = length.ceil().max(2.0) as usize;
        let taps: Vec<(f64, f64)> = (0..count)
            .map(|k| {
                let share = (k as f64 + 0.5) / count as f64 - 0.5;
                (share * way[0], share * way[1])
            })
            .collect();
        self.gather(|add| {
            for &(x, y) in &taps {
                let (left, top) = (x.floor(), y.floor());
                let (a, b) = ((x - left) as f32, (y - top) as f32);
                let (left, top) = (left as isize, top as isize);
                add(left, top, (1.0 - a) * (1.0 - b));
                add(left + 1, top, a * (1.0 - b));
                add(left, top + 1, (1.0 - a) * b);
                add(left + 1, top + 1, a * b);
            }
        });
    }

    /// The opening's kernel; one narrower than a texel counts in part.
    fn open(&mut self, taps: &[(isize, isize, f32)], circle: f64) {
        let part = circle.min(1.0) as f32;
        self.gather(|add| {
            if part < 1.0 {
                add(0, 0, 1.0 - part);
            }
            for &(x, y, weight) in taps {
                add(x, y, part * weight);
            }
        });
    }

    /// Sums copies of the picture, each moved by whole texels and weighed.
    fn gather(&mut self, kernel: impl Fn(&mut dyn FnMut(isize, isize, f32))) {
        let [columns, rows] = self.size;
        let old = std::mem::replace(&mut self.alpha, vec![0.0; columns * rows]);
        // Rows and columns of the old picture that hold anything.
        let used = |row: usize| old[row * columns..][..columns].iter().any(|&v| v != 0.0);
        let Some(top) = (0..rows).find(|&row| used(row)) else { return };
        let bottom = (top..rows).rev().find(|&row| used(row)).unwrap_or(top) + 1;
        let full = |column: usize| (top..bottom).any(|row| old[row * columns + column] != 0.0);
        let left = (0..columns).find(|&column| full(column)).unwrap_or(0);
        let right = (left..columns).rev().find(|&column| full(column)).unwrap_or(left) + 1;
        let alpha = &mut self.alpha;
        let mut add = |x: isize, y: isize, weight: f32| {
            if weight == 0.0 {
                return;
            }
            // What would leave the picture stays at its border: the margin is wide enough.
            let x = x.clamp(-(left as isize), (columns - right) as isize);
            let y = y.clamp(-(top as isize), (rows - bottom) as isize);
            for row in top..bottom {
                let from = &old[row * columns + left..row * columns + right];
                let start = (row as isize + y) as usize * columns + (left as isize + x) as usize;
                let to = &mut alpha[start..start + from.len()];
                for (to, &from) in to.iter_mut().zip(from) {
                    *to += weight * from;
                }
            }
        };
        kernel(&mut add);
    }

    /// Pixels that it reaches: (first, one behind the last), clipped to a picture; x and y.
    pub fn bounds(&self, axis: usize, limit: usize) -> (usize, usize) {
        let scale = self.scale as i64;
        let first = self.origin[axis];
        let end = first + self.size[axis] as i64 * scale;
        (first.clamp(0, limit as i64) as usize, end.clamp(0, limit as i64) as usize)
    }

    /// The first column of a row of the frame that it reaches, and the opacities from there on.
    pub fn row<'a>(
        &self,
        y: usize,
        columns: Range<usize>,
        line: &'a mut Line,
    ) -> (usize, &'a [f32]) {
        let [across, down] = self.size;
        let (first, end) = self.bounds(0, usize::MAX >> 1);
        let (first, end) = (columns.start.max(first), columns.end.min(end));
        let offset = y as i64 - self.origin[1];
        if offset < 0 || offset >= (down * self.scale) as i64 || first >= end {
            return (columns.start, &[]);
        }
        let from = (first as i64 - self.origin[0]) as usize;
        if self.scale == 1 {
            line.pixels.clear();
            let texels = &self.alpha[offset as usize * across..][..across];
            line.pixels.extend_from_slice(&texels[from..from + end - first]);
            return (first, &line.pixels);
        }
        // Linear between the middles of texels, first down, then across.
        let side = self.scale as f32;
        let place = ((offset as f32 + 0.5) / side - 0.5).clamp(0.0, (down - 1) as f32);
        let row = place as usize;
        let upper = &self.alpha[row * across..][..across];
        let lower = &self.alpha[(row + 1).min(down - 1) * across..][..across];
        let part = place - row as f32;
        line.texels.clear();
        line.texels.push(0.0);
        line.texels.extend(upper.iter().zip(lower).map(|(a, b)| a + part * (b - a)));
        // Beyond the outermost it is as there.
        line.texels[0] = line.texels[1];
        line.texels.push(line.texels[across]);
        line.parts.clear();
        line.parts.extend((0..self.scale).map(|pixel| (pixel as f32 + 0.5) / side));
        // Pixels of a run lie between the same two texels.
        let (from, end) = (from + self.scale / 2, from + self.scale / 2 + end - first);
        let run = from / self.scale;
        line.pixels.clear();
        for pair in line.texels[run..].windows(2).take((end - 1) / self.scale + 1 - run) {
            let step = pair[1] - pair[0];
            line.pixels.extend(line.parts.iter().map(|part| pair[0] + part * step));
        }
        let skipped = from - run * self.scale;
        (first, &line.pixels[skipped..skipped + end - from])
    }
}

/// Room for a row of a patch.
#[derive(Default)]
pub struct Line {
    texels: Vec<f32>,
    parts: Vec<f32>,
    pixels: Vec<f32>,
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: Lens = Lens { focal: 800.0, center: [200.0; 2], offset: [0.0; 3], near: 0.1 };

    fn energy(patch: &Patch) -> f64 {
        let (mut sum, mut line) = (0.0, Line::default());
        for y in 0..400 {
            let row = patch.row(y, 0..400, &mut line).1;
            sum += row.iter().map(|&alpha| f64::from(alpha)).sum::<f64>();
        }
        sum
    }

    #[test]
    fn a_patch_has_its_sprite_s_energy() {
        let tumble = Tumble { seed: 5, seconds: 0.3 };
        for (radius, opacity) in [(0.004, 0.9), (0.012, 0.5), (0.03, 0.9)] {
            for travel in [[0.0; 3], [0.01, 0.02, 0.0], [0.002, -0.05, 0.001]] {
                for circle in [0.0, 3.0, 11.0, 47.0] {
                    let flake = Flake { point: [0.013, -0.02, 1.3], radius, opacity, travel };
                    let blur = Blur {
                        strength: circle / (1.0 - 1.0 / 1.3),
                        focus: 1.0,
                        blades: 6,
                        turn: 0.1,
                    };
                    for kind in [Kind::Aggregate, Kind::Drop, Kind::Dot] {
                        for share in [0.3, 1.0] {
                            let look = Look { kind, share, blur: Some(blur), tumble };
                            let patch = Patch::of(3, &flake, &LENS, &look, (400, 400));
                            let sigma = LENS.focal * radius / 3.9;
                            let wanted = std::f64::consts::TAU * opacity * sigma * sigma;
                            let found = energy(&patch.unwrap());
                            let case = (kind, circle, share, found, wanted);
                            assert!((found / wanted - 1.0).abs() < 5e-3, "{case:?}");
                        }
                    }
                }
            }
        }
    }
}
