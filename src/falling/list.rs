//! The flakes of a frame: every one that its view may show, evaluated at the frame's times.
//!
//! Where a flake is at a time, seen by the eye of that time, is one function, [`Places`]. Its streak is that
//! function while the shutter is open, its motion the same at other frames; nothing is extrapolated.

use ndarray::{ArrayView2, ArrayViewMut2};

use super::air::{Air, CLOSE, Class, NOW, OPEN, Vector, denser};
use super::cells::{Born, Cells, side};
use super::law::{presence, ramp};
use super::sight::{Line, Sight, parts};
use crate::air;
use crate::base::error::{Cancel, Error, collected, pushed, reserve};
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::{PORTABLE, dispatch};

/// An aggregate reaches so many diameters from its middle, and a little more for what lies between texels.
const WIDEST: f64 = 1.8;

/// Cells of one item of work, some.
const RUN: u32 = 512;

/// A flake that may be seen.
#[derive(Debug, Clone, Copy)]
pub struct Flake {
    /// The same wherever it is seen, 53 bits.
    pub id: u64,
    /// In the camera's axes, metres.
    pub point: Vector,
    /// Where it is seen now, and when the shutter opens and closes, px.
    pub seen: [[f64; 2]; 3],
    /// The depths then, from the eye, metres.
    pub depths: [f64; 3],
    /// Metres.
    pub diameter: f64,
    /// How much of it is there, 0 to 1.
    pub share: f64,
}

/// Flakes, and where each is seen at the times that follow the exposure's, px.
#[derive(Default)]
pub struct List {
    /// In an order that depends on neither threads nor window.
    pub flakes: Vec<Flake>,
    /// Time after time for each flake; NaN where it is behind the eye.
    pub others: Vec<[f64; 2]>,
}

impl List {
    /// The flakes of all classes that may be seen in the window.
    pub fn of(air: &Air, cancel: &Cancel) -> Result<Self, Error> {
        let sights: Vec<Sight> = air.classes.iter().map(|class| Sight::of(air, class)).collect();
        let mut lines = Vec::new();
        for (number, sight) in sights.iter().enumerate() {
            sight.lines(air, number, &mut lines, cancel)?;
        }
        let runs = runs(&lines)?;
        let mut parts = collected(runs.iter().map(|_| Self::default()))?;
        let tasks = parts.iter_mut().zip(runs);
        pool::for_each(tasks, |(part, lines): (&mut Self, &[Line])| {
            cancel.check()?;
            part.add(air, &sights, lines, cancel)
        })?;
        let mut all = parts.into_iter();
        let mut first = all.next().unwrap_or_default();
        for part in all {
            reserve(&mut first.flakes, part.flakes.len())?;
            first.flakes.extend_from_slice(&part.flakes);
            reserve(&mut first.others, part.others.len())?;
            first.others.extend_from_slice(&part.others);
        }
        for class in &air.classes {
            if let Some(at) = class.placed {
                let born = Cells::new(air.seed, class.number).placed();
                first.blown(air, class, &[(Places::placed(air, class, at), born)], cancel)?;
            }
        }
        Ok(first)
    }

    /// What flakes say of themselves: motions to the two other times, their depth and identity. One that is behind
    /// the eye at one of them goes on as from the other.
    pub fn said(&self) -> Result<Vec<([f32; 5], i64)>, Error> {
        collected(self.flakes.iter().zip(self.others.as_chunks::<2>().0).map(|(flake, others)| {
            let moved = |other: [f64; 2]| [0, 1].map(|a| other[a] - flake.seen[NOW][a]);
            let [ahead, behind] = others.map(moved);
            let known = |way: [f64; 2], other: [f64; 2]| {
                [0, 1].map(|a| if way[a].is_nan() { -other[a] } else { way[a] })
            };
            let ways = [known(ahead, behind), known(behind, ahead)];
            let [[a, b], [c, d]] =
                ways.map(|way| way.map(|v| if v.is_nan() { 0.0 } else { v as f32 }));
            ([a, b, c, d, flake.depths[NOW] as f32], flake.id as i64)
        }))
    }

