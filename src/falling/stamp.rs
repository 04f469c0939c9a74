//! What a flake of a sheet adds to pixels: its optical depth, in whole steps.
//!
//! A pixel's opacity `a` is a ball's ([`crate::base::ball`]), averaged over the pixel, the disc of defocus and
//! the way that the flake goes during the exposure. What is added is -ln(1 - a): the sum over flakes is
//! then the optical depth of the same flakes drawn one by one.
//!
//! Flakes lie in the middles of quarter pixels. With the eighth of a pixel as the cell, a pixel is whole
//! cells seen from any of them, and its mean over a ball at rest is exact. Under a wide disc of defocus cells are quarters.

use crate::base::ball::{mean_opacity, opacity_at};
use crate::base::error::{Error, collected, pushed, reserve, zeroed};

/// What a sheet shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Law {
    pub seed: u64,
    pub period: (usize, usize),
    /// Columns to the right at which a flake that leaves the torus below comes in again above: one that falls
    /// straight down meets its own place no more.
    pub shear: usize,
    /// Flakes for each pixel, on average and of all ranks.
    pub count: f64,
    /// Diameters in pixels, small ones first: of n the k-th stands for (2 (n - k) - 1) / n^2 of the flakes.
    pub diameters: Vec<f32>,
    /// Pixels, x and y, by which a flake moves during the exposure, half before and half after.
    pub streak: [f64; 2],
    /// Diameter in pixels of the disc of defocus; 0 is sharp.
    pub circle: f64,
    /// Optical depth in the middle of a resting flake.
    pub tau0: f64,
    /// The part of a flake that a pixel shows where what is read is blurred afterwards; 1 where it is not.
    pub thin: f64,
    /// Only flakes with a rank from the first up to the second, of 0 to 1, are shown.
    pub ranks: (f64, f64),
}

impl Law {
    /// Cells in a quarter of a pixel.
    fn fine(&self) -> i64 {
        if self.circle < WIDE { 2 } else { 1 }
    }

    pub fn check(&self) -> Result<(), Error> {
        let ((rows, cols), (low, high)) = (self.period, self.ranks);
        let sound = [rows, cols].iter().all(|side| (1..=1 << 20).contains(side))
            && self.shear < cols
            && (1..=16).contains(&self.diameters.len())
            && self.diameters.iter().all(|diameter| (1e-6..=32.0).contains(diameter))
            && self.streak.iter().all(|way| way.abs() <= 256.0)
            && (0.0..=1000.0).contains(&self.count)
            && (0.0..=32.0).contains(&self.circle)
            && (0.0..=20.0).contains(&self.tau0)
            && (1e-3..=1.0).contains(&self.thin)
            && 0.0 <= low
            && low <= high
            && high <= 1.0;
        if sound { Ok(()) } else { Err(Error::Internal(format!("no sheet of {self:?}"))) }
    }

    /// Flakes that are shown for each pixel, on average.
    pub fn shown(&self) -> f64 {
        self.count * (self.ranks.1 - self.ranks.0)
    }
}

/// Pixels that are added to at once.
pub const WIDTH: usize = 8;

/// Stamps are added up in parts of a byte's step: long streaks leave less than a step in a pixel.
const FINE: f64 = 256.0;

/// Discs of defocus from this width on are wide, px.
const WIDE: f64 = 8.0;

/// Discs that spread over pixels from middles of quarter pixels as flakes of 0, 0.1, .. 1 px do from
/// anywhere: the mean over places of the sum of the squares of a flake's shares is the same. Without it
/// flakes of 0.25 px, which no edge of a pixel would cut, have a deviation 7 % too large.
const SPREAD: [f64; 11] =
    [0.262, 0.296, 0.330, 0.366, 0.410, 0.468, 0.552, 0.694, 0.829, 0.909, 0.992];

/// The diameter of the disc that stands for a flake.
pub fn spread(diameter: f64) -> f64 {
    let place = 10.0 * diameter;
    if place >= 10.0 {
        return diameter;
    }
    let (index, rest) = (place as usize, place - libm::floor(place));
    SPREAD[index] + rest * (SPREAD[index + 1] - SPREAD[index])
}

/// Rows of numbers without the zeros at their ends.
struct Rows {
    /// The first row, and where the farthest to the left may begin.
    start: [i64; 2],
    /// Where each begins, and its numbers.
    spans: Vec<(i64, std::ops::Range<usize>)>,
    values: Vec<f32>,
}

