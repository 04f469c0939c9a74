//! Images of balls, integrated over pixels and along a way: tables by radius, made for an opacity when first seen.
//!
//! A table is of one radius in pixels. A large ball of a radius near it looks its places up in the scale of
//! the table's, which makes the pixel over which it is integrated wrong by 2 % at most; a small one is as
//! large as the table's and as much fainter or stronger. A ball smaller than [`LEAST`] is one of that radius;
//! beyond [`MOST`] a pixel is small beside it.

use std::convert::Infallible;
use std::sync::OnceLock;

use super::bins::{PIXELS, TILE};
use super::canvas::{Canvas, LANES, begin, multiply};
use super::profile::Profile;
use super::sprite::{REACH, Sprite};
use crate::base::ball::{mean_opacity, opacity_at};
use crate::base::error::{Error, collected};
use crate::base::pixel::pixels;
use crate::base::pool::kept;

/// The radii of the first and the last table, px, and tables from a radius to its double.
pub const LEAST: f64 = 0.2;
const MOST: f64 = 8.0;
const STEPS: f64 = 16.0;

/// A pixel's corner is so far from its middle, with a little more: a ball reaches so far beyond its radius.
const MARGIN: f64 = 0.75;

/// Entries of a table for each pixel across the way, where the nearest one is taken; along it there are half as
/// many. A small ball ends within less of a pixel.
fn entries(radius: f64) -> usize {
    if radius < 0.8 {
        64
    } else if radius < 2.5 {
        32
    } else {
        16
    }
}

/// Entries of a table and distances across, at most: an index is cut to them without a look at bounds. An entry
/// is read with its neighbour.
const ENTRIES: usize = 1 << 15;
type Entries = [f32; ENTRIES + 1];
const ACROSS: usize = 256;

/// A way in px below which two places of the resting ball stand for it; below the second, one.
const SHORT: f64 = 1.0;
const NONE: f64 = 0.03;

/// Below this radius the pixel's width counts more than the ball's.
const SMALL: f64 = 1.0;

/// A ball that is stronger than its table's may come out above 1; something passes any.
const OPAQUE: f32 = 1.0 - 1e-6;

/// Of a way the places that integrate a cubic exactly, from its middle, in its lengths.
const GAUSS: f64 = 0.288_675_134_594_812_9;

/// How a ball is drawn out: places along and across its way, in radii, at which it is looked up. A flake is no
/// disc long before its crystals can be told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outline {
    along: f32,
    across: f32,
    lean: f32,
    curve: f32,
}

impl Outline {
    pub const ROUND: Self = Self { along: 1.0, across: 1.0, lean: 0.0, curve: 0.0 };

    /// An ellipse of an aspect, turned by an angle from its way, bent, and wider than a disc of its light.
    pub fn of(aspect: f64, angle: f64, curve: f64, wide: f64) -> Self {
        let (even, odd) = (0.5 * (1.0 / aspect + aspect), 0.5 * (1.0 / aspect - aspect));
        let along = (even + odd * libm::cos(2.0 * angle)).sqrt();
        let lean = odd * libm::sin(2.0 * angle);
        let each = [along / wide, 1.0 / (along * wide), lean, curve];
        let [along, across, lean, curve] = each.map(|part| part as f32);
        Self { along, across, lean, curve }
    }

    /// Where a place is looked up; the middle of the light stays.
    #[inline(always)]
    pub fn at(&self, along: f32, across: f32) -> [f32; 2] {
        let v = self.across * across;
        [self.along * along + (self.lean + self.curve * v) * v - self.curve * MEAN_SQUARE, v]
    }

    /// How far it reaches along its way and across, in radii of the ball; a little more where it is bent.
    #[inline(always)]
    pub fn reach(&self) -> [f64; 2] {
        let ahead = (1.0 + self.lean * self.lean).sqrt() + 0.3 * self.curve.abs();
        [f64::from(ahead / self.along), f64::from(1.0 / self.across)]
    }
}

/// Of a ball's light the mean of the square of the distance across, in radii.
const MEAN_SQUARE: f32 = 0.235;

pub struct Balls {
    /// Opacity by the square of the distance from the middle, in radii: looked up, it costs a tenth.
    profile: Vec<f32>,
    mean: f64,
    tables: Vec<OnceLock<Table>>,
}