    /// Adds the flakes of some lines of cells, all of one class.
    fn add(
        &mut self,
        air: &Air,
        sights: &[Sight],
        lines: &[Line],
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let Some(first) = lines.first() else { return Ok(()) };
        let (class, sight) = (&air.classes[first.class], &sights[first.class]);
        let cells = Cells::new(air.seed, class.number);
        let mut found: Vec<(Places<'_>, Born)> = Vec::new();
        for line in lines {
            for step in 0..i64::from(line.count) {
                let mut cell = line.first;
                cell[line.axis] += step;
                let mut failed = Ok(());
                let places = Places::new(air, class, line.level, cell, line.part);
                cells.each(line.level, cell, sight.below, |born| {
                    let seen = || sight.sees(places.resting(NOW, &born), 0.0);
                    let out = !places.holds(&born) || (class.waves.is_empty() && !seen());
                    if failed.is_err() || out {
                        return;
                    }
                    failed = if class.waves.is_empty() && air.clumps.is_none() {
                        self.see(&places, &born, None, 1.0)
                    } else {
                        pushed(&mut found, (places, born))
                    };
                });
                failed?;
            }
        }
        self.blown(air, class, &found, cancel)
    }

    /// Adds flakes of a class, which waves of the wind carry and of which clumps have their share.
    fn blown(
        &mut self,
        air: &Air,
        class: &Class,
        found: &[(Places<'_>, Born)],
        cancel: &Cancel,
    ) -> Result<(), Error> {
        if found.is_empty() {
            return Ok(());
        }
        let mut points = collected(std::iter::repeat_n(0.0, 3 * found.len()))?;
        let at = |points: &mut [f64], of: &dyn Fn(&Places<'_>, &Born) -> Vector| {
            for (point, (places, born)) in points.chunks_exact_mut(3).zip(found) {
                point.copy_from_slice(&of(places, born));
            }
        };
        at(&mut points, &|places, born| places.in_air(NOW, born));
        let channels = if class.waves.is_empty() { 0 } else { 3 * air.eyes.len() };
        let blown = sums(&points, &air.waves, &class.waves, channels, cancel)?;
        let own = |index: usize| (channels > 0).then(|| &blown[channels * index..][..channels]);
        let Some(clumps) = &air.clumps else {
            for (index, (places, born)) in found.iter().enumerate() {
                self.see(places, born, own(index), 1.0)?;
            }
            return Ok(());
        };
        at(&mut points, &|places, born| places.resting(NOW, born));
        let sums = sums(&points, &clumps.waves, &clumps.weights, 1, cancel)?;
        for (index, ((places, born), s)) in found.iter().zip(sums).enumerate() {
            let denser = denser(clumps.strength, s);
            self.see(places, born, own(index), denser / (1.0 + clumps.strength))?;
        }
        Ok(())
    }

    /// Adds a flake, if any of it shows, and where it is at the other times. `part` of its like are there.
    #[inline]
    fn see(
        &mut self,
        places: &Places<'_>,
        born: &Born,
        blown: Option<&[f64]>,
        part: f64,
    ) -> Result<(), Error> {
        let Some(flake) = places.flake(born, blown, part) else { return Ok(()) };
        pushed(&mut self.flakes, flake)?;
        for time in CLOSE + 1..places.air.eyes.len() {
            let [swung, ..] = places.swung([time; 3], born);
            let (px, depth) = places.air.eyes[time].seen(places.point(time, born, swung, blown));
            pushed(&mut self.others, if depth > 0.0 { px } else { [f64::NAN; 2] })?;
        }
        Ok(())
    }
}

/// Lines cut into runs of one class with some cells each.
fn runs(lines: &[Line]) -> Result<Vec<&[Line]>, Error> {
    let mut runs = Vec::new();
    let (mut start, mut cells) = (0, 0);
    for (index, line) in lines.iter().enumerate() {
        cells += line.count;
        let last = index + 1 == lines.len();
        if last || cells >= RUN || lines[index + 1].class != line.class {
            pushed(&mut runs, &lines[start..=index])?;
            (start, cells) = (index + 1, 0);
        }
    }
    Ok(runs)
}

/// Sums of waves at points: so many numbers for each, all times' displacements by the wind or one of clumps.
pub fn sums(
    points: &[f64],
    waves: &[f64],
    weights: &[f64],
    channels: usize,
    cancel: &Cancel,
) -> Result<Vec<f64>, Error> {
    let (count, number) = (points.len() / 3, waves.len() / 3);
    let mut out = collected(std::iter::repeat_n(0.0, channels * count))?;
    if channels > 0 {
        let shape = |error: ndarray::ShapeError| Error::Internal(error.to_string());
        air::sum(
            ArrayViewMut2::from_shape((count, channels), &mut out).map_err(shape)?,
            ArrayView2::from_shape((count, 3), points).map_err(shape)?,
            ArrayView2::from_shape((number, 3), waves).map_err(shape)?,
            ArrayView2::from_shape((number, 2 * channels), weights).map_err(shape)?,
            cancel,
        )?;
    }
    Ok(out)
}

/// Sines of phases in cycles, a vector of them: the same bits at every level.
#[dispatch]
fn sines<const LEVEL: u8>(cycles: [f64; 8]) -> [f64; 8] {
    let mut found = [0.0; 8];
    for k in 0..8 {
        found[k] = f64::turn::<PORTABLE>(cycles[k] - cycles[k].round_ties_even()).im;
    }
    found
}

#[derive(Clone, Copy)]
struct Places<'a> {
    air: &'a Air,
    class: &'a Class,
    /// The cell's first corner relative to the camera in the air at the frame's time, metres.
    corner: Vector,
    side: f64,
    /// Which part of the cell along the house's z, and of how many.
    part: (u32, u32),
}

impl<'a> Places<'a> {
    fn new(air: &'a Air, class: &'a Class, level: i32, cell: [i64; 3], part: u32) -> Self {
        let side = side(level);
        let part = (part, parts(class, side));
        let corner = std::array::from_fn(|a| {
            // Whole cells apart from the camera's first: no bits are lost however far the air has moved.
            let base = (class.at[NOW][a] / side).floor();
            (cell[a] - base as i64) as f64 * side - (class.at[NOW][a] - base * side)
        });
        Self { air, class, corner, side, part }
    }

    /// The flake that is at a place in the air.
    fn placed(air: &'a Air, class: &'a Class, at: Vector) -> Self {
        let corner = std::array::from_fn(|a| at[a] - class.at[NOW][a]);
        Self { air, class, corner, side: 0.0, part: (0, 1) }
    }

    /// Whether a flake of the cell is in the part.
    #[inline]
    fn holds(&self, born: &Born) -> bool {
        let (part, parts) = self.part;
        parts == 1 || (born.inside[2] * f64::from(parts)) as u32 == part
    }

    /// Relative to the camera in the air of a time.
    #[inline]
    fn in_air(&self, time: usize, born: &Born) -> Vector {
        std::array::from_fn(|a| {
            self.corner[a] + born.inside[a] * self.side
                - (self.class.at[time][a] - self.class.at[NOW][a])
        })
    }

    /// The same, carried by a wind of depth: a part of a cell as a whole, by its middle.
    #[inline]
    fn resting(&self, time: usize, born: &Born) -> Vector {
        let mut place = self.in_air(time, born);
        if let Some(profile) = self.class.profile.get(time) {
            let moved = self.class.at[time][2] - self.class.at[NOW][2];
            let (part, parts) = self.part;
            let middle = (f64::from(part) + 0.5) / f64::from(parts);
            let middle = self.corner[2] + middle * self.side - moved;
            place[0] += profile[0].at(middle);
            place[1] += profile[1].at(middle);
        }
        place
    }

    /// The sway at times, in its amplitude, along the house's x and z.
    #[inline]
    fn swung(&self, times: [usize; 3], born: &Born) -> [[f64; 2]; 3] {
        let mut cycles = [0.0; 8];
        if self.air.sway.iter().any(|&sway| sway != 0.0) {
            for (time, cycles) in times.iter().zip(cycles.as_chunks_mut::<2>().0) {
                let angle = self.class.swung[*time];
                *cycles = born.phases.map(|phase| angle - angle.floor() + phase);
            }
            cycles = sines(cycles);
        }
        let [a, b, c, d, e, f, ..] = cycles;
        [[a, b], [c, d], [e, f]]
    }

    /// In the camera's axes at a time, with the sway and what the waves of the wind have done.
    #[inline]
    fn point(&self, time: usize, born: &Born, swung: [f64; 2], blown: Option<&[f64]>) -> Vector {
        let mut place = self.resting(time, born);
        place[0] += self.air.sway[time] * swung[0];
        place[2] += self.air.sway[time] * swung[1];
        if let Some(blown) = blown {
            for a in 0..3 {
                place[a] += blown[3 * time + a];
            }
        }
        if let Some(notes) = &self.air.notes {
            place = notes.passed(time, place);
        }
        self.air.eyes[time].turned(place)
    }

    /// The flake, if any of it shows.
    #[inline]
    fn flake(&self, born: &Born, blown: Option<&[f64]>, part: f64) -> Option<Flake> {
        let (air, class) = (self.air, self.class);
        let swung = self.swung([NOW, OPEN, CLOSE], born);
        let point = self.point(NOW, born, swung[NOW], blown);
        let eye = &air.eyes[NOW];
        let depth = point[2] - eye.offset[2];
        if depth < air.near {
            return None;
        }
        let [near, whole, from, far] = class.shown;
        let diameter = class.sizes.quantile(born.share);
        let nearer = if class.by_size { diameter / class.sizes.range.1 } else { 1.0 };
        let mut share =
            ramp(near * nearer, whole * nearer, point[2]) * (1.0 - ramp(from, far, point[2]));
        if share <= 0.0 {
            return None;
        }
        let below = self.corner[1] + born.inside[1] * self.side;
        let mut amount = part * class.amount.at(below);
        if let Some(notes) = &air.notes {
            amount *= notes.share(born.id, eye.seen(point).0, depth);
        }
        let rank = born.arrival / class.density;
        let (first, last) = class.ranks;
        share *= presence(rank, amount * last)
            - if first > 0.0 { presence(rank, amount * first) } else { 0.0 };
        if share <= 0.0 {
            return None;
        }
        let mut seen = [eye.seen(point).0; 3];
        let mut depths = [depth; 3];
        for time in [OPEN, CLOSE] {
            let there = self.point(time, born, swung[time], blown);
            let other = &air.eyes[time];
            let z = there[2] - other.offset[2];
            if z < air.near {
                // Through the plane before the eye: as far as that, and for so long.
                let part = ((depth - air.near) / (depth - z)).clamp(0.0, 1.0);
                share *= 0.5 + 0.5 * part;
                let there: Vector = std::array::from_fn(|a| {
                    let own = point[a] - eye.offset[a];
                    own + part * (there[a] - other.offset[a] - own) + other.offset[a]
                });
                seen[time] = other.seen([there[0], there[1], air.near + other.offset[2]]).0;
                depths[time] = air.near;
            } else {
                (seen[time], depths[time]) = other.seen(there);
            }
        }
        let reach = WIDEST * eye.focal[0] * diameter / depths.iter().copied().fold(depth, f64::min)
            + eye.focal[0] * air.room / depth
            + 2.0;
        let [top, bottom, left, right] = air.window.map(|v| v as f64);
        let within = |axis: usize, low: f64, high: f64| {
            let all = seen.map(|px| px[axis]);
            let least = all.iter().copied().fold(f64::INFINITY, f64::min);
            let most = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            most + reach >= low && least - reach <= high
        };
        (within(0, left, right) && within(1, top, bottom)).then_some(Flake {
            id: born.id,
            point,
            seen,
            depths,
            diameter,
            share,
        })
    }
}