impl Rows {
    fn new(start: [i64; 2], dense: &[f32], cols: usize) -> Result<Self, Error> {
        let mut rows = Self { start, spans: Vec::new(), values: Vec::new() };
        reserve(&mut rows.spans, dense.len() / cols)?;
        reserve(&mut rows.values, dense.iter().filter(|&&value| value != 0.0).count())?;
        for row in dense.chunks(cols) {
            let first = row.iter().position(|&value| value != 0.0).unwrap_or(0);
            let last = row.iter().rposition(|&value| value != 0.0).map_or(first, |last| last + 1);
            let from = rows.values.len();
            reserve(&mut rows.values, last - first)?;
            rows.values.extend_from_slice(&row[first..last]);
            rows.spans.push((first as i64 + start[1], from..rows.values.len()));
        }
        Ok(rows)
    }

    fn row(&self, row: i64) -> (i64, &[f32]) {
        let span = usize::try_from(row - self.start[0]).ok().and_then(|row| self.spans.get(row));
        span.map_or((0, &[]), |(first, span)| (*first, &self.values[span.clone()]))
    }
}

/// The share of the exposure and of the disc of defocus for which a point of the flake lies within a
/// pixel, by the cells that it is away from the pixel's middle; the columns of each cell in a quarter apart.
fn weights(law: &Law) -> Result<Vec<Rows>, Error> {
    let (fine, cells) = (law.fine(), 4.0 * law.fine() as f64);
    // Cells that a pixel's edges cut count in part: as if they moved by a cell.
    let least = if fine == 1 { 1.0 / cells } else { 0.0 };
    let streak = law.streak.map(|way| if way.abs() < least { least } else { way });
    let radius = 0.5 * cells * law.circle;
    let reach =
        |length: f64| libm::ceil(0.5 * cells * (1.0 + length.abs() + law.circle)) as i64 + 2;
    // Even, so that halves of it hold columns of both kinds.
    let half = streak.map(reach).map(|half| half + (half & 1));
    let side = 2 * half[0] as usize;
    let mut sharp = zeroed::<f32>(side * 2 * half[1] as usize)?;
    let middle = |at: usize, half| (at as f64 + 0.5 * (fine - 1) as f64 - half as f64) / cells;
    for (row, out) in sharp.chunks_mut(side).enumerate() {
        let y = within(middle(row, half[1]), streak[1]);
        for (col, out) in out.iter_mut().enumerate().filter(|_| y.1 > y.0) {
            let x = within(middle(col, half[0]), streak[0]);
            *out = (x.1.min(y.1) - x.0.max(y.0)).max(0.0) as f32;
        }
    }
    if radius > 0.0 {
        sharp = defocused(&sharp, side, radius)?;
    }
    let apart = |first: usize| {
        let dense: Vec<f32> = sharp.iter().skip(first).step_by(fine as usize).copied().collect();
        // Columns count in quarters.
        Rows::new([-half[1], -half[0] / fine], &dense, side / fine as usize)
    };
    (0..fine as usize).map(apart).collect()
}

/// The times at which a coordinate lies within the pixel.
fn within(at: f64, way: f64) -> (f64, f64) {
    if way == 0.0 {
        return if at.abs() < 0.5 { (-0.5, 0.5) } else { (0.0, 0.0) };
    }
    let (a, b) = ((at - 0.5) / way, (at + 0.5) / way);
    (a.min(b).max(-0.5), a.max(b).min(0.5))
}

/// The mean over a disc, row of the disc by row, from running sums.
fn defocused(sharp: &[f32], side: usize, radius: f64) -> Result<Vec<f32>, Error> {
    let reach = libm::ceil(radius + 0.5) as i64;
    let chord = |row: i64| {
        let half = |part: i64| {
            let y = row as f64 + (part as f64 + 0.5) / 8.0 - 0.5;
            libm::sqrt((radius * radius - y * y).max(0.0))
        };
        (0..8).map(half).sum::<f64>() / 8.0
    };
    let chords: Vec<f64> = (-reach..=reach).map(chord).collect();
    let share = 1.0 / (2.0 * chords.iter().sum::<f64>());
    let (tall, mut out) = (sharp.len() / side, zeroed::<f32>(sharp.len())?);
    let mut sums = zeroed::<f64>(side + 1)?;
    for (row, line) in sharp.chunks(side).enumerate() {
        for (col, &value) in line.iter().enumerate() {
            sums[col + 1] = sums[col] + f64::from(value);
        }
        if sums[side] == 0.0 {
            continue;
        }
        let upto = |at: f64| {
            let at = at.clamp(0.0, side as f64);
            let (whole, rest) = (at as usize, at - libm::floor(at));
            sums[whole] + rest * (sums[(whole + 1).min(side)] - sums[whole])
        };
        for (&chord, to) in chords.iter().zip(row as i64 - reach..) {
            if chord == 0.0 || !(0..tall as i64).contains(&to) {
                continue;
            }
            let out = &mut out[to as usize * side..][..side];
            for (col, out) in out.iter_mut().enumerate() {
                let at = col as f64 + 0.5;
                *out += (share * (upto(at + chord) - upto(at - chord))) as f32;
            }
        }
    }
    Ok(out)
}