struct Table {
    radius: f64,
    /// The radius and the margin.
    reach: f64,
    along: f64,
    across: f64,
    /// By distance across the way and along it: the resting image.
    rest: Box<Entries>,
    /// Its integral along the way, from before the ball on, px.
    swept: Box<Entries>,
    /// All of it, by distance across.
    passed: [f32; ACROSS],
    /// Entries of a row, and rows.
    columns: usize,
    rows: usize,
}

impl Balls {
    /// The images of balls whose middle has the optical depth `tau0`.
    pub fn new(tau0: f64) -> Result<Self, Error> {
        let count = (STEPS * libm::log2(MOST / LEAST)).round() as usize + 1;
        let at = |i: i32| opacity_at(f64::from(i).sqrt() / 32.0, tau0) as f32;
        Ok(Self {
            profile: (0..=1024).map(at).collect(),
            mean: mean_opacity(tau0),
            tables: collected((0..count).map(|_| OnceLock::new()))?,
        })
    }

    /// The image of a ball of a radius and an amplitude as a sprite: where its way begins, the way, px, and its
    /// depth.
    pub fn sprite(
        start: [f64; 2],
        way: [f64; 2],
        radius: f64,
        amplitude: f64,
        depth: f64,
        outline: &Outline,
    ) -> Option<Sprite> {
        let (drawn, [ahead, aside]) = (radius.max(LEAST), outline.reach());
        let mut sprite = Sprite {
            start,
            along: [1.0, 0.0],
            length: 0.0,
            sigma: (drawn * ahead.max(aside) + MARGIN) / REACH,
            amplitude: amplitude * (radius / drawn) * (radius / drawn),
            depth,
        };
        sprite.sweep(way, (way[0] * way[0] + way[1] * way[1]).sqrt());
        sprite.within().then_some(sprite)
    }

    fn table(&self, radius: f64) -> &Table {
        // Most balls are those of the first table.
        let octaves = if radius < 1.02 * LEAST { 0.0 } else { libm::log2(radius / LEAST) };
        let step = ((STEPS * octaves).round() as usize).min(self.tables.len() - 1);
        let radius = || LEAST * libm::exp2(step as f64 / STEPS);
        let made = || Ok::<_, Infallible>(Table::new(radius(), self.mean, &self.profile));
        let Ok(table) = kept(&self.tables[step], made);
        table
    }
}

impl Table {
    fn new(radius: f64, mean: f64, profile: &[f32]) -> Self {
        let reach = radius + MARGIN;
        // Cells in which the ball's opacity is constant, at least twelve in a radius, and whole in a pixel.
        let fine = entries(radius);
        let side = 1.0 / fine as f64;
        let half = (radius * fine as f64).ceil() as usize;
        // One quarter of the ball; sums from its middle on, along both axes.
        let width = half + 1;
        let mut sums = vec![0.0_f64; width * width];
        for row in 0..half {
            let mut line = 0.0;
            for column in 0..half {
                let [x, y] = [column, row].map(|i| (i as f64 + 0.5) * side / radius);
                let at = (x * x + y * y) * 1024.0;
                let inside = at < 1024.0;
                let place = (at as usize).min(1023);
                let part = (at - place as f64) as f32;
                let value = profile[place] + part * (profile[place + 1] - profile[place]);
                line += if inside { f64::from(value) } else { 0.0 };
                sums[(row + 1) * width + column + 1] = sums[row * width + column + 1] + line;
            }
        }
        let whole = sums[width * width - 1] * 4.0 * side * side;
        // Of clear balls nothing is 0 / 0.
        let scale = if whole > 0.0 { mean / whole } else { 0.0 };
        let factor = scale * std::f64::consts::PI * radius * radius * side * side;
        // The integral over a rectangle from the middle on, the signs as those of its sides.
        let quarter = |x: i64, y: i64| {
            let [column, row] = [x, y].map(|v| (v.unsigned_abs() as usize).min(half));
            let sign = (x.signum() * y.signum()) as f64;
            sign * sums[row * width + column] * factor
        };
        let (each, along) = (fine as f64, 0.5 * fine as f64);
        let columns = (2.0 * reach * along).ceil() as usize + 2;
        let rows = (reach * each).ceil() as usize + 1;
        let entries = || Box::<Entries>::try_from(vec![0.0; ENTRIES + 1]).expect("as many");
        let (mut rest, mut swept, mut passed) = (entries(), entries(), [0.0; ACROSS]);
        let pixel = fine as i64 / 2;
        let middle = (reach * along).round() as i64;
        for row in 0..rows {
            let y = row as i64;
            let mut total = 0.0;
            let mut before = 0.0;
            for column in 0..columns {
                let x = (column as i64 - middle) * 2;
                let corner = |dx: i64, dy: i64| quarter(x + dx, y + dy);
                let value = corner(pixel, pixel) - corner(-pixel, pixel) - corner(pixel, -pixel)
                    + corner(-pixel, -pixel);
                total += 0.5 * (value + before) / along;
                before = value;
                rest[row * columns + column] = value as f32;
                swept[row * columns + column] = total as f32;
            }
            passed[row] = swept[(row + 1) * columns - 2] - swept[row * columns];
        }
        let reach = middle as f64 / along;
        Self { radius, reach, along, across: each, rest, swept, passed, columns, rows }
    }
}

