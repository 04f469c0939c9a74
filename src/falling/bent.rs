//! Sheets read where the places of a picture move in their own ways: a camera that goes ahead, turns or
//! zooms, and uneven wind.
//!
//! Nodes of a lattice over the picture say which pixel of a sheet is seen there; between them it is even.
//! A run of pixels reads its bytes side by side, so that no flake is stretched, and a picture that grows
//! by some hundredths shows no seam. Sheets of one depth are summed, and the sum is blurred along the way
//! that the nodes say. Nodes and runs count from the picture's first pixel: windows and parts have the
//! bits of the whole.

use std::ops::Range;

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut2, Axis};

use super::layers::left;
use super::sheet::Sheet;
use crate::base::error::{Cancel, Error, layout, pushed, reserve};
use crate::base::pool::{self, line};
use crate::base::simd::{dispatch, multiply_add};

/// Pixels from node to node; the first ones lie so far before the picture's first pixel.
pub const APART: usize = 64;

/// Numbers at a sheet's node: column and row of the sheet that are seen there, less the picture's; the gain, and
/// what is added.
pub const NUMBERS: usize = 4;

/// Pixels that are read side by side, and runs between two nodes.
const RUN: usize = 8;
const RUNS: usize = APART / RUN;

/// A way is at most so long along an axis, px, so that its half and the runs beside it fit between two nodes; and
/// one shorter than the second is none.
const LONGEST: f32 = 114.0;
const REST: f32 = 0.3;

/// Taps on whole pixels leave more of the finest waves along a way than its even share does; so much of its length
/// more, and the octave has the power that it should.
const LONGER: f32 = 1.06;

/// Rows of a picture that are summed before they are blurred.
const ROWS: usize = 128;

/// Periods of a torus by which a node may lie beside it.
const ROUNDS: f32 = 64.0;

pub struct Group<'a> {
    /// Each with its nodes, (rows, columns, [`NUMBERS`]).
    pub sheets: Vec<(&'a Sheet, ArrayView3<'a, f32>)>,
    /// Pixels, x and y, by which flakes move during the exposure, (rows, columns, 2).
    pub ways: ArrayView3<'a, f32>,
    /// Depths between which they lie, evenly.
    pub near: f32,
    pub far: f32,
}

/// A sheet with the places that are read.
struct Sight<'a> {
    places: [&'a [u8]; 16],
    nodes: ArrayView3<'a, f32>,
    period: (i32, i32),
    shear: i32,
    unit: f32,
}

impl<'a> Sight<'a> {
    fn new(
        &(sheet, nodes): &(&'a Sheet, ArrayView3<'a, f32>),
        cancel: &Cancel,
    ) -> Result<Self, Error> {
        let (rows, cols) = sheet.law.period;
        let near = |node: &f32, period: usize| node.abs() < ROUNDS * period as f32;
        let sound = nodes.len_of(Axis(2)) == NUMBERS
            && nodes.lanes(Axis(2)).into_iter().all(|at| near(&at[0], cols) && near(&at[1], rows));
        if !sound {
            return Err(Error::Internal("no nodes look like that".into()));
        }
        let mut places = [&[][..]; 16];
        let wanted = wanted(nodes);
        for number in (0..16).filter(|&number| wanted[number]) {
            places[number] = sheet.place(number, cancel)?;
        }
        let (period, shear) = ((rows as i32, cols as i32), sheet.law.shear as i32);
        Ok(Self { places, nodes, period, shear, unit: sheet.stamps.unit })
    }

    /// What brings a row and a column onto the torus.
    #[inline(always)]
    fn rounds(&self, (row, col): (i32, i32)) -> (i32, i32) {
        let (rows, cols) = self.period;
        let (mut down, mut right) = (0, 0);
        while row + down < 0 {
            (down, right) = (down + rows, right + self.shear);
        }
        while row + down >= rows {
            (down, right) = (down - rows, right - self.shear);
        }
        while col + right < 0 {
            right += cols;
        }
        while col + right >= cols {
            right -= cols;
        }
        (down, right)
    }

    /// The bytes of a run from a row and a column on, of a place.
    #[inline(always)]
    fn run(&self, at: (i32, i32), place: usize) -> [u8; RUN] {
        let (down, right) = self.rounds(at);
        let (row, col) = ((at.0 + down) as usize, (at.1 + right) as usize);
        let line = &self.places[place][row * self.period.1 as usize..][..self.period.1 as usize];
        let near = line.get(col..).and_then(<[u8]>::first_chunk).copied();
        near.unwrap_or_else(|| std::array::from_fn(|i| line[(col + i) % line.len()]))
    }
}

