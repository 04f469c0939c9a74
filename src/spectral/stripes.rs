//! The tiles of a window, one row of them after another, added to rows of sums that are handed on as
//! soon as no later tile touches them.

use std::ops::Range;

use ndarray::{ArrayViewMut2, Axis};

use super::field::{Ready, Window};
use super::opacity::Opacity;
use super::phases::{Power, TileMotion};
use super::tent::Motion;
use super::tiles::Blend;
use super::waves::Draw;
use crate::aligned::Aligned;
use crate::error::{Cancel, Error, collected, zeroed};
use crate::pool;
use crate::real::Real;
use crate::simd::{dispatch, multiply_add};

/// Sums of the rows that a row of tiles touches: a ring of lines, of which `first` is the tiles' first.
struct Stripe<T> {
    height: usize,
    width: usize,
    stride: usize,
    sums: Aligned<T>,
    first: usize,
    // The first rows, and of the rest the first columns, hold sums already; the others hold what was
    // there before.
    rows: usize,
    cols: usize,
}

impl<T: Real> Stripe<T> {
    fn new(height: usize, width: usize) -> Result<Self, Error> {
        // An odd number of lines of the cache: neighbouring rows don't compete for the same places.
        let stride = (width.div_ceil(LANES) | 1) * LANES;
        let sums = Aligned::zeroed(height * stride)?;
        Ok(Self { height, width, stride, sums, first: 0, rows: 0, cols: 0 })
    }

    /// Sums of the tiles' row y.
    fn row(&self, y: usize) -> &[T] {
        let line = (self.first + y) % self.height;
        &self.sums[line * self.stride..][..self.width]
    }

    /// Runs of the tiles' rows that lie one behind the other, each with its first line.
    fn runs(&self, rows: Range<usize>) -> [(Range<usize>, usize); 2] {
        let turn = (self.height - self.first).clamp(rows.start, rows.end);
        let line = |y: usize| (self.first + y) % self.height;
        [(rows.start..turn, line(rows.start)), (turn..rows.end, line(turn))]
    }

    /// Drops the first `rows` rows.
    fn advance(&mut self, rows: usize) {
        self.first = (self.first + rows) % self.height;
        (self.rows, self.cols) = (self.height - rows, 0);
    }
}

/// What `preserve_mean` adds to a row: of each row of tiles that still touches it, the tiles' values
/// mixed across.
struct Lift<T> {
    // A ring: one line for each row of tiles that can touch a pixel.
    lines: Vec<Vec<T>>,
    row: Vec<T>,
    // The last tile's power and what it lost: the next one's are often the same.
    known: (Power, f64),
}

impl<T: Real> Lift<T> {
    fn new(lines: usize, width: usize) -> Result<Self, Error> {
        let mut all = Vec::new();
        for _ in 0..lines {
            all.push(zeroed(width)?);
        }
        let none = Power { present: f64::NAN, kept: f64::NAN };
        Ok(Self { lines: all, row: zeroed(width)?, known: (none, 0.0) })
    }

    fn line(&mut self, row: usize) -> &mut [T] {
        let count = self.lines.len();
        &mut self.lines[row % count]
    }
}

impl<T: Real> Ready<'_, '_, T> {
    /// Renders the window: `finish(y, field row, lift row, out row)` for every image row y of it.
    ///
    /// `out` has one row per row of the window, of any width that `finish` understands. Each worker
    /// owns a run of rows and adds the tiles that touch it in row-major order, so that the bits of a
    /// pixel depend neither on the threads nor on the window. Tiles across a border between workers
    /// are made by both: fewer than one row of tiles for each worker.
    pub fn render<O: Send>(
        &self,
        window: &Window,
        mut out: ArrayViewMut2<'_, O>,
        lift: Option<&Opacity>,
        cancel: &Cancel,
        finish: impl Fn(usize, &[T], Option<&[T]>, &mut [O]) + Sync + Send,
    ) -> Result<(), Error> {
        let touched = self.down.touching(window.rows.start, window.rows.end);
        let mut tasks = Vec::new();
        for run in pool::split(touched.len(), pool::threads()) {
            let first = touched.start + run.start;
            let last = touched.start + run.end;
            let from = if run.start == 0 { window.rows.start } else { self.down.start(first) };
            let to = if last == touched.end { window.rows.end } else { self.down.start(last) };
            // Many overlapping tiles in a small window: their starts can lie before or behind it.
            let rows = from.clamp(window.rows.start, window.rows.end)
                ..to.clamp(window.rows.start, window.rows.end);
            let (part, rest) = out.split_at(Axis(0), rows.len());
            out = rest;
            if !rows.is_empty() {
                tasks.push((rows, part));
            }
        }
        pool::for_each(tasks, |(rows, part)| {
            self.stripes(rows, &window.cols, part, lift, cancel, &finish)
        })
    }

