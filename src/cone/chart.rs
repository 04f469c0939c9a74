//! Azimuth and height of every pixel in tiles of the first layer, as fractions of 32 bits: all that
//! does not change while the camera and the axis stand still.
//!
//! The layers are copies of one another but for a whole factor, so one chart serves all: a product that
//! overflows is the fraction of a tile that is wanted. Rays are computed in float32 lanes, right to
//! 1e-3 of a texel; the footprint changes slowly and is kept for blocks of pixels.

use std::f64::consts::TAU;

use ndarray::ArrayViewMut3;

use super::basis::Vector;
use super::view::{FADE, FADE_SLOPE, View};
use crate::base::error::{Cancel, Error};
use crate::base::pixel::{dot, smoothstep};
use crate::base::pool;
use crate::base::simd::{dispatch, multiply_add};

/// Pixels to a side of a block, and lanes that are computed together.
pub const BLOCK: usize = 16;

/// A block that is shown in full.
pub const SHOWN: u8 = 0;
/// A block in which the fade has to be looked up.
pub const FADED: u8 = 1;
/// A block of which nothing is shown.
pub const HIDDEN: u8 = 2;

/// Above this height over the distance across, the fade begins: FADE_SLOPE t / (1 + FADE_SLOPE t) is
/// 0.6 at 7.5. A little less, for what float32 rounds.
const STEEP: f32 = 7.49;

/// arctan(t) / (2 pi t) in powers of t^2 on [0, 1], least squares at Chebyshev points: right to 1.2e-8.
const ARCTAN: [f32; 8] = [
    0.159_154_93,
    -0.053_049_46,
    0.031_782_027,
    -0.022_308_088,
    0.015_766_043,
    -0.009_448_567,
    0.003_846_168_6,
    -0.000_743_058_35,
];

/// The planes of a chart, or of some rows of it: rows of whole blocks of pixels, one after the other.
pub struct Chart<'a> {
    /// Azimuth, 2^32 to a tile.
    pub across: &'a mut [u32],
    /// Height, 2^32 to a tile.
    pub along: &'a mut [u32],
    /// How much is shown, written where the block is FADED.
    pub fade: &'a mut [f32],
    /// Of each block: SHOWN, FADED or HIDDEN.
    pub state: &'a mut [u8],
}

/// A row's rays: each part is `start + column * step`, in float32.
struct Row {
    start: [f32; 3],
    step: [f32; 3],
    eye: [f32; 3],
    rounds: usize,
    slope: f32,
    floor: f32,
    tiles: [f32; 2],
}

/// `2^32 * the fraction of x`: 23 bits of it, read off the digits of 1 + fraction. A conversion that
/// looks for overflow would not become a vector instruction.
#[inline(always)]
fn fraction(x: f32) -> u32 {
    // A fraction that rounds up to 1 gives 2, whose digits are 0 again.
    ((x - x.floor()) + 1.0).to_bits() << 9
}

const RUN: usize = 8 * BLOCK;

/// The rays of a run of pixels: the parts to the two sides, along the axis, and across it.
struct Lanes {
    p: [f32; RUN],
    q: [f32; RUN],
    s: [f32; RUN],
    c: [f32; RUN],
}

/// Rays of the pixels from `first` on; loops over lanes stay simple, so that they become vectors.
#[inline(always)]
fn cast<const LEVEL: u8>(lanes: &mut Lanes, row: &Row, first: usize, count: usize) {
    let (p, q) = (&mut lanes.p[..count], &mut lanes.q[..count]);
    let (s, c) = (&mut lanes.s[..count], &mut lanes.c[..count]);
    for k in 0..count {
        let column = (first + k) as i32 as f32 + 0.5;
        p[k] = multiply_add::<f32, LEVEL>(column, row.step[0], row.start[0]);
        q[k] = multiply_add::<f32, LEVEL>(column, row.step[1], row.start[1]);
        s[k] = multiply_add::<f32, LEVEL>(column, row.step[2], row.start[2]);
        c[k] = multiply_add::<f32, LEVEL>(p[k], p[k], q[k] * q[k]).sqrt();
    }
    for _ in 0..row.rounds {
        for k in 0..count {
            let column = (first + k) as i32 as f32 + 0.5;
            let reach = multiply_add::<f32, LEVEL>(row.slope, s[k].abs(), c[k]);
            let [x, y, z] = row.eye.map(|part| part * reach);
            p[k] = multiply_add::<f32, LEVEL>(column, row.step[0], row.start[0]) + x;
            q[k] = multiply_add::<f32, LEVEL>(column, row.step[1], row.start[1]) + y;
            s[k] = multiply_add::<f32, LEVEL>(column, row.step[2], row.start[2]) + z;
            c[k] = multiply_add::<f32, LEVEL>(p[k], p[k], q[k] * q[k]).sqrt();
        }
    }
}