/// Quarters of a pixel, whole halves: up to 2^20 of them, where the sum has no bits for parts. What moves by
/// pixels a frame is not seen to stop at halves, and four places take a quarter of the bytes.
#[inline(always)]
fn quarters(at: f32) -> i32 {
    const WHOLE: f32 = 12_582_912.0;
    2 * ((2.0 * at + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32)
}

/// Which places are read: one where all nodes are alike.
fn wanted(nodes: ArrayView3<'_, f32>) -> [bool; 16] {
    let mut each = nodes.lanes(Axis(2)).into_iter();
    let Some(first) = each.next() else { return [false; 16] };
    let (right, down) = (-quarters(first[0]) & 3, -quarters(first[1]) & 3);
    let alike = each.all(|at| at[0] == first[0] && at[1] == first[1]);
    let one = (4 * down + right) as usize;
    std::array::from_fn(|number| if alike { number == one } else { number & 5 == 0 })
}

/// A group with what is read of it.
struct Part<'a> {
    group: &'a Group<'a>,
    sights: Vec<Sight<'a>>,
    slope: f32,
    /// Pixels on each side that its longest way needs.
    reach: usize,
}

impl<'a> Part<'a> {
    fn new(group: &'a Group<'a>, cancel: &Cancel) -> Result<Self, Error> {
        let longest = group.ways.iter().fold(0.0_f32, |longest, way| longest.max(way.abs()));
        if group.ways.len_of(Axis(2)) != 2 || longest > LONGEST {
            return Err(Error::Internal("no ways look like that".into()));
        }
        let mut sights = Vec::new();
        for sheet in &group.sheets {
            pushed(&mut sights, Sight::new(sheet, cancel)?)?;
        }
        let reach = if longest < REST { 0 } else { (0.5 * LONGER * longest) as usize + 3 };
        Ok(Self { group, sights, slope: 1.0 / (group.far - group.near), reach })
    }
}

/// Writes what sheets hide: 1 - exp(-sum of their optical depths).
///
/// `corner` is the row and column of the first pixel in the picture. A group shows what lies before the
/// `depth` of a pixel, of the shape of `out`; NaN hides nothing.
pub fn read<'a>(
    out: ArrayViewMut2<'_, f32>,
    corner: [usize; 2],
    groups: &'a [Group<'a>],
    depth: Option<ArrayView2<'_, f32>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let columns = out.ncols();
    let reach = |length: usize, first: usize| (first + length).div_ceil(APART) + 3;
    let nodes = (reach(out.nrows(), corner[0]), reach(columns, corner[1]));
    let short = |found: &ArrayView3<'_, f32>| found.dim().0 < nodes.0 || found.dim().1 < nodes.1;
    let each =
        |group: &Group<'_>| short(&group.ways) || group.sheets.iter().any(|one| short(&one.1));
    if depth.is_some_and(|depth| depth.dim() != out.dim()) || groups.iter().any(each) {
        return Err(layout());
    }
    let mut parts = Vec::new();
    for group in groups {
        pushed(&mut parts, Part::new(group, cancel)?)?;
    }
    let runs = out.nrows().div_ceil(ROWS).max(pool::threads());
    pool::for_each(pool::rows(out, runs), |(rows, mut out)| {
        out.fill(0.0);
        let mut plane = Vec::new();
        for part in &parts {
            // Whole cells, as many as the window and its ways touch.
            let (margin, first) = (part.reach, corner[1] + APART - part.reach);
            let cells = first / APART..(corner[1] + APART + columns + margin).div_ceil(APART);
            let (width, tall) = (cells.len() * APART, rows.len() + 2 * margin);
            plane.clear();
            let size = width * tall + APART;
            reserve(&mut plane, size)?;
            plane.resize(size, 0.0);
            let top = corner[0] + APART + rows.start - margin;
            let runs = first / RUN..(corner[1] + APART + columns + margin).div_ceil(RUN);
            for sight in &part.sights {
                cancel.check()?;
                for (row, line) in (top..).zip(plane.chunks_exact_mut(width)) {
                    sum(line, sight, row, &runs);
                }
            }
            for (row, mut out) in out.rows_mut().into_iter().enumerate() {
                cancel.check()?;
                let out = out.as_slice_mut().ok_or_else(layout)?;
                let depth = depth.map(|depth| line(depth, rows.start + row)).transpose()?;
                let at = (corner[0] + APART + rows.start + row, corner[1] + APART);
                let from = (row + margin, corner[1] + APART - cells.start * APART);
                blur(out, part, (&plane, width), at, from, depth);
            }
        }
        out.rows_mut().into_iter().try_for_each(|mut out| {
            hidden(out.as_slice_mut().ok_or_else(layout)?);
            Ok(())
        })
    })
}

