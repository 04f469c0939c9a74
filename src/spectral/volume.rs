//! The 3-D method: a film that repeats, from the cells of its space-time spectrum (Langer 2004,
//! section 5.1; the slides of 2003).
//!
//! `alpha(x, y, t) = sum a(k, n) cos 2 pi (f_k . (x, y) + n t / T + phase(k, n))` over the cells
//! (k, n) on the tent. Few of the M x M x T cells are not zero: the transform along t is their plain
//! sum, exact at any t, and only columns that hold a cell are transformed along y.

use ndarray::{ArrayViewMut2, Axis};
use num_complex::Complex;

use super::band::{Band, Sum};
use super::filter::TemporalFilter;
use super::grid::{leader_phase, position, reduce, tile_hash};
use super::tent::Motion;
use super::transform::{real_rows, room_for_plans};
use super::waves::{Draw, Waves};
use crate::base::error::{Cancel, Error, named, pushed, zeroed};
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::{PORTABLE, reproducible};

/// The word that keeps the phases of cells apart from those of waves and from the jitter's words.
const CELL: i64 = 3;

/// The steepest tent whose cells are listed one by one, cycles per frame: at 1 the fastest waves
/// have wrapped round the temporal axis.
const STEEPEST: f64 = 1.0;

/// Which cells of a column (kx, ky) hold power.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cells {
    /// The one nearest to the tent, half to even.
    One,
    /// All whose unit cube the tent passes through.
    Overlap,
}

impl Cells {
    pub fn named(name: &str) -> Result<Self, Error> {
        named("cells", name, &[("one", Self::One), ("overlap", Self::Overlap)])
    }
}

/// Everything that defines a film that repeats.
#[derive(Debug, Clone, Copy)]
pub struct Volume {
    pub shape: (usize, usize),
    pub frames: usize,
    pub band: Band,
    pub seed: i64,
    pub velocity: Motion,
    pub filter: TemporalFilter,
    pub jitter: bool,
    pub cells: Cells,
}

/// A cell of a leader's column: `amplitude cos 2 pi (n t / T + phase)`, both bins of the pair.
#[derive(Debug, Clone, Copy)]
struct Cell {
    /// Index of the column kx among those in use, and array position of ky.
    column: usize,
    row: usize,
    /// n modulo T.
    turns: f64,
    phase: f64,
    amplitude: f64,
}

pub struct Spectrum {
    shape: (usize, usize),
    frames: f64,
    columns: Vec<usize>,
    cells: Vec<Cell>,
}

impl Volume {
    /// Lists the cells that hold power.
    pub fn spectrum(&self) -> Result<Spectrum, Error> {
        let filter = self.filter.checked()?;
        if self.frames == 0 {
            return Err(Error::invalid("frames", "must be at least 1"));
        }
        let steepest = libm::hypot(self.velocity.drift[0], self.velocity.drift[1]);
        if self.cells == Cells::Overlap && (steepest > STEEPEST || steepest.is_nan()) {
            let message = format!(
                "may turn the longest wave by at most {STEEPEST} cycle per frame with \
                 cells=\"overlap\", got {steepest}"
            );
            return Err(Error::invalid("velocity", message));
        }
        let waves = Waves::new(self.shape, self.band, &[])?;
        let tile = tile_hash(self.seed, 0, 0);
        let draw = Draw::new(self.seed, (0, 0), self.jitter);
        let frames = self.frames as f64;
        let mut columns: Vec<usize> = Vec::new();
        let mut cells = Vec::new();
        let mut squares = Sum::default();
        for wave in &waves.list {
            if columns.last() != Some(&(wave.kx as usize)) {
                columns.push(wave.kx as usize);
            }
            let hash = tile.word(wave.ky).word(wave.kx);
            let direction = if self.jitter {
                draw.direction(wave.ky, wave.kx, self.shape)
            } else {
                wave.direction
            };
            let middle = self.velocity.step(direction, wave.frequency) * frames;
            let range = match self.cells {
                Cells::One => middle.round_ties_even()..=middle.round_ties_even(),
                Cells::Overlap => {
                    let (low, high) = self.rates(wave.ky, wave.kx);
                    // Integers n with n - 1/2 < high and n + 1/2 > low: touching is not passing.
                    (low * frames - 0.5).floor() + 1.0..=(high * frames + 0.5).ceil() - 1.0
                }
            };
            // A fast wave's n is too large to be counted up by ones; its range is one number.
            for step in 0..=(range.end() - range.start()) as u64 {
                let n = range.start() + step as f64;
                let phase = match self.cells {
                    Cells::One => leader_phase(hash),
                    Cells::Overlap => leader_phase(hash.word(CELL).word(n as i64)),
                };
                squares.add(2.0 * wave.amplitude * wave.amplitude);
                let cell = Cell {
                    column: columns.len() - 1,
                    row: position(wave.ky, self.shape.0),
                    // The remainder of a float is exact, however fast the wave.
                    turns: n % frames,
                    phase,
                    amplitude: wave.amplitude * filter.gain(n / frames),
                };
                pushed(&mut cells, cell)?;
            }
        }
        // The squares before the filter sum to 1: it lowers the contrast, as blur does.
        let factor = 1.0 / squares.value().sqrt();
        cells.iter_mut().for_each(|cell| cell.amplitude *= factor);
        Ok(Spectrum { shape: self.shape, frames, columns, cells })
    }

