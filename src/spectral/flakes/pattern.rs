//! Patterns: the Fourier transform of flakes at random places of a torus.
//!
//! A flake is a Gaussian whose integral is opacity * pi d^2 / 4 for an image of diameter d, averaged
//! over each pixel's square. Flakes are drawn into a tile of the sheared torus, round; its transform
//! has the pixels' statistics, and moved by phases it keeps them.

use std::f64::consts::{FRAC_PI_4, TAU};
use std::sync::Arc;

use flurries_fft::Fft;
use ndarray::{ArrayView2, ArrayViewMut2, ArrayViewMut4};
use num_complex::Complex;

use crate::base::error::{Cancel, Error, layout, spare, zeroed};
use crate::base::pixel::LEAST_SIGMA;
use crate::base::pool;
use crate::base::random::Hash;
use crate::base::real::Real;
use crate::base::simd::reproducible;

/// What the numbers of a seed are for.
const PLACES: i64 = 0x666c_616b_6530;

/// Deviations that a sprite reaches: beyond lies less than float64 holds of it.
const REACH: f64 = 8.3;

/// Flakes between two looks at the flag that ends a long drawing.
const LOOK: usize = 1024;

/// What the patterns of all layers share.
#[derive(Debug, Clone, Copy)]
pub struct Law {
    /// M, pixels.
    pub tile: usize,
    /// h / M of the torus.
    pub shear: f64,
    pub opacity: f64,
    pub seed: i64,
}

#[derive(Debug, Clone, Copy)]
pub struct Layer {
    /// Its number, for the hash.
    pub index: usize,
    /// Mean number of flakes in a tile.
    pub count: f64,
    /// Image diameters lie evenly between these, pixels.
    pub diameters: (f64, f64),
}

impl Layer {
    /// Mean coverage of a tile, square pixels.
    pub fn coverage(&self, opacity: f64) -> f64 {
        let (a, b) = self.diameters;
        self.count * opacity * FRAC_PI_4 / 3.0 * (a * a + a * b + b * b)
    }
}

/// Which quantile the flake `i` of `n` has: neighbours differ.
fn quantile(i: usize, n: usize, step: usize) -> f64 {
    ((i as u128 * step as u128 % n as u128) as f64 + 0.5) / n as f64
}

/// A step near the golden section of `n` that meets all of 0 .. n.
fn golden(n: usize) -> usize {
    let shares = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a > 1
    };
    let near = (n as f64 * 0.618_033_988_749_895) as usize;
    (near.max(1)..n).find(|&step| !shares(step, n)).unwrap_or(1)
}

#[derive(Default)]
struct Profile {
    values: Vec<f64>,
}

impl Profile {
    /// Shares of a Gaussian at `center` in pixels of one axis, and the first of these.
    fn fill(&mut self, center: f64, sigma: f64) -> i64 {
        let reach = REACH * sigma + 0.5;
        let (first, last) = ((center - reach).ceil(), (center + reach).floor());
        let scale = std::f64::consts::FRAC_1_SQRT_2 / sigma;
        let upto = |x: f64| 0.5 * libm::erf((x - center) * scale);
        self.values.clear();
        let mut before = upto(first - 0.5);
        let mut x = first;
        while x <= last {
            let after = upto(x + 0.5);
            self.values.push(after - before);
            before = after;
            x += 1.0;
        }
        first as i64
    }

    /// Adds what lies beyond `length` to where it comes back on a torus.
    fn wrap(&mut self, length: usize) {
        for i in length..self.values.len() {
            self.values[i % length] += self.values[i];
        }
        self.values.truncate(length);
    }
}

/// A tile of the torus in pixels, and the transform of its rows and columns.
struct Torus {
    law: Law,
    pixels: Vec<f64>,
    spectrum: Vec<Complex<f64>>,
    line: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
    transform: Arc<dyn Fft<f64>>,
    down: Profile,
    across: Profile,
}

impl Torus {
    fn new(law: Law) -> Result<Self, Error> {
        let m = law.tile;
        spare(m.saturating_mul(256))?;
        let transform = <f64 as flurries_fft::Transform>::inverse(m, reproducible());
        Ok(Self {
            law,
            pixels: zeroed(m * m)?,
            spectrum: zeroed(m * (m / 2 + 1))?,
            line: zeroed(m)?,
            scratch: zeroed(transform.get_inplace_scratch_len())?,
            transform,
            down: Profile::default(),
            across: Profile::default(),
        })
    }