/// What a row sees of a column of nodes.
#[inline(always)]
fn node<const N: usize>(nodes: &ArrayView3<'_, f32>, row: usize, col: usize) -> [f32; N] {
    let (above, down) = (row / APART, ((row % APART) as f32 + 0.5) / APART as f32);
    std::array::from_fn(|i| {
        let (low, high) = (nodes[(above, col, i)], nodes[(above + 1, col, i)]);
        low + down * (high - low)
    })
}

/// Adds some runs of a row of a sheet to a line that begins with the cell of the first.
#[dispatch]
fn sum<const LEVEL: u8>(line: &mut [f32], sight: &Sight<'_>, row: usize, needed: &Range<usize>) {
    let first = needed.start / RUNS;
    let mut right: [f32; NUMBERS] = node(&sight.nodes, row, first);
    for (col, cell) in (first..).zip(line.chunks_exact_mut(APART)) {
        let left = right;
        right = node(&sight.nodes, row, col + 1);
        if left[2..] == [0.0; 2] && right[2..] == [0.0; 2] {
            continue;
        }
        let (mut gains, mut bases) = ([0.0; RUNS], [0.0; RUNS]);
        let (mut rows, mut cols, mut places) = ([0; RUNS], [0; RUNS], [0; RUNS]);
        // Nodes begin before the picture.
        let at = (row as i32 - APART as i32, (col * APART) as i32 - APART as i32);
        for k in 0..RUNS {
            let part = (k as f32 + 0.5) / RUNS as f32;
            let [x, y, gain, base] = std::array::from_fn(|i| left[i] + part * (right[i] - left[i]));
            let (x, y) = (quarters(x), quarters(y));
            let (aside, down) = (-x & 3, -y & 3);
            (rows[k], cols[k]) =
                (at.0 + ((y + down) >> 2), at.1 + ((x + aside) >> 2) + (k * RUN) as i32);
            (places[k], gains[k], bases[k]) = (4 * down + aside, gain * sight.unit, base);
        }
        let skipped = needed.start.saturating_sub(col * RUNS);
        let end = RUNS.min(needed.end - col * RUNS);
        let runs = cell.as_chunks_mut::<RUN>().0.iter_mut().enumerate();
        let rounds = sight.rounds((rows[0], cols[0]));
        let last = (rows[RUNS - 1] + rounds.0, cols[RUNS - 1] + rounds.1);
        let on = |at: i32, most: i32| (0..=most).contains(&at);
        // What is even is farthest at its ends.
        let whole = end - skipped == RUNS;
        if whole && on(last.0, sight.period.0 - 1) && on(last.1, sight.period.1 - RUN as i32) {
            let mut from = [0; RUNS];
            for k in 0..RUNS {
                from[k] = (rows[k] + rounds.0) * sight.period.1 + cols[k] + rounds.1;
            }
            for (k, out) in runs {
                let place = sight.places[places[k] as usize & 15];
                let bytes = place.get(from[k] as usize..).and_then(<[u8]>::first_chunk);
                let bytes: &[u8; RUN] = bytes.unwrap_or(&[0; RUN]);
                for i in 0..RUN {
                    out[i] += multiply_add::<f32, LEVEL>(f32::from(bytes[i]), gains[k], bases[k]);
                }
            }
        } else {
            for (k, out) in runs.take(end).skip(skipped) {
                let bytes = sight.run((rows[k], cols[k]), places[k] as usize & 15);
                for i in 0..RUN {
                    out[i] += multiply_add::<f32, LEVEL>(f32::from(bytes[i]), gains[k], bases[k]);
                }
            }
        }
    }
}

/// The taps of a way: how many on each side of the middle, the share of an inner one, and of the last.
///
/// Their variance is that of the way, length^2 / 12; as many even taps as have no more, and a part of the next.
#[inline(always)]
fn taps(length: f32) -> (i32, f32, f32) {
    let square = length * length / 12.0;
    let m = (0.5 * ((1.0 + length * length).sqrt() - 1.0)).ceil().max(1.0);
    let inner = (m - 1.0) * m * (2.0 * m - 1.0) / 3.0;
    let end = ((square * (2.0 * m - 1.0) - inner) / (2.0 * (m * m - square))).clamp(0.0, 1.0);
    let share = 1.0 / (2.0 * m - 1.0 + 2.0 * end);
    (m as i32, share, end * share)
}

