//! Sheets: far flakes of one layer (a slab of depth, a class of size) on a torus, read at places.
//!
//! A sheet is made by stamping its flakes, each the same hash of (seed, cell, number), and kept as
//! optical depth in bytes at up to 16 places within a pixel: place (i, j) shows the same flakes moved by
//! (i/4, j/4) px, so that nothing boils from place to place. A place is made when it is first read.
//! Bytes saturate; their sums don't depend on an order, and so not on the number of threads.

use std::sync::OnceLock;

use super::layers::LANES;
use super::stamp::{Law, Stamps, WIDTH};
use crate::base::error::{Cancel, Error, pushed, reserve, zeroed};
use crate::base::pool;
use crate::base::random::{Hash, mix64};
use crate::base::simd::dispatch;

/// Rows and columns of a cell, about: what flakes are stamped on stays in the first cache, and flakes
/// that follow one another seldom lie on one another, where a read would wait for a write.
const CELL: (usize, usize) = (32, 128);

/// Flakes that are counted at once, at most on average: the table of the law of Poisson stays short.
const COUNTED: f64 = 32.0;

/// Where flakes are: cells of one size, which need not be whole pixels.
struct Cells {
    hash: Hash,
    rows: usize,
    cols: usize,
    /// Quarters of a pixel in a cell, in parts of 2^-32.
    steps: [u64; 2],
    /// Each cell's flakes are counted so often, by the distribution of their number.
    counts: usize,
    below: Vec<f64>,
    sizes: u64,
    ranks: Option<(f64, f64)>,
}

impl Cells {
    fn new(law: &Law) -> Result<Self, Error> {
        let (rows, cols) = (law.period.0.div_ceil(CELL.0), law.period.1.div_ceil(CELL.1));
        let step = |length: usize, cells: usize| ((4 * length as u64) << 32) / cells as u64;
        let mean = law.count * law.period.0 as f64 * law.period.1 as f64 / (rows * cols) as f64;
        let counts = libm::ceil(mean / COUNTED).max(1.0);
        let mean = mean / counts;
        let (mut share, mut sum, mut below) = (libm::exp(-mean), 0.0, Vec::new());
        // The rest is less than a step of what numbers are hashed to.
        while (below.len() as f64) < mean || share > 1e-18 {
            sum += share;
            pushed(&mut below, sum)?;
            share *= mean / below.len() as f64;
        }
        Ok(Self {
            hash: Hash::seeded(law.seed as i64),
            rows,
            cols,
            steps: [step(law.period.0, rows), step(law.period.1, cols)],
            counts: counts as usize,
            below,
            sizes: law.diameters.len() as u64,
            ranks: (law.ranks != (0.0, 1.0)).then_some(law.ranks),
        })
    }

    /// The flakes of a cell that are shown: row and column in quarters of a pixel, and size.
    #[inline(always)]
    fn each(&self, cell: usize, mut flake: impl FnMut(usize, usize, usize)) {
        let hash = self.hash.word(cell as i64);
        let number = |count: usize| {
            let unit = hash.word(-1 - count as i64).unit();
            self.below.partition_point(|&below| below <= unit)
        };
        let number: usize = (0..self.counts).map(number).sum();
        let from =
            [(cell / self.cols) as u64 * self.steps[0], (cell % self.cols) as u64 * self.steps[1]];
        // 22 bits for each coordinate, 20 for the size.
        let place = |axis: usize, bits: u64| {
            ((from[axis] + ((bits * self.steps[axis]) >> 22)) >> 32) as usize
        };
        for index in 0..number {
            let bits = hash.word(index as i64).bits();
            if let Some((low, high)) = self.ranks {
                let rank = (mix64(bits) >> 11) as f64 / 9_007_199_254_740_992.0;
                if rank < low || rank >= high {
                    continue;
                }
            }
            // The lesser of two: few flakes are of the last sizes.
            let size = [bits, bits >> 10].map(|bits| ((bits & 0x3FF) * self.sizes) >> 10);
            let size = size[0].min(size[1]) as usize;
            flake(place(0, bits >> 42), place(1, (bits >> 20) & 0x3F_FFFF), size);
        }
    }
}