#[dispatch]
fn chart_row<const LEVEL: u8>(
    across: &mut [u32],
    along: &mut [u32],
    fade: &mut [f32],
    state: &mut [u8],
    row: &Row,
) {
    let zeros = [0.0; RUN];
    let mut lanes = Lanes { p: zeros, q: zeros, s: zeros, c: zeros };
    let places = across.chunks_mut(RUN).zip(along.chunks_mut(RUN));
    let runs = places.zip(fade.chunks_mut(RUN).zip(state.chunks_mut(RUN / BLOCK)));
    for (index, ((across, along), (fade, state))) in runs.enumerate() {
        let count = across.len();
        cast::<LEVEL>(&mut lanes, row, index * RUN, count);
        let (p, q) = (&lanes.p[..count], &lanes.q[..count]);
        let (s, c) = (&lanes.s[..count], &lanes.c[..count]);
        for k in 0..count {
            let (wide, high) = (p[k].abs().max(q[k].abs()), p[k].abs().min(q[k].abs()));
            let t = high / wide.max(f32::MIN_POSITIVE);
            let square = t * t;
            let mut series = ARCTAN[7];
            for power in (0..7).rev() {
                series = multiply_add::<f32, LEVEL>(series, square, ARCTAN[power]);
            }
            let turn = t * series;
            let turn = if q[k].abs() > p[k].abs() { 0.25 - turn } else { turn };
            let turn = if p[k] < 0.0 { 0.5 - turn } else { turn };
            let turn = if q[k] < 0.0 { 1.0 - turn } else { turn };
            across[k] = fraction(turn * row.tiles[0]);
        }
        for k in 0..along.len().min(count) {
            let reach = multiply_add::<f32, LEVEL>(row.slope, s[k].abs(), c[k]).max(row.floor);
            along[k] = fraction(s[k] / reach * row.tiles[1]);
        }
        let mut steep = 0.0_f32;
        for k in 0..count {
            steep = steep.max(s[k].abs() - STEEP * c[k]);
        }
        if steep <= 0.0 {
            state.fill(SHOWN);
            continue;
        }
        let fade = &mut fade[..count];
        for k in 0..count {
            let bent = FADE_SLOPE as f32 * s[k].abs();
            let t = bent / (c[k] + bent).max(f32::MIN_POSITIVE) - FADE[0] as f32;
            fade[k] = 1.0 - smoothstep(t * (1.0 / (FADE[1] - FADE[0])) as f32);
        }
        for (fade, state) in fade.chunks(BLOCK).zip(state) {
            let ends = fade
                .iter()
                .fold((1.0_f32, 0.0_f32), |(low, high), &value| (low.min(value), high.max(value)));
            *state = match ends {
                (_, 0.0) => HIDDEN,
                (1.0, _) => SHOWN,
                _ => FADED,
            };
        }
    }
}

/// Rounds until an eye's place is accounted for to float32; see `View::ray`.
fn rounds(eye: Vector, slope: f64) -> usize {
    let shrinks = dot(eye, eye).sqrt() * (1.0 + slope);
    if shrinks == 0.0 {
        0
    } else {
        ((libm::log(1e-8) / libm::log(shrinks)).ceil() as usize).clamp(1, 24)
    }
}

/// What a chart is made from, besides the view.
#[derive(Debug, Clone, Copy)]
pub struct Course {
    /// Tiles of the first layer around.
    pub tiles: u32,
    /// How many times as long a drop is along.
    pub stretch: f64,
    /// The picture's row that is row 0: the first of a block.
    pub top: usize,
}

impl Course {
    fn along(&self) -> f64 {
        f64::from(self.tiles) / (TAU * self.stretch)
    }
}

/// Fills the footprints, (blocks down, blocks, 2): log2 of tiles across and along per pixel.
pub fn footprints(mut out: ArrayViewMut3<'_, f32>, view: &View, course: &Course) {
    let around = f64::from(course.tiles);
    let along = course.along();
    let middle = |block: usize| (block * BLOCK + BLOCK / 2) as f64;
    for (down, mut row) in out.outer_iter_mut().enumerate() {
        for (across, mut steps) in row.outer_iter_mut().enumerate() {
            let point = view.point(middle(across), course.top as f64 + middle(down));
            // Never below what a texture can be asked for, never infinite.
            steps[0] = (point.azimuth_step * around).clamp(1e-30, around).log2() as f32;
            steps[1] = (point.height_step * along).clamp(1e-30, 1e6).log2() as f32;
        }
    }
}

/// Fills a band that begins at a row of the picture.
pub fn band(band: Chart<'_>, view: &View, course: &Course, first: usize, blocks: usize) {
    let parts = [view.basis.first, view.basis.second, view.basis.axis];
    let width = blocks * BLOCK;
    let places = band.across.chunks_mut(width).zip(band.along.chunks_mut(width));
    let rows = places.zip(band.fade.chunks_mut(width).zip(band.state.chunks_mut(blocks)));
    for (index, ((across, along), (fades, states))) in rows.enumerate() {
        let y = (first + index) as f64 + 0.5 - view.center[1];
        let start = parts.map(|part| part[1] * y + part[2] * view.focal - part[0] * view.center[0]);
        let row = Row {
            start: start.map(|value| value as f32),
            step: parts.map(|part| part[0] as f32),
            eye: parts.map(|part| dot(part, view.eye) as f32),
            rounds: rounds(view.eye, view.slope),
            slope: view.slope as f32,
            floor: (1e-6 * view.focal) as f32,
            tiles: [f64::from(course.tiles) as f32, course.along() as f32],
        };
        chart_row(across, along, fades, states, &row);
    }
}

/// Fills a chart of so many blocks across, but for its footprints.
pub fn chart(
    chart: Chart<'_>,
    blocks: usize,
    view: &View,
    course: &Course,
    cancel: &Cancel,
) -> Result<(), Error> {
    let pixels = BLOCK * BLOCK * blocks;
    let across = chart.across.chunks_mut(pixels).zip(chart.along.chunks_mut(pixels));
    let rest = chart.fade.chunks_mut(pixels).zip(chart.state.chunks_mut(BLOCK * blocks));
    pool::for_each(across.zip(rest).enumerate(), |(index, ((across, along), (fade, state)))| {
        cancel.check()?;
        let planes = Chart { across, along, fade, state };
        band(planes, view, course, course.top + index * BLOCK, blocks);
        Ok(())
    })
}