/// Adds a part of a plane, from a pixel on.
#[inline(always)]
fn tap<const LEVEL: u8>(sums: &mut [f32; APART], plane: &[f32], at: usize, gain: f32) {
    // No way leads beyond the plane, which has room for a cell more than it shows.
    let Some(from) = plane.get(at..).and_then(<[f32]>::first_chunk::<APART>) else { return };
    for i in 0..APART {
        sums[i] = multiply_add::<f32, LEVEL>(from[i], gain, sums[i]);
    }
}

/// Adds a row of a plane, blurred and weighed by the share of the group that lies before a wall. A cell's pixels
/// have one way.
#[dispatch]
fn blur<const LEVEL: u8>(
    out: &mut [f32],
    part: &Part<'_>,
    plane: (&[f32], usize),
    at: (usize, usize),
    from: (usize, usize),
    depth: Option<&[f32]>,
) {
    let (plane, width) = plane;
    let (mut done, end) = (0, out.len());
    while done < end {
        let col = at.1 + done;
        let run = (APART - col % APART).min(end - done);
        let (left, right): ([f32; 2], [f32; 2]) = (
            node(&part.group.ways, at.0, col / APART),
            node(&part.group.ways, at.0, col / APART + 1),
        );
        let way: [f32; 2] = std::array::from_fn(|i| 0.5 * (left[i] + right[i]));
        let first = from.0 * width + from.1 + done;
        let mut sums = [0.0; APART];
        let steep = way[1].abs() > way[0].abs();
        let (long, short) = if steep { (way[1], way[0]) } else { (way[0], way[1]) };
        let (along, aside) = if steep { (width, 1) } else { (1, width) };
        if long.abs() < REST {
            tap::<LEVEL>(&mut sums, plane, first, 1.0);
        } else {
            let (most, inner, last) = taps(LONGER * long.abs());
            let slope = short / long;
            for number in -most..=most {
                let gain = if number.abs() == most { last } else { inner };
                let off = slope * number as f32;
                let whole = off.round_ties_even();
                let (number, whole, part) = (number as isize, whole as isize, off - whole);
                let at = number * along as isize + whole * aside as isize;
                let at = first.wrapping_add_signed(at);
                // Three pixels across that have the place and no width: two would make the streak wider.
                tap::<LEVEL>(&mut sums, plane, at, gain * (1.0 - part * part));
                if part != 0.0 {
                    let (low, high) = (0.5 * part * (part - 1.0), 0.5 * part * (part + 1.0));
                    tap::<LEVEL>(&mut sums, plane, at - aside, gain * low);
                    tap::<LEVEL>(&mut sums, plane, at + aside, gain * high);
                }
            }
        }
        let out = &mut out[done..done + run];
        match depth {
            None => out.iter_mut().zip(&sums).for_each(|(out, sum)| *out += sum),
            Some(depth) => {
                for ((out, &sum), &depth) in out.iter_mut().zip(&sums).zip(&depth[done..]) {
                    let share = ((depth - part.group.near) * part.slope).clamp(0.0, 1.0);
                    *out += sum * if depth < part.group.far { share } else { 1.0 };
                }
            }
        }
        done += run;
    }
}

