//! Sheets read where the places of a picture move in their own ways: a camera that goes ahead, turns or
//! zooms, and uneven wind.
//!
//! Nodes of a lattice over the picture say which pixel of a sheet is seen there; between them it is even.
//! A run of pixels reads its bytes side by side, so that no flake is stretched, and a picture that grows
//! by some hundredths shows no seam. Sheets of one depth are summed, and the sum is blurred along the way
//! that the nodes say. Nodes and runs count from the picture's first pixel: windows and parts have the
//! bits of the whole.

use std::ops::Range;

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut2, Axis, s};

use super::blur::{Streaks, blur};
use super::layers::left;
use super::sheet::Sheet;
use crate::base::error::{Cancel, Error, layout, pushed, reserve};
use crate::base::pool;
use crate::base::simd::{dispatch, multiply_add};

/// Pixels from node to node; the first ones lie so far before the picture's first pixel.
pub const APART: usize = 64;

/// Numbers at a sheet's node: column and row of the sheet that are seen there, less the picture's; the gain, and
/// what is added.
pub const NUMBERS: usize = 4;

/// Pixels that are read side by side, and runs between two nodes.
const RUN: usize = 8;
const RUNS: usize = APART / RUN;

/// Rows and columns of a picture that are summed before they are blurred: a sum stays in the second cache.
const ROWS: usize = 128;
const STRIP: usize = 1024;

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

/// Numbers at the nodes of a lattice, side by side.
pub struct Nodes<'a, const N: usize> {
    pub each: &'a [[f32; N]],
    columns: usize,
}

impl<'a, const N: usize> Nodes<'a, N> {
    pub fn new(view: ArrayView3<'a, f32>) -> Result<Self, Error> {
        let (_, columns, numbers) = view.dim();
        if numbers != N {
            return Err(Error::Internal("no nodes look like that".into()));
        }
        Ok(Self { each: view.to_slice().ok_or_else(layout)?.as_chunks().0, columns })
    }

    /// What a row sees of a column of nodes.
    #[inline(always)]
    pub fn at(&self, row: usize, col: usize) -> [f32; N] {
        let (above, down) = (row / APART, ((row % APART) as f32 + 0.5) / APART as f32);
        let first = above * self.columns + col;
        let (low, high) = (self.each[first], self.each[first + self.columns]);
        std::array::from_fn(|i| low[i] + down * (high[i] - low[i]))
    }
}