/// One layer's flakes on a torus.
pub struct Sheet {
    pub law: Law,
    cells: Cells,
    pub stamps: Stamps,
    /// Row by row of places.
    places: [OnceLock<Vec<u8>>; 16],
    /// Of the pixels of the first place by their bytes, up to the last there is.
    pub shares: OnceLock<Vec<f64>>,
}

impl Sheet {
    /// A sheet of which no place is made yet.
    pub fn new(law: Law) -> Result<Self, Error> {
        law.check()?;
        let (cells, stamps) = (Cells::new(&law)?, Stamps::new(&law)?);
        let (places, shares) = ([const { OnceLock::new() }; 16], OnceLock::new());
        Ok(Self { law, cells, stamps, places, shares })
    }

    pub fn bytes(&self) -> usize {
        let made = self.places.iter().filter(|place| place.get().is_some());
        made.count() * self.law.period.0 * self.law.period.1
    }

    pub fn mean(&self) -> f64 {
        self.law.shown() * self.stamps.total
    }

    /// The bytes of place `4 i + j`, where flakes lie i/4 px lower and j/4 px further right, and some more.
    pub fn place(&self, number: usize, cancel: &Cancel) -> Result<&[u8], Error> {
        pool::kept(&self.places[number], || self.made(number, cancel)).map(Vec::as_slice)
    }

    fn made(&self, number: usize, cancel: &Cancel) -> Result<Vec<u8>, Error> {
        let ((rows, cols), stamps) = (self.law.period, &self.stamps);
        let (stride, each, (above, left)) = (stamps.stride, stamps.each, stamps.reach);
        let (down, right, mut parts) = (number / 4, number % 4, Vec::new());
        for cells in pool::split(self.cells.rows, pool::threads()) {
            let pixel = |cells: usize| ((cells as u64 * self.cells.steps[0]) >> 34) as usize;
            let top = pixel(cells.start) as i64 - above as i64;
            // Moved within its pixel, a flake may lie one row further.
            let tall = pixel(cells.end) - pixel(cells.start) + 2 + 2 * above;
            pushed(&mut parts, (cells, top, zeroed::<u16>(tall * stride)?))?;
        }
        pool::for_each(parts.iter_mut(), |(cells, top, sums)| {
            let (sums, top) = (&mut sums[..], *top);
            for cell in cells.start * self.cells.cols..cells.end * self.cells.cols {
                cancel.check()?;
                self.cells.each(cell, |y, x, size| {
                    let (y, x) = (y + down, x + right);
                    let pixel = ((y >> 2) as i64 - top) as usize * stride + (x >> 2) + left;
                    let stamp = 16 * size + 4 * (y & 3) + (x & 3);
                    for (offset, piece) in &stamps.pieces[stamp * each..][..each] {
                        let at = pixel.wrapping_add_signed(*offset);
                        let out = &mut sums[at..at + WIDTH];
                        // All before any is written, which makes one instruction of it.
                        let sum: [u16; WIDTH] =
                            std::array::from_fn(|i| out[i].saturating_add(piece[i]));
                        out.copy_from_slice(&sum);
                    }
                });
            }
            Ok(())
        })?;
        let (mut out, mut line) = (Vec::new(), zeroed::<u16>(cols)?);
        reserve(&mut out, rows * cols + LANES)?;
        for row in 0..rows as i64 {
            // Half a step is added, so that bytes are rounded.
            line.fill(128);
            for (_, top, sums) in &parts {
                let first = (row - top).rem_euclid(rows as i64) as usize;
                let below = (top + first as i64).div_euclid(rows as i64);
                for (round, mut from) in
                    (below..).zip(sums.chunks(stride).skip(first).step_by(rows))
                {
                    let aside = left as i64 + round * self.law.shear as i64;
                    let mut col = (-aside).rem_euclid(cols as i64) as usize;
                    while !from.is_empty() {
                        let run = from.len().min(cols - col);
                        add(&mut line[col..col + run], from);
                        (from, col) = (&from[run..], 0);
                    }
                }
            }
            out.extend(line.iter().map(|sum| (sum >> 8) as u8));
        }
        out.resize(rows * cols + LANES, 0);
        Ok(out)
    }
}