    /// The least and the largest rate over the square of side 1 around a wave's index.
    ///
    /// The rate depends on the direction alone, `-c cos(beta - theta)`: its extremes lie at corners,
    /// or at +-c where the line along the motion cuts the square, which dc is never in.
    fn rates(&self, ky: i64, kx: i64) -> (f64, f64) {
        let (height, width) = (self.shape.0 as f64, self.shape.1 as f64);
        let [a, b] = self.velocity.drift;
        let at = |dy: f64, dx: f64| ((ky as f64 + dy) / height, (kx as f64 + dx) / width);
        let corners = [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)].map(|(y, x)| at(y, x));
        let rate = |(y, x): (f64, f64)| -(a * x + b * y) / (x * x + y * y).sqrt();
        let mut low = corners.map(rate).into_iter().fold(f64::INFINITY, f64::min);
        let mut high = corners.map(rate).into_iter().fold(f64::NEG_INFINITY, f64::max);
        let side = corners.map(|(y, x)| a * y - b * x);
        if side.iter().any(|&s| s > 0.0) && side.iter().any(|&s| s < 0.0) {
            // Every point of the square is within a right angle of its middle.
            let extreme = -libm::hypot(a, b) * (a * at(0.0, 0.0).1 + b * at(0.0, 0.0).0).signum();
            low = low.min(extreme);
            high = high.max(extreme);
        }
        (low, high)
    }
}

impl Spectrum {
    /// How many cells hold power, both of each pair counted.
    pub fn len(&self) -> usize {
        2 * self.cells.len()
    }

    /// Fills `out`, (times H, W), with the film at the given times, one frame below the other.
    pub fn render<T: Real>(
        &self,
        mut out: ArrayViewMut2<'_, T>,
        times: &[f64],
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let (height, width) = self.shape;
        if out.dim() != (times.len() * height, width) {
            return Err(Error::Internal("a film of another shape".into()));
        }
        let each = times.len().div_ceil(pool::threads()).max(1);
        let parts = out.axis_chunks_iter_mut(Axis(0), each * height).zip(times.chunks(each));
        pool::for_each(parts, |(part, times)| self.run(part, times, cancel))
    }

    fn run<T: Real>(
        &self,
        mut out: ArrayViewMut2<'_, T>,
        times: &[f64],
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let (height, width) = self.shape;
        let plain = reproducible();
        room_for_plans::<T>(self.shape)?;
        let (down, across) = (T::inverse(height, plain), T::to_real(width, plain));
        let zero = Complex::new(T::zero(), T::zero());
        let mut columns = zeroed::<Complex<T>>(self.columns.len() * height)?;
        let mut scratch = zeroed(down.get_inplace_scratch_len())?;
        for (&time, frame) in times.iter().zip(out.axis_chunks_iter_mut(Axis(0), height)) {
            cancel.check()?;
            columns.fill(zero);
            self.at(time, &mut columns);
            for column in columns.chunks_mut(height) {
                down.process_with_scratch(column, &mut scratch);
            }
            real_rows(frame, 0, &columns, &self.columns, across.as_ref(), cancel)?;
        }
        Ok(())
    }

    /// The transform along t: adds every cell's value at a time to its column.
    fn at<T: Real>(&self, time: f64, columns: &mut [Complex<T>]) {
        let height = self.shape.0;
        // Exact, so that frame t + T has the bits of frame t.
        let part = time.rem_euclid(self.frames);
        for cell in &self.cells {
            let phase = reduce(cell.phase + reduce(cell.turns * part / self.frames));
            let value = T::turn::<PORTABLE>(T::of(phase)).scale(T::of(cell.amplitude));
            let start = cell.column * height;
            columns[start + cell.row] = columns[start + cell.row] + value;
            if self.columns[cell.column] == 0 {
                let mirror = start + (height - cell.row) % height;
                columns[mirror] = columns[mirror] + value.conj();
            }
        }
    }
}