/// A sheet with the places that are read.
struct Sight<'a> {
    places: [&'a [u8]; 16],
    nodes: Nodes<'a, NUMBERS>,
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
        let nodes = Nodes::new(nodes)?;
        let most = [cols, rows].map(|period| ROUNDS * period as f32);
        if !nodes.each.iter().all(|at| at[0].abs() < most[0] && at[1].abs() < most[1]) {
            return Err(Error::Internal("no sheet reaches so far".into()));
        }
        let mut places = [&[][..]; 16];
        let wanted = wanted(nodes.each);
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
fn wanted(nodes: &[[f32; NUMBERS]]) -> [bool; 16] {
    let Some(first) = nodes.first() else { return [false; 16] };
    let (right, down) = (-quarters(first[0]) & 3, -quarters(first[1]) & 3);
    let alike = nodes.iter().all(|at| at[..2] == first[..2]);
    let one = (4 * down + right) as usize;
    std::array::from_fn(|number| if alike { number == one } else { number & 5 == 0 })
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
    let reach = |length: usize, first: usize| (first + length).div_ceil(APART) + 3;
    let nodes = (reach(out.nrows(), corner[0]), reach(out.ncols(), corner[1]));
    let short = |found: &ArrayView3<'_, f32>| found.dim().0 < nodes.0 || found.dim().1 < nodes.1;
    let each =
        |group: &Group<'_>| short(&group.ways) || group.sheets.iter().any(|one| short(&one.1));
    if depth.is_some_and(|depth| depth.dim() != out.dim()) || groups.iter().any(each) {
        return Err(layout());
    }
    let mut parts = Vec::new();
    for group in groups {
        let sights = group.sheets.iter().map(|one| Sight::new(one, cancel));
        let sights = sights.collect::<Result<Vec<_>, _>>()?;
        pushed(&mut parts, (sights, Streaks::new(group)?))?;
    }
    let runs = out.nrows().div_ceil(ROWS).max(pool::threads());
    pool::for_each(pool::rows(out, runs), |(rows, mut out)| {
        out.fill(0.0);
        let mut plane = Vec::new();
        for (number, mut strip) in out.axis_chunks_iter_mut(Axis(1), STRIP).enumerate() {
            // From the first node on, which lies before the picture.
            let at = [corner[0] + APART + rows.start, corner[1] + APART + number * STRIP];
            let depth = depth.map(|map| map.slice_move(s![rows.clone(), number * STRIP..]));
            for (sights, streaks) in &parts {
                cancel.check()?;
                let (margin, columns) = (streaks.reach, strip.ncols());
                let (first, end) = (at[1] - margin, at[1] + columns + margin);
                // Whole cells, as many as the strip and its ways touch.
                let cells = first / APART..end.div_ceil(APART);
                let width = cells.len() * APART;
                let size = width * (strip.nrows() + 2 * margin) + APART;
                let missing = size.saturating_sub(plane.len());
                reserve(&mut plane, missing)?;
                plane.resize(plane.len() + missing, 0.0);
                let runs = first / RUN..end.div_ceil(RUN);
                for (row, line) in (at[0] - margin..).zip(plane[..size].chunks_exact_mut(width)) {
                    line.fill(0.0);
                    sights.iter().for_each(|sight| sum(line, sight, row, &runs));
                }
                let from = (margin, at[1] - cells.start * APART);
                blur(strip.view_mut(), streaks, (&plane, width), at, from, depth)
                    .ok_or_else(layout)?;
            }
        }
        out.rows_mut().into_iter().try_for_each(|mut out| {
            hidden(out.as_slice_mut().ok_or_else(layout)?);
            Ok(())
        })
    })
}

/// Adds some runs of a row of a sheet to a line that begins with the cell of the first.
#[dispatch]
fn sum<const LEVEL: u8>(line: &mut [f32], sight: &Sight<'_>, row: usize, needed: &Range<usize>) {
    let first = needed.start / RUNS;
    let mut right = sight.nodes.at(row, first);
    for (col, cell) in (first..).zip(line.chunks_exact_mut(APART)) {
        let left = right;
        right = sight.nodes.at(row, col + 1);
        if left[2..] == [0.0; 2] && right[2..] == [0.0; 2] {
            continue;
        }
        let mut each = [[0.0; RUNS]; NUMBERS];
        for i in 0..NUMBERS {
            for k in 0..RUNS {
                let part = (k as f32 + 0.5) / RUNS as f32;
                each[i][k] = left[i] + part * (right[i] - left[i]);
            }
        }
        let (mut rows, mut cols, mut places) = ([0; RUNS], [0; RUNS], [0; RUNS]);
        let mut flat = [0_i32; RUNS];
        // Nodes begin before the picture.
        let at = (row as i32 - APART as i32, (col * APART) as i32 - APART as i32);
        for k in 0..RUNS {
            let (x, y) = (quarters(each[0][k]), quarters(each[1][k]));
            let (aside, down) = (-x & 3, -y & 3);
            rows[k] = at.0 + ((y + down) >> 2);
            cols[k] = at.1 + ((x + aside) >> 2) + (k * RUN) as i32;
            places[k] = (4 * down + aside) as usize & 15;
            flat[k] = rows[k].wrapping_mul(sight.period.1).wrapping_add(cols[k]);
            each[2][k] *= sight.unit;
        }
        let skipped = needed.start.saturating_sub(col * RUNS);
        let end = RUNS.min(needed.end - col * RUNS);
        let rounds = sight.rounds((rows[0], cols[0]));
        let last = (rows[RUNS - 1] + rounds.0, cols[RUNS - 1] + rounds.1);
        let on = |at: i32, most: i32| (0..=most).contains(&at);
        let runs = cell.as_chunks_mut::<RUN>().0.iter_mut().enumerate().take(end).skip(skipped);
        // What is even is farthest at its ends.
        if on(last.0, sight.period.0 - 1) && on(last.1, sight.period.1 - RUN as i32) {
            let first = rounds.0.wrapping_mul(sight.period.1).wrapping_add(rounds.1);
            for (k, out) in runs {
                let near = sight.places[places[k]].get(flat[k].wrapping_add(first) as usize..);
                let near = near.and_then(<[u8]>::first_chunk).unwrap_or(&[0; RUN]);
                add::<LEVEL>(out, near, each[2][k], each[3][k]);
            }
        } else {
            for (k, out) in runs {
                let around = sight.run((rows[k], cols[k]), places[k]);
                add::<LEVEL>(out, &around, each[2][k], each[3][k]);
            }
        }
    }
}

#[inline(always)]
fn add<const LEVEL: u8>(out: &mut [f32; RUN], bytes: &[u8; RUN], gain: f32, base: f32) {
    for i in 0..RUN {
        out[i] += multiply_add::<f32, LEVEL>(f32::from(bytes[i]), gain, base);
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
            let (lean, gain) = ((0.0, 1.0), (0.7, 0.0));
            let layer = Layer { sheet: &sheet, shift, lean, gain, near: 0.0, far: 1.0 };
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