    fn stripes<O>(
        &self,
        rows: Range<usize>,
        cols: &Range<usize>,
        mut out: ArrayViewMut2<'_, O>,
        map: Option<&Opacity>,
        cancel: &Cancel,
        finish: &impl Fn(usize, &[T], Option<&[T]>, &mut [O]),
    ) -> Result<(), Error> {
        let (tile_height, step) = (self.field.tile.0, self.down.step());
        let mut work = TileWork::new(self)?;
        let mut stripe = Stripe::new(tile_height, cols.len())?;
        let mut lift = match map {
            Some(map) => Some((*map, Lift::new(tile_height.div_ceil(step), cols.len())?)),
            None => None,
        };
        // Weights sum to 1, so that what all tiles have alike is the mix of it.
        let alike = self.field.tiles_alike();
        let touching = self.down.touching(rows.start, rows.end);
        let mut next = rows.start;
        for row in touching.clone() {
            if let Some((_, lift)) = &mut lift {
                lift.line(row).fill(T::zero());
            }
            for col in self.across.touching(cols.start, cols.end) {
                cancel.check()?;
                let power = work.render(self, (row, col))?;
                let tile = Tile::new(self, (row, col), cols);
                tile.add(&mut stripe, work.pixels());
                if let Some((map, lift)) = &mut lift {
                    if power != lift.known.0 {
                        lift.known = (power, lost_mean(map, power));
                        if alike {
                            lift.row.fill(T::of(lift.known.1));
                        }
                    }
                    if !alike {
                        tile.lift(lift.known.1, lift.line(row));
                    }
                }
            }
            // Rows before the next tile's start are finished.
            let start = self.down.start(row);
            let last = row + 1 == touching.end;
            let end = if last { rows.end } else { (start + step).min(rows.end) };
            for y in next..end {
                let mut line = out.row_mut(y - rows.start);
                let line = line.as_slice_mut().ok_or_else(|| Error::Internal("layout".into()))?;
                let lift = match &mut lift {
                    Some((_, lift)) if alike => Some(&lift.row[..]),
                    Some((_, lift)) => Some(self.lift_row(y, touching.start, row, lift)),
                    None => None,
                };
                finish(y, stripe.row(y - start), lift, line);
            }
            next = next.max(end);
            stripe.advance(step);
        }
        Ok(())
    }

    /// What is added to image row y, from the rows of tiles `first` to `last`.
    fn lift_row<'l>(&self, y: usize, first: usize, last: usize, lift: &'l mut Lift<T>) -> &'l [T] {
        let Lift { lines, row: sum, .. } = lift;
        sum.fill(T::zero());
        for row in self.down.touching(y, y + 1) {
            if row < first || row > last {
                continue;
            }
            let weight = self.parts.weights.0[row * self.field.tile.0 + y - self.down.start(row)];
            let weight = self.mean_weight(weight);
            for (sum, &value) in sum.iter_mut().zip(&lines[row % lines.len()]) {
                *sum += weight * value;
            }
        }
        sum
    }

    /// Means mix with weights that sum to 1: the squares, in the power law.
    fn mean_weight(&self, weight: T) -> T {
        if self.field.blend == Blend::Linear { weight } else { weight * weight }
    }
}

/// One worker's buffers, and the way from a tile's place to its pixels.
struct TileWork<T: Real> {
    place: Vec<Motion>,
    rate: Vec<Motion>,
    scratch: super::tile::Scratch<T>,
}

impl<T: Real> TileWork<T> {
    fn new(ready: &Ready<'_, '_, T>) -> Result<Self, Error> {
        let rings = ready.field.rings();
        let still = || collected((0..rings).map(|_| Motion { drift: [0.0; 2], shift: [0.0; 2] }));
        Ok(Self { place: still()?, rate: still()?, scratch: ready.parts.plan.scratch()? })
    }

    fn render(&mut self, ready: &Ready<'_, '_, T>, at: (usize, usize)) -> Result<Power, Error> {
        let field = ready.field;
        field.motions(field.drift, field.shift, at, &mut self.place);
        field.motions(field.velocity, field.shift_rate, at, &mut self.rate);
        let motion = TileMotion {
            place: &self.place,
            rate: &self.rate,
            filter: field.filter,
            shortest: field.shortest.as_ref().map_or(0.0, |map| map[at]),
        };
        let draw = Draw::new(field.seed, at, field.jitter);
        ready.parts.plan.render(draw, motion, &mut self.scratch)
    }

    fn pixels(&self) -> &[T] {
        self.scratch.pixels()
    }
}