#[dispatch]
fn hidden<const LEVEL: u8>(out: &mut [f32]) {
    for out in out {
        *out = 1.0 - left::<LEVEL>(*out);
    }
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, Array3};

    use super::super::layers::{self, Layer, Others};
    use super::super::sheet::tests::law;
    use super::super::stamp::Law;
    use super::*;

    static CANCEL: Cancel = Cancel::new();

    fn sheet() -> Sheet {
        let flat = law(0.05, &[0.8, 1.6], [0.0; 2], (150, 170));
        Sheet::new(Law { seed: 3, shear: 40, ..flat }).unwrap()
    }

    /// Nodes of a picture of at most 300 x 200 pixels, where a function says what is seen at a place.
    fn nodes<const N: usize>(of: impl Fn(f32, f32) -> [f32; N]) -> Array3<f32> {
        let place = |index: usize| (index as f32 - 1.0) * APART as f32;
        Array3::from_shape_fn((8, 7, N), |(row, col, i)| of(place(row), place(col))[i])
    }

    fn picture(
        sheet: &Sheet,
        at: &Array3<f32>,
        way: &Array3<f32>,
        window: (Range<usize>, Range<usize>),
        depth: Option<&Array2<f32>>,
    ) -> Array2<f32> {
        let mut out = Array2::from_elem((window.0.len(), window.1.len()), f32::NAN);
        let group =
            Group { sheets: vec![(sheet, at.view())], ways: way.view(), near: 2.0, far: 3.0 };
        let corner = [window.0.start, window.1.start];
        read(out.view_mut(), corner, &[group], depth.map(|depth| depth.view()), &CANCEL).unwrap();
        out
    }

    fn rest() -> Array3<f32> {
        nodes(|_, _| [0.0, 0.0])
    }

    #[test]
    fn nodes_that_are_alike_are_a_shift() {
        let sheet = sheet();
        for (x, y) in [(0.0, 0.0), (-3.0, 8.5), (500.5, -700.0)] {
            let got =
                picture(&sheet, &nodes(|_, _| [x, y, 0.7, 0.0]), &rest(), (0..300, 0..200), None);
            let shift = [f64::from(-x), f64::from(-y)];
            let layer = Layer { sheet: &sheet, shift, gain: 0.7, base: 0.0, near: 0.0, far: 1.0 };
            let mut want = Array2::zeros((300, 200));
            let others = Some(Others::default());
            layers::read(want.view_mut(), [0, 0], &[layer], None, others, None, &CANCEL).unwrap();
            assert!((&got - &want).iter().all(|off| off.abs() < 1e-6), "{x} {y}");
        }
    }

    #[test]
    fn a_larger_picture_shows_the_flakes_farther_apart() {
        // Of a picture grown by a tenth the pixel (1.1 y, 1.1 x) shows what (y, x) did.
        let sheet = sheet();
        let seen = |grown: f32| {
            let at = nodes(|y, x| [x / grown - x, y / grown - y, 1.0, 0.0]);
            picture(&sheet, &at, &rest(), (0..300, 0..200), None)
        };
        let (before, after) = (seen(1.0), seen(1.1));
        let (mut both, mut one, mut other) = (0.0, 0.0, 0.0);
        for row in 10..260 {
            for col in 10..170 {
                let place = |at: usize| ((at as f32 + 0.5) * 1.1) as usize;
                let (a, b) = (before[(row, col)] - 0.04, after[(place(row), place(col))] - 0.04);
                (both, one, other) = (both + a * b, one + a * a, other + b * b);
            }
        }
        let alike: f32 = both / (one * other).sqrt();
        assert!(alike > 0.75, "{alike}");
        let (a, b) = (before.mean().unwrap(), after.mean().unwrap());
        assert!((a / b - 1.0).abs() < 0.03, "{a} {b}");
    }

    #[test]
    fn taps_spread_as_the_way_does() {
        for length in [0.3, 1.0, 2.0, 2.83, 3.7, 9.1, 40.0, 120.0_f32] {
            let (most, inner, last) = taps(length);
            let each = |tap: i32| f64::from(if tap.abs() == most { last } else { inner });
            let sum: f64 = (-most..=most).map(each).sum();
            let square: f64 = (-most..=most).map(|tap| f64::from(tap * tap) * each(tap)).sum();
            let want = f64::from(length * length) / 12.0;
            assert!((sum - 1.0).abs() < 1e-5 && (square / want - 1.0).abs() < 1e-4, "{length}");
        }
    }

    #[test]
    fn a_streak_keeps_the_mean_and_a_wall_hides_its_share() {
        let sheet = sheet();
        let at = nodes(|_, _| [0.0, 0.0, 1.0, 0.0]);
        let depths = |picture: &Array2<f32>| picture.mapv(|hidden| -f64::from(-hidden).ln_1p());
        let (still, moved) = (rest(), nodes(|_, _| [7.0, -4.0]));
        let whole = depths(&picture(&sheet, &at, &still, (0..150, 0..170), None));
        let streaked = depths(&picture(&sheet, &at, &moved, (0..150, 0..170), None));
        assert!((whole.mean().unwrap() / streaked.mean().unwrap() - 1.0).abs() < 0.03);
        assert!(streaked.std(0.0) < 0.7 * whole.std(0.0));
        for (depth, share) in [(1.0, 0.0), (2.25, 0.25), (3.0, 1.0), (f32::NAN, 1.0)] {
            let wall = Array2::from_elem((150, 170), depth);
            let part = depths(&picture(&sheet, &at, &moved, (0..150, 0..170), Some(&wall)));
            let off = (&part - &(share * &streaked)).mapv(f64::abs);
            assert!(off.iter().all(|&off| off < 2e-6), "{depth}");
        }
    }
}
