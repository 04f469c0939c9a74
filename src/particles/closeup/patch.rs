//! One flake's picture: its silhouette, moved during the exposure, through the opening of a lens.

use std::ops::Range;

use super::aperture::VARIANCE_OF_DISC;
use super::shape::{DOT, Kind, Look, Near, Place, ball, silhouette};
use super::spread::{Way, along, spread};
use crate::base::simd::dispatch;

/// The picture of one flake's opacity.
pub struct Patch {
    /// Its place among the flakes of its source.
    pub index: i32,
    /// Pixels a texel is wide: 1, 2, 4, ...
    pub scale: usize,
    /// The first texel's first pixel, (x, y).
    pub origin: [i64; 2],
    /// Texels (across, down).
    pub size: [usize; 2],
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

/// An aggregate's greatest extent in diameters.
const REACH: f64 = 1.6;

/// Texels around a picture, for soft borders and for what lies between texels.
const MARGIN: f64 = 2.0;

/// Makes the sum of a picture `energy`.
#[dispatch]
fn normalize<const LEVEL: u8>(alpha: &mut [f32], energy: f64) {
    // Sixteen sums, which do not wait for each other.
    let mut sums = [0.0_f64; 16];
    for run in alpha.chunks(16) {
        sums.iter_mut().zip(run).for_each(|(sum, &v)| *sum += f64::from(v));
    }
    let factor = (energy / sums.iter().sum::<f64>()) as f32;
    alpha.iter_mut().for_each(|v| *v *= factor);
}

impl Patch {
    /// The picture of a flake, or None if nothing of it can be seen in a picture of `shape`.
    pub fn of(flake: &Near, look: &Look<'_>, shape: (usize, usize)) -> Option<Self> {
        let blur = look.closeup.blur.as_ref();
        let &Near { number, energy, diameter, depth, seen: [now, first, last], .. } = flake;
        let sigma = diameter / 8.0_f64.sqrt();
        let circle = blur.map_or(0.0, |blur| blur.circle(depth));
        let middle: [f64; 2] = std::array::from_fn(|axis| 0.5 * (first[axis] + last[axis]));
        let half = std::array::from_fn(|axis| 0.5 * (last[axis] - first[axis]));
        let bend = std::array::from_fn(|axis| middle[axis] - now[axis]);
        let way = Way { half, bend };
        let opening = blur.map_or(0.0, |blur| 0.5 * blur.corner() * circle);
        let wide = (sigma * sigma + circle * circle * VARIANCE_OF_DISC).sqrt();
        let shaped = if look.kind == Kind::Dot { DOT * sigma } else { REACH * diameter };
        let reach = (shaped + opening).max(DOT * wide);
        let extent = way.reach().map(|part| part + reach);
        let longest = 2.0 * extent[0].max(extent[1]);
        let mut scale = 1_usize;
        while circle / scale as f64 > FINE
            || longest / scale as f64 > MOST
            || diameter / scale as f64 > 40.0
        {
            scale *= 2;
            if scale > 1 << 12 {
                return None;
            }
        }
        let side = scale as f64;
        let out = |axis: usize, length: usize| {
            let room = extent[axis] + (MARGIN + 1.0) * side;
            middle[axis] + room <= 0.0 || middle[axis] - room >= length as f64
        };
        if out(0, shape.1) || out(1, shape.0) {
            return None;
        }
        let low = middle.map(|at| ((at - reach) / side - MARGIN).floor());
        let high = middle.map(|at| ((at + reach) / side + MARGIN).ceil());
        let place = Place {
            size: [0, 1].map(|axis| (high[axis] - low[axis]) as usize),
            middle: std::array::from_fn(|axis| middle[axis] / side - low[axis]),
        };
        let (columns, rows) = (place.size[0], place.size[1]);
        let energy = energy / (side * side);
        let mut alpha = silhouette(&place, diameter / side, flake, look);
        if let Some(blur) = blur.filter(|_| circle / side > 0.05) {
            let whole = [0, rows as isize, 0, columns as isize];
            alpha = spread(&alpha, columns, &blur.taps(circle / side), Some(whole))?.0;
        }
        normalize(&mut alpha, look.share * energy);
        if look.share < 1.0 {
            let mut sprite = ball(&place, wide / side * 8.0_f64.sqrt(), flake, look);
            normalize(&mut sprite, (1.0 - look.share) * energy);
            alpha.iter_mut().zip(&sprite).for_each(|(a, b)| *a += b);
        }
        let way = Way { half: half.map(|v| v / side), bend: bend.map(|v| v / side) };
        let flutter = look.closeup.tumble.flutter(number, flake.own, look.kind == Kind::Aggregate);
        let (mut alpha, part) = spread(&alpha, columns, &along(&way, flutter), None)?;
        alpha.iter_mut().for_each(|v| *v = if *v > 0.0 { v.min(1.0) } else { 0.0 });
        let [top, bottom, left, right] = part;
        let origin = [low[0] as i64 + left as i64, low[1] as i64 + top as i64];
        Some(Self {
            index: flake.index,
            scale,
            origin: origin.map(|v| v * scale as i64),
            size: [right - left, bottom - top].map(|v| v as usize),
            alpha,
            depth,
            point: flake.point,
        })
    }

    /// Pixels of an axis that it reaches, from 0 on: the first, and one behind the last.
    pub fn bounds(&self, axis: usize) -> (usize, usize) {
        let first = self.origin[axis];
        let end = first + (self.size[axis] * self.scale) as i64;
        (first.max(0) as usize, end.max(0) as usize)
    }

    /// The first column of a row of the frame that it reaches, and the opacities from there on.
    pub fn row<'a>(
        &'a self,
        y: usize,
        columns: Range<usize>,
        line: &'a mut Line,
    ) -> (usize, &'a [f32]) {
        let [across, down] = self.size;
        let (first, end) = self.bounds(0);
        let (first, end) = (columns.start.max(first), columns.end.min(end));
        let offset = y as i64 - self.origin[1];
        if offset < 0 || offset >= (down * self.scale) as i64 || first >= end {
            return (columns.start, &[]);
        }
        let from = (first as i64 - self.origin[0]) as usize;
        if self.scale == 1 {
            let texels = &self.alpha[offset as usize * across..][..across];
            return (first, &texels[from..from + end - first]);
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

#[derive(Default)]
pub struct Line {
    texels: Vec<f32>,
    parts: Vec<f32>,
    pixels: Vec<f32>,
}