/// The part of a tile that lies in a window.
struct Tile<'r, T> {
    // First column in the tile, and in the window.
    from: usize,
    offset: usize,
    width: usize,
    weights: (&'r [T], &'r [T]),
    squared: bool,
}

impl<'r, T: Real> Tile<'r, T> {
    fn new<'f, 'a>(
        ready: &'r Ready<'f, 'a, T>,
        (row, col): (usize, usize),
        cols: &Range<usize>,
    ) -> Self {
        let (height, width) = ready.field.tile;
        let start = ready.across.start(col);
        // The tile's columns that lie in the window, counted from its own first pixel.
        let from = cols.start.saturating_sub(start);
        let to = (cols.end - start).min(width);
        let weights = &ready.parts.weights;
        Self {
            from,
            offset: start + from - cols.start,
            width,
            weights: (
                &weights.0[row * height..(row + 1) * height],
                &weights.1[col * width..][from..to],
            ),
            squared: ready.field.blend == Blend::Power,
        }
    }

    /// Adds the weighted pixels; where nothing was added yet they are the sum.
    fn add(&self, stripe: &mut Stripe<T>, pixels: &[T]) {
        let (wy, wx) = self.weights;
        let touched = stripe.cols.saturating_sub(self.offset).min(wx.len());
        for (rows, touched) in [(0..stripe.rows, wx.len()), (stripe.rows..wy.len(), touched)] {
            for (rows, line) in stripe.runs(rows) {
                if !rows.is_empty() {
                    let sums = &mut stripe.sums[line * stripe.stride + self.offset..];
                    let pixels = &pixels[rows.start * self.width + self.from..];
                    add_rows(sums, stripe.stride, &wy[rows], wx, pixels, self.width, touched);
                }
            }
        }
        stripe.cols = self.offset + wx.len();
    }

    fn lift(&self, value: f64, line: &mut [T]) {
        // Nothing lost is the common case, and exactly nothing must be added then.
        if value == 0.0 {
            return;
        }
        let value = T::of(value);
        for (sum, &wx) in line[self.offset..].iter_mut().zip(self.weights.1) {
            *sum += value * if self.squared { wx * wx } else { wx };
        }
    }
}

/// Sums that are made at once where old and new ones meet.
const LANES: usize = 16;

/// Adds weighted pixels to the first `touched` sums of each row and sets the others.
#[inline(always)]
fn add_rows_with<T: Real, const LEVEL: u8>(
    sums: &mut [T],
    stride: usize,
    wy: &[T],
    wx: &[T],
    pixels: &[T],
    tile_width: usize,
    touched: usize,
) {
    // Whole vectors up to where none is touched: what a sum held before counts 1 or 0 times.
    let mixed = touched.next_multiple_of(LANES).min(wx.len());
    let (old, edge) = (touched / LANES * LANES, mixed - touched / LANES * LANES);
    let mut kept = [T::zero(); LANES];
    kept[..touched - old].fill(T::one());
    let kept = &kept[..edge];
    for (y, &wy) in wy.iter().enumerate() {
        let sums = &mut sums[y * stride..][..wx.len()];
        let pixels = &pixels[y * tile_width..][..wx.len()];
        let (added, rest) = sums.split_at_mut(old);
        for i in 0..added.len() {
            added[i] = multiply_add::<T, LEVEL>(wy * wx[i], pixels[i], added[i]);
        }
        let (added, set) = rest.split_at_mut(edge);
        let (wx, pixels) = (&wx[old..], &pixels[old..]);
        for i in 0..edge {
            added[i] = multiply_add::<T, LEVEL>(wy * wx[i], pixels[i], kept[i] * added[i]);
        }
        let (wx, pixels) = (&wx[edge..], &pixels[edge..]);
        let runs = wx.chunks_exact(LANES).zip(pixels.chunks_exact(LANES));
        let mut sums = set.chunks_exact_mut(LANES);
        for ((wx, pixels), sums) in runs.zip(&mut sums) {
            for i in 0..LANES {
                sums[i] = wy * wx[i] * pixels[i];
            }
        }
        let rest = sums.into_remainder();
        let done = wx.len() - rest.len();
        for (sum, (&wx, &pixel)) in rest.iter_mut().zip(wx[done..].iter().zip(&pixels[done..])) {
            *sum = wy * wx * pixel;
        }
    }
}

dispatch! {
    fn add_rows<T: Real>(
        sums: &mut [T],
        stride: usize,
        wy: &[T],
        wx: &[T],
        pixels: &[T],
        tile_width: usize,
        touched: usize,
    ) = add_rows_with
}

/// The mean opacity that the filter took from a tile.
fn lost_mean(map: &Opacity, power: Power) -> f64 {
    if power.kept == power.present {
        return 0.0;
    }
    map.mean_of(power.present) - map.mean_of(power.kept)
}