/// The opacity by the sine of the angle under which light meets the ball.
struct Profile([f32; 257], f64);

impl Profile {
    fn new(tau0: f64) -> Self {
        let radii = |i: usize| libm::sqrt(1.0 - (i as f64 / 256.0).powi(2));
        Self(std::array::from_fn(|i| opacity_at(radii(i), tau0) as f32), tau0)
    }

    /// Opacity times area in each cell, rows after rows, and half of their number.
    fn cells(&self, diameter: f64, fine: i64) -> Result<(Vec<f32>, usize), Error> {
        let radius = (2 * fine) as f64 * spread(diameter);
        let half = libm::ceil(radius) as usize;
        let parts = 24_usize.div_ceil(2 * half).max(2);
        let mut quarter = zeroed::<f32>(half * half)?;
        let step = 1.0 / parts as f64;
        let away = |i: usize| ((i as f64 + 0.5) * step - half as f64).powi(2) / (radius * radius);
        let mut sum = 0.0;
        for row in 0..half * parts {
            let y = away(row);
            for col in 0..half * parts {
                let inside = 1.0 - y - away(col);
                if inside > 0.0 {
                    let place = 256.0 * inside.sqrt() as f32;
                    let index = (place as usize).min(255);
                    let (a, b) = (self.0[index], self.0[index + 1]);
                    let value = a + (place - index as f32) * (b - a);
                    quarter[row / parts * half + col / parts] += value;
                    sum += 4.0 * f64::from(value);
                }
            }
        }
        let energy = mean_opacity(self.1) * std::f64::consts::FRAC_PI_4 * diameter * diameter;
        let scale = if sum > 0.0 { (energy / sum) as f32 } else { 0.0 };
        let side = 2 * half;
        let mirrored = |at: usize| at.min(side - 1 - at);
        let at = |cell: usize| quarter[mirrored(cell / side) * half + mirrored(cell % side)];
        Ok((collected((0..side * side).map(|cell| scale * at(cell)))?, half))
    }
}

/// The optical depth that a flake adds to pixels, on the lattice of quarters: `n` of a pixel and a
/// flake is 4 times the pixel's number less the flake's place in quarters.
///
/// Of a flake of which a part `thin` is seen at a time the depth is that of so thin a flake, over the part: blurred
/// along a way that shows a pixel this part, it covers what the flake does.
fn depths(law: &Law, weights: &[Rows], profile: &Profile, diameter: f64) -> Result<Rows, Error> {
    let fine = law.fine();
    let (cells, half) = profile.cells(diameter, fine)?;
    let [top, left] = weights[0].start;
    let [down, across] = [top, fine * left].map(|own| (half as i64 - own) / fine + 3);
    let wide = 2 * across as usize;
    let (mut dense, mut line) = (zeroed(wide * 2 * down as usize)?, zeroed(wide)?);
    // Rows of an upright streak's weights differ by a factor: cells are summed across once.
    let upright = law.streak[0] == 0.0 && law.circle == 0.0;
    let whole = weights[0].row(0).1.first().copied().unwrap_or(1.0);
    let add = |out: &mut [f32], cells: &[f32], row: i64| {
        for (cx, &cell) in (-(half as i64)..).zip(cells).filter(|(_, cell)| **cell != 0.0) {
            let odd = cx & (fine - 1);
            let (first, values) = weights[odd as usize].row(row);
            let from = first - 1 + (cx + odd) / fine + across;
            for (out, value) in out[from as usize..].iter_mut().zip(values) {
                *out += cell * value;
            }
        }
    };
    for (cy, cells) in (-(half as i64)..).zip(cells.chunks(2 * half)) {
        line.fill(0.0);
        add(&mut line, cells, 0);
        for (n, out) in (-down..).zip(dense.chunks_mut(wide)) {
            // From the middle of cell c to a pixel's middle at n + 3/2 quarters lie fine (n + 3/2) - c - 1/2 cells.
            let row = fine * (n + 1) - cy;
            let share = weights.iter().find_map(|each| each.row(row).1.first());
            let Some(share) = share.map(|share| share / whole) else { continue };
            if upright {
                out.iter_mut().zip(&line).for_each(|(out, value)| *out += share * value);
            } else {
                add(out, cells, row);
            }
        }
    }
    // In the middle of a streak rows are alike, and need no logarithms.
    let mut above = collected((0..wide).map(|_| (0.0, 0.0)))?;
    for row in dense.chunks_mut(wide) {
        for (value, (above, depth)) in row.iter_mut().zip(&mut above) {
            if *value != *above {
                let seen = (law.thin * f64::from(*value)).min(1.0 - 1e-9);
                (*above, *depth) = (*value, (-libm::log1p(-seen) / law.thin) as f32);
            }
            *value = *depth;
        }
    }
    Rows::new([-down, -across], &dense, wide)
}