    /// Adds a sprite of the given integral, on the lattice (M, 0), (shear M, M).
    fn draw(&mut self, (x, y): (f64, f64), sigma: f64, integral: f64) {
        let m = self.law.tile as i64;
        let top = self.down.fill(y, sigma);
        let mut turn = i64::MIN;
        let mut left = 0;
        for (row, share) in (top..).zip(&self.down.values) {
            if row.div_euclid(m) != turn {
                turn = row.div_euclid(m);
                left = self.across.fill(x - turn as f64 * self.law.shear * m as f64, sigma);
                self.across.wrap(m as usize);
            }
            let line = &mut self.pixels[(row.rem_euclid(m) * m) as usize..][..m as usize];
            let weight = integral * share;
            let from = left.rem_euclid(m) as usize;
            let ahead = self.across.values.len().min(line.len() - from);
            let (head, tail) = self.across.values.split_at(ahead);
            for (pixel, value) in line[from..].iter_mut().zip(head) {
                *pixel += weight * value;
            }
            for (pixel, value) in line.iter_mut().zip(tail) {
                *pixel += weight * value;
            }
        }
    }

    /// Transforms the pixels: rows, the turn of the shear, columns.
    fn transform(&mut self) {
        let Self { law, pixels, spectrum, line, scratch, transform, .. } = self;
        let (m, half) = (law.tile, law.tile / 2 + 1);
        // An inverse transform of conjugates is the conjugate of a forward one.
        for (y, pixels) in pixels.chunks_exact(m).enumerate() {
            for (value, &pixel) in line.iter_mut().zip(pixels) {
                *value = Complex::new(pixel, 0.0);
            }
            transform.process_with_scratch(line, scratch);
            for (a, value) in line[..half].iter().enumerate() {
                let turns = law.shear * (a * y) as f64 / m as f64;
                let (sin, cos) = libm::sincos(TAU * (turns - turns.round()));
                spectrum[a * m + y] = value * Complex::new(cos, -sin);
            }
        }
        for column in spectrum.chunks_exact_mut(m) {
            transform.process_with_scratch(column, scratch);
        }
    }

    /// One pattern of a layer, (M, M/2 + 1).
    fn pattern<T: Real>(
        &mut self,
        mut out: ArrayViewMut2<'_, Complex<T>>,
        layer: Layer,
        (index, patterns): (usize, usize),
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let Law { tile, opacity, seed, .. } = self.law;
        // Floor or ceil of the count, the mean of all patterns as near to it as whole numbers can be.
        let whole = (layer.count * patterns as f64).round() as u128;
        let upto = |n: usize| whole * n as u128 / patterns as u128;
        let all = (upto(index + 1) - upto(index)) as usize;
        let step = golden(all);
        let hash = Hash::seeded(seed).word(PLACES).word(layer.index as i64).word(index as i64);
        let (least, most) = layer.diameters;
        self.pixels.fill(0.0);
        let mut drawn = 0.0;
        for i in 0..all {
            if i.is_multiple_of(LOOK) {
                cancel.check()?;
            }
            let diameter = least + (most - least) * quantile(i, all, step);
            let integral = opacity * FRAC_PI_4 * diameter * diameter;
            drawn += integral;
            let place = hash.word(i as i64);
            let at = |word: i64| place.word(word).unit() * tile as f64;
            self.draw((at(0), at(1)), (diameter / 8_f64.sqrt()).max(LEAST_SIGMA), integral);
        }
        self.transform();
        // The exact mean: a tile that keeps a few per cent more would be seen in the mean of a film.
        let mean = layer.coverage(opacity);
        let scale = if drawn > 0.0 { mean / drawn } else { 0.0 };
        for ((b, a), value) in out.indexed_iter_mut() {
            let found = self.spectrum[a * tile + b].conj() * scale;
            let half_wave = 2 * a == tile || 2 * b == tile;
            let found = if half_wave { Complex::new(0.0, 0.0) } else { found };
            *value = Complex::new(T::of(found.re), T::of(found.im));
        }
        out[(0, 0)] = Complex::new(T::of(mean), T::zero());
        Ok(())
    }
}

/// Fills `out` (L, P, M, M/2 + 1) with the patterns of layers of `counts` flakes in a tile.
pub fn patterns<T: Real>(
    out: ArrayViewMut4<'_, Complex<T>>,
    counts: &[f64],
    diameters: ArrayView2<'_, f64>,
    law: Law,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (layers, number, rows, cols) = out.dim();
    if (layers, 2) != diameters.dim() || layers != counts.len() {
        return Err(Error::invalid("diameters", "must be two for each of counts"));
    }
    if (rows, cols) != (law.tile, law.tile / 2 + 1) {
        return Err(Error::Internal("patterns have another shape".into()));
    }
    let planes = out.into_shape_with_order((layers * number, rows, cols)).map_err(|_| layout())?;
    // Runs of patterns share their buffers; what a pattern holds does not depend on the split.
    pool::for_each(pool::rows(planes, 4 * pool::threads()), |(run, mut planes)| {
        let mut torus = Torus::new(law)?;
        for (at, plane) in run.zip(planes.outer_iter_mut()) {
            let index = at / number;
            let sizes = (diameters[(index, 0)], diameters[(index, 1)]);
            let layer = Layer { index, count: counts[index], diameters: sizes };
            torus.pattern(plane, layer, (at % number, number), cancel)?;
        }
        Ok(())
    })
}
