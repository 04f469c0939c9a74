//! Patterns of a population: optical depths of its flakes, at each place within a pixel.
//!
//! A flake below a pixel has waves beyond half a cycle. Pixels show them as longer ones, and these turn
//! the wrong way when a pattern is moved by a part of a pixel: the flake rings. So flakes are drawn on
//! a grid of [`FINE`] samples a pixel, and a pattern is made for each place (x, y) of that grid within
//! a pixel, by what pixels show of flakes that are moved by x / FINE, y / FINE. A frame takes the
//! nearest place, at most an eighth of a pixel off, and moves it by whole pixels.
//!
//! The torus has the lattice (M, 0), (h, M) of whole pixels, so that it is one of pixels and of the
//! grid alike. Flakes lie on the grid: the tile's own shift, any number, moves them all between pixels.

use std::f64::consts::TAU;
use std::sync::Arc;

use flurries_fft::Fft;
use ndarray::{ArrayViewMut3, ArrayViewMut5, Axis};
use num_complex::Complex;

use super::footprint::{FINE, Footprint};
use super::pattern::{LOOK, PLACES, flakes_of, golden, quantile};
use crate::base::error::{Cancel, Error, collected, spare, zeroed};
use crate::base::pool;
use crate::base::random::Hash;
use crate::base::simd::reproducible;

/// Footprints of a slab: as many diameters.
const SIZES: usize = 32;

/// What the patterns of all slabs share.
#[derive(Debug, Clone, Copy)]
pub struct Law {
    /// M, pixels.
    pub tile: usize,
    /// h of the torus, pixels.
    pub shear: i64,
    /// Of a flake's middle.
    pub opacity: f64,
    /// Shares of the flakes that are shown; those of a smaller share are among them.
    pub amount: f64,
    /// Of the places.
    pub seed: i64,
}

/// A slab of depth of one class of size.
#[derive(Debug, Clone, Copy)]
pub struct Slab<'a> {
    /// Flakes that are drawn in a tile, on average.
    pub drawn: f64,
    /// Flakes that there are: if more, a drawn one stands for several, and differs from the mean by as
    /// much as these do.
    pub count: f64,
    /// What they cover of a tile, square pixels.
    pub coverage: f64,
    /// Quantiles of image diameters at even shares, pixels.
    pub diameters: &'a [f64],
    /// Pixels (x, y) that they move by while the shutter is open.
    pub streak: [f64; 2],
    /// The part of a flake that a pixel shows where the pattern is moved instead, see [`Footprint`].
    pub thin: f64,
}

impl Slab<'_> {
    fn diameter(&self, share: f64) -> f64 {
        let last = self.diameters.len() - 1;
        let at = share * last as f64;
        let low = (at as usize).min(last.saturating_sub(1));
        let (first, second) = (self.diameters[low], self.diameters[(low + 1).min(last)]);
        first + (at - low as f64) * (second - first)
    }
}

/// A slab with the footprints of its sizes.
struct Sized<'a> {
    slab: Slab<'a>,
    footprints: Vec<Footprint>,
}

impl<'a> Sized<'a> {
    fn new(slab: Slab<'a>, opacity: f64) -> Self {
        let (least, most) = (slab.diameter(0.0), slab.diameter(1.0));
        let footprints = (0..SIZES).map(|i| {
            let part = i as f64 / (SIZES - 1) as f64;
            Footprint::new(least + part * (most - least), opacity, slab.streak, slab.thin)
        });
        Self { slab, footprints: footprints.collect() }
    }

    /// The footprint of the flake at a share of the sizes.
    fn of(&self, share: f64) -> &Footprint {
        let (least, most) = (self.slab.diameter(0.0), self.slab.diameter(1.0));
        let part = (self.slab.diameter(share) - least) / (most - least).max(1e-300);
        &self.footprints[((part * (SIZES - 1) as f64).round() as usize).min(SIZES - 1)]
    }