/// Places of a row of pixels along and across a way, in the table's scale.
struct Row {
    along: [f32; LANES],
    across: [f32; LANES],
}

/// Linear along the way, the nearest across it; outside the table as at its border, where `values` are 0 or,
/// behind the ball, all of its integral.
#[inline(always)]
fn looked_up(table: &Table, values: &Entries, row: &Row, shift: f32) -> [f32; LANES] {
    /// Added to a whole number it leaves that in the low bits: a cast would look at what does not fit.
    const WHOLE: f32 = 8_388_608.0;
    let (mut places, mut parts, mut found) = ([0; LANES], [0.0; LANES], [0.0; LANES]);
    let (most, last) = ((table.columns - 2) as f32, (table.rows - 1) as f32);
    for k in 0..LANES {
        let along = (row.along[k] + shift).max(0.0).min(most);
        let across = (row.across[k].abs() + 0.5).min(last);
        places[k] = (across.floor() * table.columns as f32 + along.floor() + WHOLE).to_bits();
        parts[k] = along - along.floor();
    }
    // Apart from the places, which are vectors.
    for k in 0..LANES {
        let &[a, b] = values[places[k] as usize & (ENTRIES - 1)..].first_chunk().expect("a pair");
        found[k] = a + parts[k] * (b - a);
    }
    found
}

