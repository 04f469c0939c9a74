//! A flake that moves during the exposure, drawn into one tile.
//!
//! Its footprint is tilted, so its pixels are computed one by one, in blocks of two rows: most streaks
//! are a few pixels wide, and a block of one row would be filled by a third. A block that lies between
//! the two ends, where nothing changes along the way, does without error functions.

use super::bins::{PIXELS, TILE};
use super::canvas::{Canvas, LANES, begin, multiply};
use super::profile::{self, Profile, TERMS};
use super::sprite::{REACH, Sprite};
use crate::base::normal::{least, most};
use crate::base::pixel::pixels;

/// Rows of a block, and its pixels: a register of float32.
const ROWS: usize = 2;
const BLOCK: usize = ROWS * LANES;

/// What the loop over a block's pixels computes along the way.
///
/// The series of a short segment.
const SHORT: u8 = 0;
/// Both error functions.
const LONG: u8 = 1;
/// Neither, since both ends are far.
const MIDDLE: u8 = 2;

/// A number that is linear in the pixel's place: at a block's first pixel, and what each lane adds.
#[derive(Clone, Copy)]
struct Linear<P> {
    right: f64,
    down: f64,
    steps: [P; BLOCK],
}

impl<P: Profile> Linear<P> {
    #[inline(always)]
    fn new(right: f64, down: f64) -> Self {
        let mut steps = [P::zero(); BLOCK];
        let (x, y) = (P::of(right), P::of(down));
        for k in 0..BLOCK {
            steps[k] = P::of((k % LANES) as f64) * x + P::of((k / LANES) as f64) * y;
        }
        Self { right, down, steps }
    }

    #[inline(always)]
    fn at(&self, [x, y]: [f64; 2]) -> f64 {
        x * self.right + y * self.down
    }
}

/// What is the same for all pixels of a streak, lengths in sigma.
struct Sweep<P> {
    along: Linear<P>,
    across: Linear<P>,
    amplitude: P,
    half: P,
    series: [P; TERMS],
    /// The two numbers of a pixel by which the footprint ends, and how far from 0 its rims begin: across
    /// and along, or those of the pixel axes.
    ends: [Linear<P>; 2],
    room: P,
}

/// The columns of a row between two parallel slanted lines: from `low` to `high`, plus `slope` per row.
struct Strip {
    slope: f64,
    low: f64,
    high: f64,
}

impl Strip {
    const ALL: Self = Self { slope: 0.0, low: f64::NEG_INFINITY, high: f64::INFINITY };

    /// Where |`right` x + `down` y - `middle`| <= `reach` in one of a block's rows, of which y is the
    /// first.
    #[inline(always)]
    fn new(right: f64, down: f64, middle: f64, reach: f64) -> Self {
        if right.abs() < 1e-9 {
            return Self::ALL;
        }
        let by = 1.0 / right;
        let (slope, middle, half) = (-down * by, middle * by, reach * by.abs());
        let last = slope * (ROWS - 1) as f64;
        Self { slope, low: middle - half + last.min(0.0), high: middle + half + last.max(0.0) }
    }
}