#[dispatch]
fn add<const LEVEL: u8>(line: &mut [u16], from: &[u16]) {
    for (sum, &from) in line.iter_mut().zip(from) {
        *sum = sum.saturating_add(from);
    }
}

#[cfg(test)]
pub mod tests {
    use ndarray::Array2;

    use super::super::layers::{Layer, read};
    use super::super::stamp::spread;
    use super::*;
    use crate::base::ball::{mean_opacity, opacity_at};

    static CANCEL: Cancel = Cancel::new();

    /// A law of sharp flakes of all ranks, that leave below and come in above.
    pub fn law(count: f64, diameters: &[f32], streak: [f64; 2], period: (usize, usize)) -> Law {
        let (shear, diameters, circle, thin, ranks) = (0, diameters.to_vec(), 0.0, 1.0, (0.0, 1.0));
        Law { seed: 7, period, shear, count, diameters, streak, circle, tau0: 4.3, thin, ranks }
    }

    fn flakes(sheet: &Sheet) -> Vec<(usize, usize, usize)> {
        let mut list = Vec::new();
        for cell in 0..sheet.cells.rows * sheet.cells.cols {
            sheet.cells.each(cell, |y, x, size| list.push((y, x, size)));
        }
        list
    }

    /// A flake at a place in its pixel: points of it, moments and points of the disc put into pixels
    /// one by one. `disc` is what it is drawn as, with the light of its diameter.
    fn drawn(law: &Law, diameter: f64, disc: f64, at: [f64; 2]) -> Vec<(i64, i64, f64)> {
        let fine = 24.0_f64.max(24.0 / disc).ceil();
        let moments = (law.streak[0].hypot(law.streak[1]) * 24.0).ceil() as i32 + 1;
        // Some 50 in a square pixel.
        let discs = if law.circle > 0.0 { 40 * (law.circle * law.circle) as i32 + 1 } else { 1 };
        let reach = 0.5 * (law.streak[0].abs().max(law.streak[1].abs()) + law.circle + disc);
        let (half, side) = (reach as i64 + 2, 2 * (reach as usize + 2));
        let (at, mut pixels) = (at.map(|one| one + half as f64), vec![0.0; side * side]);
        let way = |n: i32| {
            let (time, d) = (f64::from(n / discs) + 0.5, f64::from(n % discs));
            let time = time / f64::from(moments) - 0.5;
            let off = 0.5 * law.circle * ((d + 0.5) / f64::from(discs)).sqrt();
            let (sin, cos) = (2.399_963_229_728_653 * d).sin_cos();
            (time * law.streak[1] + off * sin, time * law.streak[0] + off * cos)
        };
        let ways: Vec<_> = (0..moments * discs).map(way).collect();
        let places = |at: f64| {
            let place = move |i: i32| (f64::from(i) + 0.5) / fine;
            (((at - disc) * fine) as i32 - 1..((at + disc) * fine) as i32 + 1).map(place)
        };
        for (y, x) in places(at[1]).flat_map(|y| places(at[0]).map(move |x| (y, x))) {
            let opacity = opacity_at(2.0 * (y - at[1]).hypot(x - at[0]) / disc, law.tau0);
            for (down, right) in ways.iter().filter(|_| opacity > 0.0) {
                pixels[(y + down) as usize * side + (x + right) as usize] += opacity;
            }
        }
        let energy = mean_opacity(law.tau0) * std::f64::consts::FRAC_PI_4 * diameter * diameter
            / pixels.iter().sum::<f64>();
        let value = |(index, &value): (usize, &f64)| {
            let (row, col) = ((index / side) as i64 - half, (index % side) as i64 - half);
            (value > 0.0).then(|| (row, col, -(-value * energy).ln_1p()))
        };
        pixels.iter().enumerate().filter_map(value).collect()
    }