/// A ball drawn into one tile.
#[inline(always)]
pub fn ball<P: Profile, C: Canvas, const LEVEL: u8>(
    canvas: &mut C,
    map: Option<&[P; PIXELS]>,
    sprite: &Sprite,
    origin: [f64; 2],
    (balls, outline): (&Balls, &Outline),
) {
    let (low, high) = sprite.bounds();
    let Some(rows) = pixels(low[1] - origin[1], high[1] - origin[1], TILE) else { return };
    let wide = REACH * sprite.sigma;
    let [ahead, aside] = outline.reach();
    let radius = (wide - MARGIN) / ahead.max(aside);
    let [ahead, aside] = [ahead, aside].map(|reach| radius * reach + MARGIN);
    let table = balls.table(radius);
    // Of a small ball the pixel is most of the image: it keeps its width, and the amplitude makes up for the radius.
    let small = table.radius < SMALL;
    let scale = if small { 1.0 } else { table.radius / radius };
    let whole =
        if small { sprite.amplitude * (radius / table.radius).powi(2) } else { sprite.amplitude };
    let Outline { along: shrunk, across: thin, lean, curve } = *outline;
    let whole = whole * f64::from(shrunk * thin);
    let round = *outline == Outline::ROUND;
    let resting = sprite.length < if round { SHORT } else { NONE };
    let [ux, uy] = if resting { [1.0, 0.0] } else { sprite.along };
    let length = if resting { 0.0 } else { sprite.length };
    let middle = 0.5 * sprite.length;
    let [x, y]: [f64; 2] = std::array::from_fn(|axis| {
        sprite.start[axis] - origin[axis] + if resting { middle * sprite.along[axis] } else { 0.0 }
    });
    // Along the way in entries of the table, from its first one on.
    let step = scale * table.along * f64::from(shrunk);
    let across = scale * table.across * f64::from(thin);
    // What is added to that for a place across.
    let (unit, part) = (table.radius * table.along, (table.radius * table.across) as f32);
    let first = table.reach * table.along - unit * f64::from(curve * MEAN_SQUARE);
    let (lean, curve) = (unit as f32 * lean / part, unit as f32 * curve / (part * part));
    let depth = P::of(sprite.depth);
    let stretched = length * scale * f64::from(shrunk);
    let amplitude = if resting { whole } else { whole / stretched } as f32;
    for row in rows {
        let h = row as f64 + 0.5 - y;
        // Columns whose places lie beside the way, and between its ends.
        let (mut left, mut right) = (low[0] - origin[0], high[0] - origin[0]);
        if uy.abs() > 1e-6 {
            let (a, b) = ((h * ux - aside) / uy, (h * ux + aside) / uy);
            left = left.max(x + a.min(b));
            right = right.min(x + a.max(b));
        }
        if ux.abs() > 1e-6 {
            let (a, b) = ((-ahead - h * uy) / ux, (length + ahead - h * uy) / ux);
            left = left.max(x + a.min(b));
            right = right.min(x + a.max(b));
        }
        let Some(columns) = pixels(left, right, TILE) else { continue };
        let (start, blocks) = begin(columns.start, columns.len(), LANES);
        for block in 0..blocks {
            let column = start + block * LANES;
            let w = column as f64 + 0.5 - x;
            let (at, side) = ((w * ux + h * uy) * step + first, (h * ux - w * uy) * across);
            let (at, side) = (at as f32, side as f32);
            let (right, aside) = ((ux * step) as f32, (-uy * across) as f32);
            let mut places = Row { along: [0.0; LANES], across: [0.0; LANES] };
            for k in 0..LANES {
                places.across[k] = side + k as f32 * aside;
                let shift = (lean + curve * places.across[k]) * places.across[k];
                places.along[k] = at + k as f32 * right + shift;
            }
            let mut seen = [0.0_f32; LANES];
            let (one, end) = (places.along[0], places.along[LANES - 1]);
            let passed = one.min(end) >= (table.columns - 2) as f32;
            if !resting && round && passed && one.max(end) - (length * step) as f32 <= 0.0 {
                // Between the ends of a long way.
                for k in 0..LANES {
                    let line = (places.across[k].abs() + 0.5).min((table.rows - 1) as f32);
                    seen[k] = table.passed[line as usize & (ACROSS - 1)];
                }
            } else if !resting {
                let ahead = looked_up(table, &table.swept, &places, 0.0);
                let behind = looked_up(table, &table.swept, &places, (-length * step) as f32);
                for k in 0..LANES {
                    seen[k] = ahead[k] - behind[k];
                }
            } else if sprite.length < NONE {
                seen = looked_up(table, &table.rest, &places, 0.0);
            } else {
                let [dx, dy] = sprite.along.map(|part| GAUSS * sprite.length * part);
                for sign in [1.0, -1.0] {
                    let mut moved = Row { along: places.along, across: places.across };
                    for k in 0..LANES {
                        moved.along[k] += (sign * dx * step) as f32;
                        moved.across[k] += (sign * dy * across) as f32;
                    }
                    let part = looked_up(table, &table.rest, &moved, 0.0);
                    for k in 0..LANES {
                        seen[k] += 0.5 * part[k];
                    }
                }
            }
            let mut alpha = [0.0; LANES];
            for k in 0..LANES {
                alpha[k] = f64::from((seen[k] * amplitude).clamp(0.0, OPAQUE));
            }
            multiply::<P, C, LEVEL>(canvas, map, depth, row * TILE + column, (1.0, &alpha));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::ball::middle_depth;

    #[test]
    fn no_ball_is_more_than_opaque() {
        let balls = Balls::new(middle_depth(0.99).unwrap()).unwrap();
        for step in 0..200 {
            let radius = 0.2 * libm::exp2(f64::from(step) / 37.0);
            let round = &Outline::ROUND;
            let sprite = Balls::sprite([32.5, 32.5], [0.0, 0.0], radius, 1.0, 1.0, round).unwrap();
            let mut through = [1.0; PIXELS];
            ball::<f32, _, { crate::base::simd::PORTABLE }>(
                &mut through,
                None,
                &sprite,
                [0.0; 2],
                (&balls, round),
            );
            assert!(through.iter().all(|&through| through > 0.0), "{radius}");
        }
    }
}