/// Steps in a row, from a row and a column on, counted from the flake's pixel.
type Piece = (i32, i32, [u16; WIDTH]);

/// The stamps of all diameters and of all places within a pixel.
pub struct Stamps {
    /// Optical depth of a step of bytes.
    pub unit: f32,
    /// The mean over flakes of what one adds to all pixels.
    pub total: f64,
    /// Rows above and below, and columns left and right, that stamps need about a flake's pixel.
    pub reach: (usize, usize),
    /// Where they begin, in pixels from the flake's: 16 stamps for each diameter, row by row.
    pub pieces: Vec<(isize, [u16; WIDTH])>,
    /// Pixels from row to row of what is stamped on.
    pub stride: usize,
    /// Pieces of a stamp, of each as many: a loop of another length each time is mispredicted, which takes
    /// longer than to add zeros.
    pub each: usize,
}

impl Stamps {
    pub fn new(law: &Law) -> Result<Self, Error> {
        let (count, profile, weights) = (law.shown(), Profile::new(law.tau0), weights(law)?);
        let image = |&wide: &f32| depths(law, &weights, &profile, f64::from(wide));
        let images = law.diameters.iter().map(image).collect::<Result<Vec<_>, _>>()?;
        let (sizes, mut total, mut square, mut largest) = (images.len(), 0.0, 0.0, 0.0_f64);
        for (number, image) in images.iter().enumerate() {
            let share = (2 * (sizes - number) - 1) as f64 / (16 * sizes * sizes) as f64;
            for value in image.values.iter().copied().map(f64::from) {
                total += share * value;
                square += share * value * value;
                largest = largest.max(value);
            }
        }
        // Room for two of the brightest flakes, of which nothing is seen beyond 6.5, and for what seldom
        // adds up.
        let room = (2.1 * largest)
            .min(largest.max(6.5))
            .max(count * total + 8.0 * libm::sqrt(count * square));
        let unit = (room / 255.0).max(1e-20) as f32;
        // One list: in a process that has forked each piece of memory is copied when it is first written.
        let (mut steps, mut ends) = (Vec::new(), zeroed(16 * sizes + 1)?);
        for (number, end) in ends[1..].iter_mut().enumerate() {
            let place = [number as i64 / 4 % 4, number as i64 % 4];
            stamp(&images[number / 16], place, f64::from(unit), &mut steps)?;
            *end = steps.len();
        }
        let stamps = ends.windows(2).map(|ends| &steps[ends[0]..ends[1]]);
        let each = stamps.clone().map(<[Piece]>::len).max().unwrap_or(0);
        let far = |(rows, cols): (i32, i32), &(row, col, _): &Piece| {
            (rows.max(row.abs()), cols.max(-col).max(col + WIDTH as i32))
        };
        // Zeros that fill up begin at the flake's pixel.
        let reach = steps.iter().fold((0, WIDTH as i32), far);
        let reach = (reach.0 as usize, reach.1 as usize);
        // An odd number of cache lines: rows do not share places of the cache.
        let stride = 32 * ((law.period.1 + 2 * reach.1 + 1).div_ceil(32) | 1);
        let mut pieces = Vec::new();
        reserve(&mut pieces, 16 * sizes * each)?;
        for stamp in stamps {
            let filled = stamp.iter().copied().chain(std::iter::repeat((0, 0, [0; WIDTH])));
            let placed = |(row, col, piece)| (row as isize * stride as isize + col as isize, piece);
            pieces.extend(filled.take(each).map(placed));
        }
        Ok(Self { unit, total, reach, pieces, stride, each })
    }
}

/// Adds the stamp of a flake at a place, in quarters, within its pixel.
fn stamp(image: &Rows, at: [i64; 2], unit: f64, pieces: &mut Vec<Piece>) -> Result<(), Error> {
    let ([y, x], own) = (at, pieces.len());
    let bottom = image.start[0] + image.spans.len() as i64;
    for row in (image.start[0] + y).div_euclid(4)..=(bottom + y).div_euclid(4) {
        let (first, values) = image.row(4 * row - y);
        let skipped = (-x - first).rem_euclid(4);
        let col = (first + skipped + x) / 4;
        for (col, &value) in (col..).zip(values.iter().skip(skipped as usize).step_by(4)) {
            let (row, col) = (row as i32, col as i32);
            let steps = (f64::from(value) / unit * FINE + 0.5) as u16;
            if steps == 0 {
                continue;
            }
            let last = pieces[own..].last();
            if !last.is_some_and(|&(y, x, _)| y == row && col - x < WIDTH as i32) {
                pushed(pieces, (row, col, [0; WIDTH]))?;
            }
            if let Some((_, x, piece)) = pieces.last_mut() {
                piece[(col - *x) as usize] = steps;
            }
        }
    }
    Ok(())
}
