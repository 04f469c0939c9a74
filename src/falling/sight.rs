//! Which cells of the air the view sees during an exposure: never a wrong no.
//!
//! The view is the pyramid of the window at the frame's time, up to the depth at which the class ends. It is
//! widened by all that may carry a flake into it meanwhile: the camera's way through the air, its turning and
//! zoom, the sway, a flake's size and blur. Where the waves of the wind have carried a flake is known but for how far
//! they carry the middle of its cell apart from it: long waves, which carry far, carry a cell as a whole.

use super::air::{Air, CLOSE, Class, Eye, NOW, OPEN, Vector};
use super::cells::{levels, mean, side};
use super::law::last_rank;
use super::list::sums;
use super::notes::Notes;
use crate::base::error::{Cancel, Error, pushed, reserve};

/// Pixels that the smallest image reaches beyond its middle, and a little more.
const LEAST_REACH: f64 = 4.0;

/// Flakes around the view of one frame at most: of those that it sees, a third or fewer, some 7 GB.
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
    /// Displacements by the waves of the wind now, real parts (x, y, z) and imaginary ones, metres.
    waves: Vec<[f64; 6]>,
}

impl Sight {
    pub fn of(air: &Air, class: &Class) -> Self {
        let eye = air.eyes[NOW];
        let [top, bottom, left, right] = air.window.map(|v| v as f64);
        let first = [left - LEAST_REACH, top - LEAST_REACH];
        let last = [right + LEAST_REACH, bottom + LEAST_REACH];
        let mut aside = 0.0_f64;
        let sway = air.sway.iter().fold(0.0_f64, |most, sway| most.max(sway.abs()));
        let mut room = air.room + sway + 2.0 * class.sizes.range.1;
        let times = air.eyes.len();
        let waves = class.waves.chunks_exact(6 * times);
        let blown = |wave: &[f64], time: usize| -> [f64; 6] {
            std::array::from_fn(|n| wave[3 * (n / 3 * times + time) + n % 3])
        };
        for time in [OPEN, CLOSE] {
            let other = &air.eyes[time];
            for corner in [[first[0], first[1]], [last[0], first[1]], [first[0], last[1]], last] {
                aside = aside.max(shift(&eye, other, corner));
            }
            let moved: Vector = std::array::from_fn(|a| class.at[time][a] - class.at[NOW][a]);
            let beside: Vector = std::array::from_fn(|a| other.offset[a] - eye.offset[a]);
            let carried = waves.clone().map(|wave| {
                let (now, then) = (blown(wave, NOW), blown(wave, time));
                norm(&std::array::from_fn::<_, 6, _>(|n| then[n] - now[n]))
            });
            room += norm(&moved) + norm(&beside) + carried.sum::<f64>();
        }
        room += air.notes.as_ref().map_or(0.0, Notes::reach);
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
            waves: waves.map(|wave| blown(wave, NOW)).collect(),
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

    /// The box around the view, relative to the camera, house axes.
    fn around(&self) -> [Vector; 2] {
        let mut found = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let rows = &self.eye.turn;
        let slopes = [0, 1].map(|axis| [self.low[axis], self.high[axis]]);
        for corner in 0..8 {
            let z = if corner < 4 { 0.0 } else { self.far };
            let sides = [z * slopes[0][corner % 2], z * slopes[1][corner / 2 % 2], z];
            for a in 0..3 {
                let at = (0..3).map(|b| rows[b][a] * (sides[b] + self.eye.offset[b])).sum::<f64>();
                found[0][a] = found[0][a].min(at);
                found[1][a] = found[1][a].max(at);
            }
        }
        found
    }

    /// How far waves carry places apart at most that are up to so many metres apart.
    fn apart(&self, air: &Air, reach: f64) -> f64 {
        let part = |(wave, k): (&[f64; 6], &[f64])| {
            2.0 * norm(wave) * libm::sin(std::f64::consts::PI * (norm(k) * reach).min(0.5))
        };
        self.waves.iter().zip(air.waves.chunks_exact(3)).map(part).sum()
    }

    /// The lines of cells of all levels that may be seen, in a fixed order.
    pub fn lines(
        &self,
        air: &Air,
        number: usize,
        lines: &mut Vec<Line>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
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
        let [low, high] = self.around();
        let most: f64 = self.waves.iter().map(|wave| norm(wave)).sum();
        let channels = if self.waves.is_empty() { 0 } else { 3 };
        let (mut points, mut flakes) = (Vec::new(), 0.0);
        // The cells of the level before that are seen are among these: what is in no other is seen in none.
        let mut within = [(i64::MIN / 4, i64::MAX / 4); 3];
        for level in levels(self.below) {
            let side = side(level);
            let parts = parts(class, side);
            let thick = side / f64::from(parts);
            let room = self.room + most + 1e-9 * side;
            let reach = 0.5 * (2.0 * side * side + thick * thick).sqrt();
            let reach = reach + self.apart(air, reach);
            let mut seen = [(i64::MAX, i64::MIN); 3];
            let base = class.at[NOW].map(|v| (v / side).floor());
            let rest: Vector = std::array::from_fn(|a| class.at[NOW][a] - base[a] * side);
            // Cells from one relative place to another, along an axis.
            let cells = |a: usize, low: f64, high: f64| {
                let [low, high] = [low, high].map(|v| ((v + rest[a]) / side).floor() as i64);
                let (first, end) = within[a];
                low.max(2 * first - base[a] as i64)..(high + 1).min(2 * end - base[a] as i64)
            };
            let all = [deep, down, across].map(|a| cells(a, low[a] - room, high[a] + room));
            let lengths = all.each_ref().map(|cells| (cells.end - cells.start).max(0) as f64);
            // Too many are refused before any is looked at.
            flakes += lengths.iter().product::<f64>() * mean(level, self.below);
            if flakes > MOST {
                let wanted = "take fewer, a shorter way during the exposure, or a smaller far";
                let message =
                    format!("the air around the view holds more than {MOST:.0e} flakes; {wanted}");
                return Err(Error::invalid("density", message));
            }
            let [layers, ..] = all;
            for (layer, part) in layers.flat_map(|layer| (0..parts).map(move |part| (layer, part)))
            {
                let from = layer as f64 * side + f64::from(part) * thick - rest[deep];
                let middle = from + 0.5 * thick;
                // How far a wind of depth has carried the layer.
                let profile = class.profile.first();
                let carried: Vector =
                    profile.map_or([0.0; 3], |[x, y]| [x.at(middle), y.at(middle), 0.0]);
                let [rows, columns] = [down, across]
                    .map(|a| cells(a, low[a] - room - carried[a], high[a] + room - carried[a]));
                if rows.is_empty() || columns.is_empty() {
                    continue;
                }
                let place = |row: i64, column: i64| {
                    let mut place = [middle; 3];
                    for (a, cell) in [(down, row), (across, column)] {
                        place[a] = (cell as f64 + 0.5) * side - rest[a];
                    }
                    place
                };
                points.clear();
                for row in rows.clone().filter(|_| channels > 0) {
                    reserve(&mut points, 3 * columns.clone().count())?;
                    points.extend(columns.clone().flat_map(|column| place(row, column)));
                }
                let blown = sums(&points, &air.waves, self.waves.as_flattened(), channels, cancel)?;
                let blown = blown.as_chunks::<3>().0;
                let wide = columns.end - columns.start;
                let sees = |row: i64, column: i64| {
                    let at = (row - rows.start) * wide + column - columns.start;
                    let (place, moved) = (place(row, column), blown.get(at as usize));
                    let moved = moved.unwrap_or(&[0.0; 3]);
                    self.sees(std::array::from_fn(|a| place[a] + carried[a] + moved[a]), reach)
                };
                for row in rows.clone() {
                    let mut inside = columns.clone().filter(|&column| sees(row, column));
                    let Some(first) = inside.next() else { continue };
                    let end = inside.next_back().unwrap_or(first) + 1;
                    let mut cell = [0; 3];
                    for (a, own, end) in
                        [(deep, layer, layer + 1), (down, row, row + 1), (across, first, end)]
                    {
                        cell[a] = base[a] as i64 + own;
                        seen[a].0 = seen[a].0.min(cell[a]);
                        seen[a].1 = seen[a].1.max(base[a] as i64 + end);
                    }
                    let count = (end - first) as u32;
                    let line =
                        Line { class: number, level, first: cell, axis: across, count, part };
                    pushed(lines, line)?;
                }
            }
            if class.profile.is_empty() {
                if seen[deep].0 > seen[deep].1 {
                    break;
                }
                within = seen;
            }
        }
        Ok(())
    }
}

fn norm(v: &[f64]) -> f64 {
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
    norm(&[0, 1].map(|a| other.center[a] + other.focal[a] * there[a] - px[a]))
}
