//! Which cells of the air the view sees during an exposure: never a wrong no.
//!
//! The view is the pyramid of the window at the frame's time, up to the depth at which the class ends. It is
//! widened by all that may carry a flake into it meanwhile: the camera's way through the air, its turning and
//! zoom, the sway, the wind's waves, a flake's size and blur.

use super::air::{Air, CLOSE, Class, Eye, NOW, OPEN, Vector};
use super::cells::{levels, side};
use super::law::last_rank;
use super::notes::Notes;
use crate::base::error::{Error, pushed};

/// Pixels that the smallest image reaches beyond its middle, and a little more.
const LEAST_REACH: f64 = 4.0;

/// Flakes in the cells of one frame at most.
const MOST: f64 = 6e7;

#[derive(Debug, Clone, Copy)]
pub struct Line {
    /// Of the class in its air.
    pub class: usize,
    pub level: i32,
    /// The first cell.
    pub first: [i64; 3],
    pub axis: usize,
    pub count: u32,
    /// Of the parts of the cells along the house's z.
    pub part: u32,
}

/// Metres along the house's z that a wind of depth carries as a whole.
const THIN: f64 = 0.25;

/// Parts into which cells are cut along the house's z, each of which a wind of depth carries by itself.
pub fn parts(class: &Class, side: f64) -> u32 {
    if class.profile.is_empty() { 1 } else { (side / THIN).max(1.0) as u32 }
}

pub struct Sight {
    eye: Eye,
    /// Slopes of the four sides of the pyramid, across and down.
    low: [f64; 2],
    high: [f64; 2],
    /// How much a side's plane moves outwards for each metre of room.
    lean: [[f64; 2]; 2],
    /// Metres, for the size and the motion of flakes.
    pub room: f64,
    near: f64,
    far: f64,
    /// The density from which on none shows.
    pub below: f64,
}

impl Sight {
    pub fn of(air: &Air, class: &Class) -> Self {
        let eye = air.eyes[NOW];
        let [top, bottom, left, right] = air.window.map(|v| v as f64);
        let first = [left - LEAST_REACH, top - LEAST_REACH];
        let last = [right + LEAST_REACH, bottom + LEAST_REACH];
        let mut aside = 0.0_f64;
        let mut room = air.room + air.sway.abs() + 2.0 * class.sizes.range.1;
        for time in [OPEN, CLOSE] {
            let other = &air.eyes[time];
            for corner in [[first[0], first[1]], [last[0], first[1]], [first[0], last[1]], last] {
                aside = aside.max(shift(&eye, other, corner));
            }
            let moved: Vector = std::array::from_fn(|a| class.at[time][a] - class.at[NOW][a]);
            room += norm(moved) + norm(std::array::from_fn(|a| other.offset[a] - eye.offset[a]));
        }
        room += waves_reach(air, class) + air.notes.as_ref().map_or(0.0, Notes::reach);
        let slope = |axis: usize, px: f64| (px - eye.center[axis]) / eye.focal[axis];
        let low: [f64; 2] = std::array::from_fn(|axis| slope(axis, first[axis] - aside));
        let high: [f64; 2] = std::array::from_fn(|axis| slope(axis, last[axis] + aside));
        let lean = [low, high].map(|slopes| slopes.map(|slope| (1.0 + slope * slope).sqrt()));
        let most = class.amount.values.iter().copied().fold(0.0, f64::max) * class.ranks.1;
        Self {
            eye,
            low,
            high,
            lean,
            room,
            near: if class.by_size { 0.0 } else { class.shown[0] },
            far: class.shown[3],
            below: class.density * last_rank(most).min(1.0),
        }
    }

    /// Whether something at a place within `more` metres may be seen; the place is relative to the camera, house
    /// axes.
    #[inline]
    pub fn sees(&self, place: Vector, more: f64) -> bool {
        let [x, y, z] = self.eye.turned(place);
        let [x, y, z] = [x - self.eye.offset[0], y - self.eye.offset[1], z - self.eye.offset[2]];
        let room = self.room + more;
        let holds = |axis: usize, v: f64| {
            (v >= self.low[axis] * z - room * self.lean[0][axis])
                & (v <= self.high[axis] * z + room * self.lean[1][axis])
        };
        (z >= self.near - room) & (z <= self.far + room) & holds(0, x) & holds(1, y)
    }

    /// The eye and the far corners of the view, relative to the camera, house axes.
    fn corners(&self) -> [Vector; 5] {
        let back = |[x, y, z]: Vector| -> Vector {
            std::array::from_fn(|a| {
                let rows = &self.eye.turn;
                rows[0][a] * x + rows[1][a] * y + rows[2][a] * z
            })
        };
        let far = self.far;
        let at = |sx: f64, sy: f64, z: f64| {
            let o = self.eye.offset;
            back([sx * z + o[0], sy * z + o[1], z + o[2]])
        };
        let (low, high) = (self.low, self.high);
        [
            at(0.0, 0.0, 0.0),
            at(low[0], low[1], far),
            at(high[0], low[1], far),
            at(high[0], high[1], far),
            at(low[0], high[1], far),
        ]
    }