#[inline(always)]
pub fn streak<P: Profile, C: Canvas, const LEVEL: u8>(
    canvas: &mut C,
    map: Option<&[P; PIXELS]>,
    sprite: &Sprite,
    origin: [f64; 2],
) {
    let (low, high) = sprite.bounds();
    let Some(rows) = pixels(low[1] - origin[1], high[1] - origin[1], TILE) else { return };
    let [ux, uy] = sprite.along;
    let inverse = 1.0 / sprite.sigma;
    let length = sprite.length * inverse;
    let short = length < P::SHORT;
    let square = sprite.square();
    // From the middle of the way.
    let half_way = 0.5 * sprite.length;
    let x = sprite.start[0] + half_way * ux - origin[0];
    let y = sprite.start[1] + half_way * uy - origin[1];
    let along = Linear::new(ux * inverse, uy * inverse);
    let across = Linear::new(-uy * inverse, ux * inverse);
    let mut sweep = Sweep {
        along,
        across,
        amplitude: P::of(sprite.amplitude),
        half: P::of(0.5 * length),
        series: [P::zero(); TERMS],
        ends: [across, along],
        room: P::of(0.5 * length),
    };
    if short {
        let series = profile::series(length);
        for k in 0..TERMS {
            sweep.series[k] = P::of(series[k]);
        }
    } else {
        let scale = 0.5 * std::f64::consts::TAU.sqrt() / length;
        sweep.amplitude = P::of(sprite.amplitude * scale);
    }
    let strips = if square {
        let [wide_x, wide_y] = profile::widening([length * ux, length * uy]);
        sweep.ends = [Linear::new(inverse / wide_x, 0.0), Linear::new(0.0, inverse / wide_y)];
        sweep.room = P::zero();
        [
            Strip { slope: 0.0, low: low[0] - origin[0] - x, high: high[0] - origin[0] - x },
            Strip::ALL,
        ]
    } else {
        let reach = REACH * sprite.sigma;
        [Strip::new(uy, -ux, 0.0, reach), Strip::new(ux, uy, 0.0, half_way + reach)]
    };
    // The way from a block's first pixel to its farthest ones.
    let (right, down) = (along.right * (LANES - 1) as f64, along.down * (ROWS - 1) as f64);
    let (least, most) = (right.min(0.0) + down.min(0.0), right.max(0.0) + down.max(0.0));
    let middle = 0.5 * length - P::SATURATED;
    let depth = P::of(sprite.depth);
    let (top, blocks) = begin(rows.start, rows.len(), ROWS);
    let spans = spans(&strips, [x, y], top, blocks);
    for (i, &[left, right]) in spans[..blocks].iter().enumerate() {
        if left >= right {
            continue;
        }
        let row = top + i * ROWS;
        let h = row as f64 + 0.5 - y;
        let (left, blocks) = begin(left as usize, (right - left) as usize, LANES);
        for column in (left..left + blocks * LANES).step_by(LANES) {
            let place = [column as f64 + 0.5 - x, h];
            let way = along.at(place);
            let alpha = if short {
                if square {
                    block::<P, SHORT, true, LEVEL>(&sweep, place)
                } else {
                    block::<P, SHORT, false, LEVEL>(&sweep, place)
                }
            } else if square {
                block::<P, LONG, true, LEVEL>(&sweep, place)
            } else if way + least >= -middle && way + most <= middle {
                block::<P, MIDDLE, false, LEVEL>(&sweep, place)
            } else {
                block::<P, LONG, false, LEVEL>(&sweep, place)
            };
            for (i, alpha) in alpha.chunks_exact(LANES).enumerate() {
                let (mut wide, at) = ([0.0; LANES], (row + i) * TILE + column);
                for k in 0..LANES {
                    wide[k] = alpha[k].wide();
                }
                multiply::<P, C, LEVEL>(canvas, map, depth, at, (1.0, &wide));
            }
        }
    }
}

/// The first pixel of each of `count` rows of blocks from the row `top` on, and the one behind the last:
/// found for all before the first is drawn, since a block that waited for its columns would leave the
/// processor idle.
#[inline(always)]
fn spans(
    [first, second]: &[Strip; 2],
    [x, y]: [f64; 2],
    top: usize,
    count: usize,
) -> [[u32; 2]; TILE / ROWS] {
    /// Added, it leaves the nearest whole number in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let limit = TILE as f64;
    let mut spans = [[0; 2]; TILE / ROWS];
    for (chunk, spans) in spans.chunks_exact_mut(LANES).enumerate().take(count.div_ceil(LANES)) {
        let spans: &mut [[u32; 2]; LANES] = spans.try_into().expect("whole chunks");
        let start = (top + chunk * LANES * ROWS) as f64 + 0.5 - y;
        for i in 0..LANES {
            let h = start + (i * ROWS) as f64;
            let left = most(first.low + h * first.slope, second.low + h * second.slope);
            let right = least(first.high + h * first.slope, second.high + h * second.slope);
            // A pixel's centre on the border or not: it sees nothing there.
            let left = least(most(x + left, 0.0), limit) + ROUND;
            let right = least(most(x + right, 0.0), limit) + ROUND;
            spans[i] = [left.to_bits() as u32, right.to_bits() as u32];
        }
    }
    spans
}

/// The alphas of a block whose first pixel's centre is at `place` from the middle of the way.
#[inline(always)]
fn block<P: Profile, const KIND: u8, const SQUARE: bool, const LEVEL: u8>(
    sweep: &Sweep<P>,
    place: [f64; 2],
) -> [P; BLOCK] {
    let Sweep { along, across, ends, .. } = sweep;
    let (p, q) = (P::of(along.at(place)), P::of(across.at(place)));
    let [a, b] = [P::of(ends[0].at(place)), P::of(ends[1].at(place))];
    let mut alpha = [P::zero(); BLOCK];
    for k in 0..BLOCK {
        let (p, q) = (p + along.steps[k], q + across.steps[k]);
        let shape = match KIND {
            SHORT => profile::swept_short::<P, LEVEL>(p, q, sweep.half, sweep.series),
            LONG => {
                profile::bare::<P, LEVEL>(q)
                    * profile::swept::<P, LEVEL>(sweep.half + p, sweep.half - p)
            }
            _ => profile::bare::<P, LEVEL>(q) * P::of(2.0),
        };
        let (a, b) = if SQUARE { (a + ends[0].steps[k], b + ends[1].steps[k]) } else { (q, p) };
        let rim = profile::rim::<P, LEVEL>(a.abs());
        let rim =
            if KIND == MIDDLE { rim } else { rim * profile::rim::<P, LEVEL>(b.abs() - sweep.room) };
        alpha[k] = sweep.amplitude * shape * rim;
    }
    alpha
}