    /// Mean depth of a tile, square pixels: the coverage, and by how much depths are more.
    fn depth(&self) -> f64 {
        let steps = 1024;
        let (mut depth, mut coverage) = (0.0, 0.0);
        for step in 0..steps {
            let made = self.of((f64::from(step) + 0.5) / f64::from(steps));
            depth += made.depth;
            coverage += made.coverage;
        }
        if coverage > 0.0 { self.slab.coverage * depth / coverage } else { 0.0 }
    }
}

/// The grid of a tile, and the transform of what pixels see of it.
struct Torus {
    law: Law,
    grid: Vec<f32>,
    spectrum: Vec<Complex<f32>>,
    line: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
    transform: Arc<dyn Fft<f32>>,
    /// For each row of pixels and column of waves, what the shear turns by.
    turns: Arc<Vec<Complex<f32>>>,
}

/// The turns of [`Torus`], shared by all.
fn turns(law: &Law) -> Vec<Complex<f32>> {
    let (m, half) = (law.tile as i64, law.tile / 2 + 1);
    let turn = |at: usize| {
        let cycles = (law.shear * (at / half) as i64 * (at % half) as i64) % (m * m);
        let (sin, cos) = libm::sincos(TAU * cycles as f64 / (m * m) as f64);
        Complex::new(cos as f32, -sin as f32)
    };
    (0..law.tile * half).map(turn).collect()
}

impl Torus {
    fn new(law: Law, turns: Arc<Vec<Complex<f32>>>) -> Result<Self, Error> {
        let m = law.tile;
        spare(m.saturating_mul(256))?;
        let transform = <f32 as flurries_fft::Transform>::inverse(m, reproducible());
        Ok(Self {
            law,
            grid: zeroed(m * m * FINE * FINE)?,
            spectrum: zeroed(m * (m / 2 + 1))?,
            line: zeroed(m)?,
            scratch: zeroed(transform.get_inplace_scratch_len())?,
            transform,
            turns,
        })
    }

    /// Adds a flake's samples around a place of the grid.
    fn stamp(&mut self, footprint: &Footprint, (x, y): (i64, i64)) {
        let side = (self.law.tile * FINE) as i64;
        let [across, down] = footprint.reach;
        let wide = 2 * across + 1;
        for (row, samples) in (y - down as i64..).zip(footprint.values.chunks_exact(wide)) {
            // What is below comes in above, to the left of it.
            let left = x - across as i64 - row.div_euclid(side) * self.law.shear * FINE as i64;
            let line = &mut self.grid[(row.rem_euclid(side) * side) as usize..][..side as usize];
            let mut at = left.rem_euclid(side) as usize;
            let mut rest = samples;
            while !rest.is_empty() {
                let (head, tail) = rest.split_at(rest.len().min(line.len() - at));
                for (value, sample) in line[at..].iter_mut().zip(head) {
                    *value += sample;
                }
                (at, rest) = (0, tail);
            }
        }
    }

    /// Transforms what pixels see of the grid moved by (i, j) samples: rows, the shear's turns, columns.
    fn transform(&mut self, (i, j): (usize, usize)) {
        let Self { law, grid, spectrum, line, scratch, transform, turns } = self;
        let (m, half) = (law.tile, law.tile / 2 + 1);
        let side = m * FINE;
        for y in 0..m {
            // The row above the first is the last one, to the right.
            let (row, aside) = match (y * FINE).checked_sub(j) {
                Some(row) => (row, 0),
                None => (y * FINE + side - j, law.shear * FINE as i64),
            };
            let first = (aside - i as i64).rem_euclid(side as i64) as usize;
            let samples = &grid[row * side..][..side];
            let seen = samples[first..].iter().step_by(FINE);
            let ahead = seen.len();
            let begin = (first + ahead * FINE) % side;
            let seen = seen.chain(samples[begin..].iter().step_by(FINE));
            for (value, &sample) in line.iter_mut().zip(seen) {
                *value = Complex::new(sample, 0.0);
            }
            transform.process_with_scratch(line, scratch);
            let turns = &turns[y * half..][..half];
            for (a, (value, turn)) in line[..half].iter().zip(turns).enumerate() {
                spectrum[a * m + y] = value * turn;
            }
        }
        for column in spectrum.chunks_exact_mut(m) {
            transform.process_with_scratch(column, scratch);
        }
    }