    /// The lines of cells of all levels that may be seen, in a fixed order.
    pub fn lines(&self, air: &Air, number: usize, lines: &mut Vec<Line>) -> Result<(), Error> {
        let class = &air.classes[number];
        if self.below <= 0.0 || self.far <= 0.0 || class.placed.is_some() {
            return Ok(());
        }
        // Layers of cells are cut across the axis that the view is most along; a wind of depth carries each
        // part of a layer along the house's z by itself.
        let ahead = self.eye.turn[2];
        let deep = if class.profile.is_empty() {
            (0..3).fold(0, |best, a| if ahead[a].abs() > ahead[best].abs() { a } else { best })
        } else {
            2
        };
        let (across, down) = ([1, 0, 0][deep], [2, 2, 1][deep]);
        let corners = self.corners();
        let mut flakes = 0.0;
        for level in levels(self.below) {
            let side = side(level);
            let parts = parts(class, side);
            let thick = side / f64::from(parts);
            let room = self.room + 1e-9 * side;
            let base = class.at[NOW].map(|v| (v / side).floor());
            let rest: Vector = std::array::from_fn(|a| class.at[NOW][a] - base[a] * side);
            // Cells from one relative place to another, along an axis.
            let cells = |a: usize, low: f64, high: f64| {
                ((low + rest[a]) / side).floor() as i64
                    ..((high + rest[a]) / side).floor() as i64 + 1
            };
            let [low, high] = bounds(&corners, deep, None);
            let layers = cells(deep, low[deep] - room, high[deep] + room);
            if (layers.end - layers.start) as f64 > MOST {
                return Err(too_many());
            }
            for (layer, part) in layers.flat_map(|layer| (0..parts).map(move |part| (layer, part)))
            {
                let from = layer as f64 * side + f64::from(part) * thick - rest[deep];
                let [low, high] = bounds(&corners, deep, Some((from - room, from + thick + room)));
                if low[across] > high[across] {
                    continue;
                }
                let middle = from + 0.5 * thick;
                // How far a wind of depth has carried the layer.
                let profile = class.profile.first();
                let carried: Vector =
                    profile.map_or([0.0; 3], |[x, y]| [x.at(middle), y.at(middle), 0.0]);
                let rows = cells(
                    down,
                    low[down] - room - carried[down],
                    high[down] + room - carried[down],
                );
                let columns = cells(
                    across,
                    low[across] - room - carried[across],
                    high[across] + room - carried[across],
                );
                // A layer has at most 8 flakes a cell.
                flakes += (rows.end - rows.start) as f64 * (columns.end - columns.start) as f64;
                if flakes > MOST {
                    return Err(too_many());
                }
                let reach = 0.5 * (2.0 * side * side + thick * thick).sqrt();
                for row in rows {
                    let mut line: Option<(i64, i64)> = None;
                    for column in columns.clone() {
                        let mut place = [0.0; 3];
                        for (a, cell) in [(down, row), (across, column)] {
                            place[a] = (cell as f64 + 0.5) * side - rest[a] + carried[a];
                        }
                        place[deep] = middle;
                        if self.sees(place, reach) {
                            line = Some((line.map_or(column, |(first, _)| first), column + 1));
                        }
                    }
                    let Some((first, end)) = line else { continue };
                    let mut cell = [0; 3];
                    for (a, own) in [(deep, layer), (down, row), (across, first)] {
                        cell[a] = base[a] as i64 + own;
                    }
                    let count = (end - first) as u32;
                    let line =
                        Line { class: number, level, first: cell, axis: across, count, part };
                    pushed(lines, line)?;
                }
            }
        }
        Ok(())
    }
}

/// How far the waves of the wind carry a flake of a class at most, metres.
fn waves_reach(air: &Air, class: &Class) -> f64 {
    let times = air.eyes.len();
    let all = |time: usize| -> f64 {
        let far = |wave: &[f64]| {
            let parts = (0..3).flat_map(|a| [wave[3 * time + a], wave[3 * (times + time) + a]]);
            parts.map(|v| v * v).sum::<f64>().sqrt()
        };
        class.waves.chunks_exact(6 * times).map(far).sum()
    };
    [NOW, OPEN, CLOSE].map(all).into_iter().fold(0.0, f64::max)
}

fn too_many() -> Error {
    let wanted = "take fewer, a shorter way during the exposure, or a smaller far";
    let message = format!("the view holds more than {MOST:.0e} cells of flakes; {wanted}");
    Error::invalid("density", message)
}

fn norm(v: Vector) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// How far a place at infinity moves in the picture from one time to another, px.
fn shift(now: &Eye, other: &Eye, px: [f64; 2]) -> f64 {
    let ray = [0, 1].map(|a| (px[a] - now.center[a]) / now.focal[a]);
    let world: Vector =
        std::array::from_fn(|a| now.turn[0][a] * ray[0] + now.turn[1][a] * ray[1] + now.turn[2][a]);
    let [x, y, z] = other.turned(world);
    if z < 0.1 {
        // Turned away within half an exposure: nearly all of what is before the camera.
        return 10.0 * now.focal[0];
    }
    let there = [x, y].map(|v| v / z);
    (0..2)
        .map(|a| (other.center[a] + other.focal[a] * there[a] - px[a]).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// The box around the part of the view between two places along an axis.
fn bounds(corners: &[Vector; 5], axis: usize, between: Option<(f64, f64)>) -> [Vector; 2] {
    let (from, to) = between.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let mut found = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    let edges = [(0, 1), (0, 2), (0, 3), (0, 4), (1, 2), (2, 3), (3, 4), (4, 1)];
    for (p, q) in edges.map(|(p, q)| (corners[p], corners[q])) {
        let way = q[axis] - p[axis];
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        if way == 0.0 {
            if p[axis] < from || p[axis] > to {
                continue;
            }
        } else {
            let (a, b) = ((from - p[axis]) / way, (to - p[axis]) / way);
            first = first.max(a.min(b));
            last = last.min(a.max(b));
        }
        if first > last {
            continue;
        }
        for share in [first, last] {
            for a in 0..3 {
                let at = p[a] + share * (q[a] - p[a]);
                found[0][a] = found[0][a].min(at);
                found[1][a] = found[1][a].max(at);
            }
        }
    }
    found
}
