//! Copies of a picture, each moved by whole texels and weighed, summed: what a way and an opening do to it.

use crate::base::simd::dispatch;

/// A copy: moved by (x, y) texels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tap {
    pub x: isize,
    pub y: isize,
    pub weight: f32,
}

/// A way in texels around its middle, over an exposure s of -1 to 1: s * half + (s^2 - 1) * bend.
#[derive(Debug, Clone, Copy)]
pub struct Way {
    pub half: [f64; 2],
    pub bend: [f64; 2],
}

/// The part of an exposure, -1 to 1, over which a shutter opens, and closes again.
const OPENS: f64 = 0.3;

impl Way {
    fn at(&self, s: f64) -> [f64; 2] {
        std::array::from_fn(|axis| s * self.half[axis] + (s * s - 1.0) * self.bend[axis])
    }

    /// How far it leads from its middle at most, along each axis.
    pub fn reach(&self) -> [f64; 2] {
        std::array::from_fn(|axis| self.half[axis].abs() + self.bend[axis].abs())
    }
}

/// The copies of a picture that moves along a way, as bright as `light` says of s: from the top down, summing to 1.
pub fn along(way: &Way, light: impl Fn(f64) -> f64) -> Vec<Tap> {
    let reach = way.reach();
    let count = (2.0 * reach[0].max(reach[1])).ceil().max(2.0) as usize;
    let reach = reach.map(|part| part.ceil() as isize + 1);
    let columns = 2 * reach[0] as usize + 2;
    let mut weights = vec![0.0_f32; columns * (2 * reach[1] as usize + 2)];
    let mut sum = 0.0;
    for k in 0..count {
        let s = (2 * k + 1) as f64 / count as f64 - 1.0;
        let share = ((1.0 - s.abs()) / OPENS).min(1.0) * light(s);
        sum += share;
        let [x, y] = way.at(s);
        let (a, b) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
        let (left, top) = (x.floor() as isize + reach[0], y.floor() as isize + reach[1]);
        let (at, share) = (top as usize * columns + left as usize, share as f32);
        weights[at] += share * (1.0 - a) * (1.0 - b);
        weights[at + 1] += share * a * (1.0 - b);
        weights[at + columns] += share * (1.0 - a) * b;
        weights[at + columns + 1] += share * a * b;
    }
    let met = weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
    met.map(|(at, &weight)| {
        let (x, y) = ((at % columns) as isize - reach[0], (at / columns) as isize - reach[1]);
        Tap { x, y, weight: weight / sum as f32 }
    })
    .collect()
}

/// The rows and columns of a picture that hold anything: (top, bottom, left, right).
fn used(picture: &[f32], columns: usize) -> Option<[usize; 4]> {
    // Of each column what any of its bits are.
    let (mut rows, mut any) = (None, vec![0; columns]);
    for (row, line) in picture.chunks_exact(columns).enumerate() {
        let mut all = 0;
        for (any, v) in any.iter_mut().zip(line) {
            (*any, all) = (*any | v.to_bits(), all | v.to_bits());
        }
        if all != 0 {
            rows = Some((rows.map_or(row, |(top, _)| top), row + 1));
        }
    }
    let left = any.iter().position(|&bits| bits != 0)?;
    let right = any.iter().rposition(|&bits| bits != 0)? + 1;
    rows.map(|(top, bottom)| [top, bottom, left, right])
}

/// The sum of a picture's copies in a part of it, or where they reach and a texel around that, and the part: its top,
/// bottom, left, right; None of an empty picture. What leaves the part is lost. `taps` go from the top down.
pub fn spread(
    picture: &[f32],
    columns: usize,
    taps: &[Tap],
    part: Option<[isize; 4]>,
) -> Option<(Vec<f32>, [isize; 4])> {
    let xs = taps.iter().map(|tap| tap.x);
    let (least, most) = (xs.clone().min()?, xs.max()?);
    let [top, bottom, left, right] = used(picture, columns)?;
    let around = [
        top as isize + taps.first()?.y - 1,
        bottom as isize + taps.last()?.y + 1,
        left as isize + least - 1,
        right as isize + most + 1,
    ];
    let part @ [up, down, near, end] = part.unwrap_or(around);
    let mut out = vec![0.0; ((down - up) * (end - near)) as usize];
    // What is used, with room for the copies' blocks on both sides.
    let side = (most - least) as usize;
    let blocks = (right - left + side).div_ceil(LANES);
    let stride = side + blocks * LANES;
    let mut source = vec![0.0; stride * (bottom - top)];
    for (to, row) in source.chunks_exact_mut(stride).zip(top..bottom) {
        let from = &picture[row * columns + left..row * columns + right];
        to[side..side + from.len()].copy_from_slice(from);
    }
    // The first column that a copy reaches.
    let first = left as isize + least - near;
    let to = |tap: &Tap| most - tap.x - tap.y * stride as isize;
    let step = |tap: &Tap| Step { down: tap.y, to: to(tap), weight: tap.weight };
    let steps: Vec<Step> = taps.iter().map(step).collect();
    let rows = [top as isize - up, bottom as isize - up];
    sum(&mut out, (end - near) as usize, (&source, stride), rows, (first, blocks), &steps);
    Some((out, part))
}

/// Columns that are summed at a time.
const LANES: usize = 16;

/// A copy's place in the source: `to` is how far its first block is from the source's row of the same number
/// as the outcome's.
struct Step {
    down: isize,
    to: isize,
    weight: f32,
}

/// Sums copies of a source of `stride` texels a row, which are `rows` of the outcome. `first` is the first column of the
/// outcome that is not empty, `blocks` how many blocks are not, and `steps` go from the top down.
#[dispatch]
fn sum<const LEVEL: u8>(
    out: &mut [f32],
    columns: usize,
    source: (&[f32], usize),
    rows: [isize; 2],
    line: (isize, usize),
    steps: &[Step],
) {
    let ((source, stride), [top, bottom], (first, blocks)) = (source, rows, line);
    for (y, line) in out.chunks_exact_mut(columns).enumerate() {
        let y = y as isize;
        let start = steps.partition_point(|step| y - step.down >= bottom);
        let end = steps.partition_point(|step| y - step.down >= top);
        let (pairs, last) = steps[start..end].as_chunks::<2>();
        for block in 0..blocks {
            let from = (y - top) * stride as isize + (block * LANES) as isize;
            let add = |sum: &mut [f32; LANES], step: &Step| {
                let from = &source[(from + step.to) as usize..][..LANES];
                for k in 0..LANES {
                    sum[k] += step.weight * from[k];
                }
            };
            // Two sums, which do not wait for each other.
            let (mut even, mut odd) = ([0.0; LANES], [0.0; LANES]);
            for [one, other] in pairs {
                add(&mut even, one);
                add(&mut odd, other);
            }
            last.iter().for_each(|step| add(&mut even, step));
            for k in 0..LANES {
                even[k] += odd[k];
            }
            let column = first + (block * LANES) as isize;
            let skipped = (-column).clamp(0, LANES as isize) as usize;
            let at = (column + skipped as isize) as usize;
            let end = line.len().min(at + LANES - skipped);
            let Some(to) = line.get_mut(at..end) else { break };
            match <&mut [f32; LANES]>::try_from(&mut *to) {
                Ok(whole) => *whole = even,
                Err(_) => to.copy_from_slice(&even[skipped..][..to.len()]),
            }
        }
    }
}