    /// One pattern, (places, M, M/2 + 1).
    fn pattern(
        &mut self,
        mut out: ArrayViewMut3<'_, Complex<f32>>,
        (slab, depth): (&Sized<'_>, f64),
        hash: Hash,
        all: usize,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let amount = self.law.amount;
        let shown = (amount * all as f64).round() as usize;
        let step = golden(all);
        let side = (self.law.tile * FINE) as f64;
        self.grid.fill(0.0);
        let mut drawn = 0.0;
        for i in 0..shown {
            if i.is_multiple_of(LOOK) {
                cancel.check()?;
            }
            let footprint = slab.of(quantile(i, all, step));
            let place = hash.word(i as i64);
            let at = |word: i64| ((place.word(word).unit() * side) as i64).min(side as i64 - 1);
            self.stamp(footprint, (at(0), at(1)));
            drawn += footprint.depth;
        }
        let mean = amount * depth;
        // A flake that stands for n differs from the mean by what n flakes do.
        let several = (slab.slab.drawn / slab.slab.count.max(1e-300)).sqrt();
        let scale = if drawn > 0.0 { (mean / drawn * several) as f32 } else { 0.0 };
        let side = if out.dim().0 == 1 { 1 } else { FINE };
        let tile = self.law.tile;
        for (index, mut out) in out.outer_iter_mut().enumerate() {
            self.transform((index % side, index / side));
            for ((b, a), value) in out.indexed_iter_mut() {
                let half_wave = 2 * a == tile || 2 * b == tile;
                let kept = if half_wave { 0.0 } else { scale };
                *value = self.spectrum[a * tile + b].conj() * kept;
            }
            out[(0, 0)] = Complex::new(mean as f32, 0.0);
        }
        Ok(())
    }
}

/// Fills `out` (L, P, places, M, M/2 + 1), places 1 or FINE^2, and returns the mean depth of a tile of
/// each slab in square pixels, where all flakes are shown.
pub fn population(
    out: ArrayViewMut5<'_, Complex<f32>>,
    slabs: &[Slab<'_>],
    law: Law,
    cancel: &Cancel,
) -> Result<Vec<f64>, Error> {
    let (layers, number, places, rows, cols) = out.dim();
    let fits =
        (rows, cols) == (law.tile, law.tile / 2 + 1) && (places == 1 || places == FINE * FINE);
    if layers != slabs.len() || !fits || slabs.iter().any(|slab| slab.diameters.is_empty()) {
        return Err(Error::invalid("out", "must be (slabs, patterns, 1 or 16, M, M/2 + 1)"));
    }
    let mut sized: Vec<Option<(Sized<'_>, f64)>> = slabs.iter().map(|_| None).collect();
    pool::for_each(sized.iter_mut().zip(slabs), |(sized, slab)| {
        cancel.check()?;
        let found = Sized::new(*slab, law.opacity);
        let depth = found.depth();
        *sized = Some((found, depth));
        Ok(())
    })?;
    let sized: Vec<(Sized<'_>, f64)> = sized.into_iter().flatten().collect();
    let turns = Arc::new(turns(&law));
    let mut planes = out
        .into_shape_with_order((layers * number, places, rows, cols))
        .map_err(|_| Error::Internal("patterns are not contiguous".into()))?;
    let mut tasks = collected(planes.axis_iter_mut(Axis(0)).enumerate())?;
    // Runs of tasks share their buffers; what a pattern holds does not depend on the split.
    let each = tasks.len().div_ceil(4 * pool::threads()).max(1);
    let mut runs = Vec::new();
    while !tasks.is_empty() {
        let rest = tasks.split_off(each.min(tasks.len()));
        runs.push(std::mem::replace(&mut tasks, rest));
    }
    pool::for_each(runs, |run| {
        let mut torus = Torus::new(law, Arc::clone(&turns))?;
        for (at, plane) in run {
            let (layer, index) = (at / number, at % number);
            let (slab, depth) = &sized[layer];
            let hash = Hash::seeded(law.seed).word(PLACES).word(layer as i64).word(index as i64);
            let all = flakes_of(slab.slab.drawn, index, number);
            torus.pattern(plane, (slab, *depth), hash, all, cancel)?;
        }
        Ok(())
    })?;
    Ok(sized.iter().map(|(_, depth)| *depth).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array5;

    const LAW: Law = Law { tile: 15, shear: 4, opacity: 0.8, amount: 1.0, seed: 4 };

    fn torus() -> Torus {
        Torus::new(LAW, Arc::new(turns(&LAW))).unwrap()
    }

    /// What a pixel sees of the flake and its images on the lattice, moved by (i, j) samples.
    fn seen(footprint: &Footprint, (x, y): (i64, i64), pixel: (i64, i64)) -> f64 {
        let (wide, [across, down]) = (2 * footprint.reach[0] + 1, footprint.reach);
        let mut sum = 0.0;
        for n in -8..=8 {
            for m in -12..=12 {
                let dx = 4 * pixel.0 - (x + 60 * m + 16 * n) + across as i64;
                let dy = 4 * pixel.1 - (y + 60 * n) + down as i64;
                let inside = dx >= 0 && dy >= 0 && dx < wide as i64 && dy <= 2 * down as i64;
                if inside {
                    sum += f64::from(footprint.values[dy as usize * wide + dx as usize]);
                }
            }
        }
        sum
    }

    #[test]
    fn a_place_is_what_pixels_see_there() {
        for (diameter, streak, at) in
            [(0.5, [0.0, 0.0], (59, 1)), (2.5, [3.0, 4.0], (2, 58)), (9.0, [0.0, 0.0], (20, 20))]
        {
            let footprint = Footprint::new(diameter, 0.8, streak, 1.0);
            let mut torus = torus();
            torus.stamp(&footprint, at);
            for place in [(0, 0), (2, 0), (0, 1), (1, 2)] {
                torus.transform(place);
                let moved = (at.0 + place.0 as i64, at.1 + place.1 as i64);
                let m = LAW.tile as i64;
                for (a, b) in [(0, 0), (1, 0), (3, 5), (7, 14), (6, 8)] {
                    let mut want = Complex::new(0.0, 0.0);
                    for (y, x) in (0..m).flat_map(|y| (0..m).map(move |x| (y, x))) {
                        let along = (b as f64 - LAW.shear as f64 * a as f64 / m as f64) * y as f64;
                        let turns = (a as f64 * x as f64 + along) / m as f64;
                        let (sin, cos) = (TAU * turns).sin_cos();
                        want += Complex::new(cos, -sin) * seen(&footprint, moved, (x, y));
                    }
                    let got = torus.spectrum[a * LAW.tile + b].conj();
                    let got = Complex::new(f64::from(got.re), f64::from(got.im));
                    assert!((got - want).norm() < 1e-5 * (1.0 + want.norm()), "{got} {want}");
                }
            }
        }
    }

    #[test]
    fn every_pattern_has_the_mean_of_its_flakes() {
        let sizes = [0.4, 0.7, 2.0];
        let slab = Slab {
            drawn: 20.5,
            count: 20.5,
            coverage: 9.0,
            diameters: &sizes,
            streak: [0.0, 1.0],
            thin: 1.0,
        };
        let mut out = Array5::<Complex<f32>>::zeros((1, 3, 16, 15, 8));
        let depth = population(out.view_mut(), &[slab], LAW, &Cancel::new()).unwrap()[0];
        assert!(depth > 9.0 && depth < 14.0);
        for pattern in 0..3 {
            for place in 0..16 {
                assert_eq!(out[(0, pattern, place, 0, 0)], Complex::new(depth as f32, 0.0));
            }
        }
        let mut half = Array5::<Complex<f32>>::zeros((1, 3, 16, 15, 8));
        let law = Law { amount: 0.5, ..LAW };
        let same = population(half.view_mut(), &[slab], law, &Cancel::new()).unwrap()[0];
        assert!((depth - same).abs() < 1e-12);
        assert_eq!(half[(0, 1, 4, 0, 0)].re, (0.5 * depth) as f32);
        let bad = population(out.view_mut(), &[], LAW, &Cancel::new());
        assert!(bad.is_err());
    }
}