    /// The optical depth of all flakes, moved by whole quarters, summed in double precision.
    fn direct(sheet: &Sheet, moved: (usize, usize)) -> Array2<f64> {
        let (rows, cols) = sheet.law.period;
        let mut stamps = Vec::new();
        for diameter in sheet.law.diameters.iter().copied().map(f64::from) {
            for place in 0..16 {
                let at = [place % 4, place / 4].map(|quarter| (f64::from(quarter) + 0.5) / 4.0);
                stamps.push(drawn(&sheet.law, diameter, spread(diameter), at));
            }
        }
        let mut out = Array2::zeros((rows, cols));
        for (y, x, size) in flakes(sheet) {
            let (y, x) = (y + moved.0, x + moved.1);
            for (row, col, depth) in &stamps[16 * size + 4 * (y % 4) + x % 4] {
                let (down, right) = (y as i64 / 4 + row, x as i64 / 4 + col);
                let aside = down.div_euclid(rows as i64) * sheet.law.shear as i64;
                let row = down.rem_euclid(rows as i64) as usize;
                let col = (right - aside).rem_euclid(cols as i64) as usize;
                out[(row, col)] += depth;
            }
        }
        out
    }

    fn plain<'a>(sheet: &'a Sheet, shift: [f64; 2]) -> Layer<'a> {
        Layer { sheet, shift, lean: (0.0, 1.0), gain: (1.0, 0.0), near: 0.0, far: 1.0 }
    }

    fn picture(shape: (usize, usize), origin: [i64; 2], layers: &[Layer<'_>]) -> Array2<f32> {
        let mut out = Array2::from_elem(shape, f32::NAN);
        read(out.view_mut(), origin, layers, None, None, None, &CANCEL).unwrap();
        out
    }

    #[test]
    fn a_sheet_is_its_flakes_drawn_one_by_one() {
        let cases = [
            (3.0, 0.15, [-42.0, 43.0], 0.0),
            (0.05, 1.0, [0.0, 0.0], 0.0),
            (0.05, 1.0, [60.0, 0.0], 0.0),
            (0.05, 0.7, [0.0, 0.0], 3.0),
            (0.05, 0.4, [0.3, 0.1], 8.0),
            (0.01, 0.7, [0.0, 0.0], 12.0),
            (0.002, 3.0, [0.0, 0.0], 0.0),
            (0.002, 3.0, [31.0, 51.0], 0.0),
        ];
        for (count, diameter, streak, circle) in cases {
            let sheet =
                Sheet::new(Law { circle, ..law(count, &[diameter], streak, (190, 230)) }).unwrap();
            let got = picture((190, 230), [0, 0], &[plain(&sheet, [0.0; 2])]).mapv(f64::from);
            let want = direct(&sheet, (0, 0));
            let (mean, deviation) = (got.mean().unwrap(), got.std(0.0));
            let off = (mean / want.mean().unwrap() - 1.0, deviation / want.std(0.0) - 1.0);
            assert!(off.0.abs() < 3e-3 && off.1.abs() < 1e-2, "{count} {streak:?}: {off:?}");
            // An eighth of a pixel aside would be twice as much.
            let apart = (got - want).std(0.0) / deviation;
            assert!(apart < 0.03, "{count} {streak:?}: {apart}");
            let noise = 5.0 / (count * 190.0 * 230.0).sqrt();
            assert!((sheet.mean() / mean - 1.0).abs() < noise, "{} {mean}", sheet.mean());
        }
    }

    #[test]
    fn the_deviation_is_that_of_flakes_anywhere() {
        for diameter in [0.1_f32, 0.15, 0.25, 0.4, 0.55, 0.8, 1.0, 1.7] {
            for streak in [[0.0, 0.0], [0.0, 1.0], [2.0, 2.0]] {
                let sheet = Sheet::new(law(0.05, &[diameter], streak, (64, 64))).unwrap();
                let unit = f64::from(sheet.stamps.unit);
                let square = |&one: &u16| (-f64::from(one) / 256.0 * unit).exp_m1().powi(2) / 16.0;
                let got: f64 = sheet.stamps.pieces.iter().flat_map(|one| &one.1).map(square).sum();
                let wide = f64::from(diameter);
                let want = (0..576).flat_map(|place| {
                    let at = [place % 24, place / 24].map(|part| (f64::from(part) + 0.5) / 24.0);
                    drawn(&sheet.law, wide, wide, at)
                });
                let want = want.map(|pixel| (-pixel.2).exp_m1().powi(2)).sum::<f64>() / 576.0;
                let off = (got / want).sqrt() - 1.0;
                // A streak leaves less to make up for in the disc.
                let limit = if streak == [0.0, 0.0] { 1e-2 } else { 1.5e-2 };
                assert!(off.abs() < limit, "{diameter} {streak:?}: {off}");
            }
        }
    }

    #[test]
    fn pictures_are_read_anywhere() {
        let cases = [
            (0, 0.0, [0.25, 0.5], [-5, 1000]),
            (0, 0.0, [1e12 + 0.25, -1e12], [0, 0]),
            (0, 0.0, [-9e15, 3e300], [1, 1]),
            (0, 0.3, [4.0, -7.0], [0, 0]),
            (20, 0.0, [20.0 * 1_000_003.0 + 0.5, 37.0 * 1_000_003.0], [-4, 3]),
        ];
        for (shear, lean, shift, origin) in cases {
            let own = Law { shear, ..law(0.02, &[0.8, 1.6], [1.0, -2.0], (37, 53)) };
            let sheet = Sheet::new(own).unwrap();
            let quarters = |at: f64, period: f64| (4.0 * (at % (1e9 * period))).round() as i64;
            let (down, right) = (quarters(shift[1], 37.0), quarters(shift[0], 53.0));
            let place = |right: i64| (down.rem_euclid(4) as usize, right.rem_euclid(4) as usize);
            let want = [0, 2].map(|half| direct(&sheet, place(right + half)));
            let got =
                picture((75, 1100), origin, &[Layer { lean: (lean, 1.0), ..plain(&sheet, shift) }]);
            for ((y, x), &got) in got.indexed_iter() {
                let halves = (2.0 * lean * y as f64).round() as i64;
                let row = y as i64 + origin[0] - down.div_euclid(4);
                let moved = right.div_euclid(4) + halves.div_euclid(2);
                let col = x as i64 + origin[1] - moved - row.div_euclid(37) * shear as i64;
                let at = (row.rem_euclid(37) as usize, col.rem_euclid(53) as usize);
                let off = (f64::from(got) - want[halves.rem_euclid(2) as usize][at]).abs();
                assert!(off < 0.04, "{shear} {lean} {shift:?} {y} {x}: {off}");
            }
        }
        let sheet = Sheet::new(law(0.02, &[0.8], [0.0; 2], (37, 53))).unwrap();
        for shift in [f64::NAN, f64::INFINITY, 1e308] {
            let (layers, out) = ([plain(&sheet, [shift, 0.0])], &mut Array2::zeros((4, 4)));
            let read = read(out.view_mut(), [0, 0], &layers, None, None, None, &CANCEL);
            assert!(read.unwrap_err().to_string().starts_with("shift"));
        }
        let cancel = Cancel::new();
        cancel.raise();
        assert_eq!(sheet.place(6, &cancel), Err(Error::Cancelled));
    }

    #[test]
    fn flakes_are_poisson_and_split_by_rank() {
        let whole = Sheet::new(law(0.4, &[0.5, 1.0, 1.5], [0.0; 2], (1000, 1000))).unwrap();
        let mut list = flakes(&whole);
        let mut counts = Array2::<f64>::zeros((100, 100));
        list.iter().for_each(|&(y, x, _)| counts[(y / 40, x / 40)] += 1.0);
        assert!((counts.mean().unwrap() / 40.0 - 1.0).abs() < 5.0 / 400_000_f64.sqrt());
        assert!((counts.var(0.0) / 40.0 - 1.0).abs() < 5.0 * (2.0 / 10_000_f64).sqrt());
        for size in 0..3 {
            let share = list.iter().filter(|flake| flake.2 == size).count() as f64 / 400_000.0;
            assert!((share - (5 - 2 * size) as f64 / 9.0).abs() < 5e-3, "{size} {share}");
        }
        let part = |ranks| Sheet::new(Law { ranks, ..whole.law.clone() }).unwrap();
        let parts = [part((0.0, 0.5)), part((0.5, 1.0))];
        let mut both = [flakes(&parts[0]), flakes(&parts[1])].concat();
        assert!((flakes(&parts[0]).len() as f64 / 200_000.0 - 1.0).abs() < 0.02);
        list.sort_unstable();
        both.sort_unstable();
        assert_eq!(list, both);
    }
}
