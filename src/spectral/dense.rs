//! The transform of a narrow band as two small dense products, y then x.
//!
//! A 64 px tile's band fills 16 of 33 columns and 31 of 64 rows of the half spectrum. Multiplying by
//! constant cosine tables, with vector lanes along the contiguous axis and everything in the first
//! cache, takes fewer and faster operations than an FFT, which transforms the zeros too.
//!
//! Pixels are sampled half a pixel off (a phase that the waves carry, see [`Dense::half_pixel`]), so
//! that row y and row H-1-y share their cosines and have opposite sines: even and odd parts are
//! summed once for both. The same holds across.

use std::f64::consts::TAU;

use super::waves::Waves;
use crate::error::{Error, collected, zeroed};
use crate::real::Real;
use crate::simd::{AVX2, AVX512, dispatch, multiply_add};

/// Lanes that a loop advances by: one AVX-512 register of float32, or two of float64.
pub const LANES: usize = 16;

/// Cosine and sine tables of a tile and a band.
pub struct Dense<T> {
    /// Tile size (rows, cols).
    pub tile: (usize, usize),
    /// Columns kx = 0 .. columns.
    pub columns: usize,
    /// Rows ky = -reach ..= reach.
    pub reach: usize,
    // Half of the tile's rows and columns, rounded up to whole lanes.
    half: (usize, usize),
    // Blocks of LANES pixels; in a block for each k the cosines, then the sines. ky = 1 ..= reach.
    y: Vec<T>,
    // The same for kx = 0 .. columns, doubled for kx > 0, which stand for their mirrors as well.
    x: Vec<T>,
}

/// Work space of the transform: the rows of each column between the passes, and a folded column.
pub struct Work<T> {
    re: Vec<T>,
    im: Vec<T>,
    folded: Vec<[T; 4]>,
}

impl<T: Real> Dense<T> {
    /// Tables for the waves of a tile.
    pub fn new(waves: &Waves) -> Result<Self, Error> {
        let (height, width) = waves.tile;
        let (reach, half) = (reach_of(waves), halves(waves.tile));
        let fill = |run: std::ops::Range<usize>, n: usize, padded: usize, doubled: bool| {
            let mut tables = zeroed(2 * run.len() * padded)?;
            for i in 0..n.div_ceil(2) {
                let block = i / LANES * 2 * LANES * run.len();
                for (row, k) in run.clone().enumerate() {
                    let weight = if doubled && k > 0 { 2.0 } else { 1.0 };
                    // Reduced as an integer first: exact for any size.
                    let turns = ((2 * i + 1) * k % (2 * n)) as f64 / (2 * n) as f64;
                    let (sin, cos) = (TAU * turns).sin_cos();
                    let at = block + row * 2 * LANES + i % LANES;
                    tables[at] = T::of(weight * cos);
                    tables[at + LANES] = T::of(weight * sin);
                }
            }
            Ok(tables)
        };
        Ok(Self {
            tile: waves.tile,
            columns: waves.columns,
            reach,
            half,
            y: fill(1..reach + 1, height, half.0, false)?,
            x: fill(0..waves.columns, width, half.1, true)?,
        })
    }

    /// Entries of the dense spectrum: columns x (2 reach + 1) rows from -reach on.
    pub const fn bins(&self) -> usize {
        self.columns * (2 * self.reach + 1)
    }

    /// Place of a bin in the dense spectrum.
    pub const fn place(&self, ky: i64, kx: i64) -> usize {
        kx as usize * (2 * self.reach + 1) + (ky + self.reach as i64) as usize
    }

    /// Phase in cycles that shifts a wave by half a pixel both ways, to be taken from its own.
    pub fn half_pixel(&self, ky: i64, kx: i64) -> f64 {
        0.5 * (ky as f64 / self.tile.0 as f64 + kx as f64 / self.tile.1 as f64)
    }

    /// Work space for this transform.
    pub fn work(&self) -> Result<Work<T>, Error> {
        let between = self.columns * self.tile.0;
        let folded = collected((0..self.reach).map(|_| [T::zero(); 4]))?;
        Ok(Work { re: zeroed(between)?, im: zeroed(between)?, folded })
    }
}

/// Largest |ky| of the waves.
fn reach_of(waves: &Waves) -> usize {
    waves.list.iter().map(|wave| wave.ky.unsigned_abs() as usize).max().unwrap_or(0)
}

/// Half of the tile's rows and columns, rounded up to whole lanes.
fn halves((height, width): (usize, usize)) -> (usize, usize) {
    let padded = |n: usize| n.div_ceil(2).div_ceil(LANES) * LANES;
    (padded(height), padded(width))
}

/// Multiply-adds of both passes for the waves of a tile.
pub fn operations(waves: &Waves) -> f64 {
    let (down, across) = halves(waves.tile);
    let columns = waves.columns as f64;
    4.0 * columns * (reach_of(waves) * down) as f64 + 2.0 * columns * (waves.tile.0 * across) as f64
}

/// Transforms a dense spectrum (`re`, `im`, the column kx = 0 complete) to `pixels`, row by row.
#[inline(always)]
fn transform_with<T: Real, const LEVEL: u8>(
    dense: &Dense<T>,
    re: &[T],
    im: &[T],
    work: &mut Work<T>,
    pixels: &mut [T],
) {
    let (height, span) = (dense.tile.0, 2 * dense.reach + 1);
    let outputs = work.re.chunks_exact_mut(height).zip(work.im.chunks_exact_mut(height));
    for ((re, im), (out_re, out_im)) in
        re.chunks_exact(span).zip(im.chunks_exact(span)).zip(outputs)
    {
        fold(re, im, &mut work.folded);
        let middle = (re[dense.reach], im[dense.reach]);
        pass_y::<T, LEVEL>(dense, middle, &work.folded, out_re, out_im);
    }
    // Rows made at once: more no longer stay in registers (8 are ten times slower). Same bits.
    match LEVEL {
        AVX2 | AVX512 => pass_x::<T, 4, LEVEL>(dense, &work.re, &work.im, pixels),
        _ => pass_x::<T, 1, LEVEL>(dense, &work.re, &work.im, pixels),
    }
}

/// What the cosines and the sines of a column are multiplied by: S(k) + S(-k) and i (S(k) - S(-k)).
#[inline(always)]
fn fold<T: Real>(re: &[T], im: &[T], folded: &mut [[T; 4]]) {
    let reach = folded.len();
    let (low_re, high_re) = re.split_at(reach);
    let (low_im, high_im) = im.split_at(reach);
    let low = low_re.iter().zip(low_im).rev();
    let high = high_re[1..].iter().zip(&high_im[1..]);
    for (folded, ((&low_re, &low_im), (&high_re, &high_im))) in folded.iter_mut().zip(low.zip(high))
    {
        *folded = [high_re + low_re, high_im + low_im, low_im - high_im, high_re - low_re];
    }
}

/// One column to its rows: `out[y] = sum_ky S(ky) exp 2 pi i ky (y + 1/2) / H`.
#[inline(always)]
fn pass_y<T: Real, const LEVEL: u8>(
    dense: &Dense<T>,
    middle: (T, T),
    folded: &[[T; 4]],
    out_re: &mut [T],
    out_im: &mut [T],
) {
    let block = 2 * LANES * folded.len();
    for index in 0..dense.half.0 / LANES {
        let tables = &dense.y[index * block..(index + 1) * block];
        let (mut even_re, mut even_im) = ([middle.0; LANES], [middle.1; LANES]);
        let (mut odd_re, mut odd_im) = ([T::zero(); LANES], [T::zero(); LANES]);
        for (&[sum_re, sum_im, turn_re, turn_im], table) in
            folded.iter().zip(tables.chunks_exact(2 * LANES))
        {
            for i in 0..LANES {
                let (cos, sin) = (table[i], table[LANES + i]);
                even_re[i] = multiply_add::<T, LEVEL>(sum_re, cos, even_re[i]);
                even_im[i] = multiply_add::<T, LEVEL>(sum_im, cos, even_im[i]);
                odd_re[i] = multiply_add::<T, LEVEL>(turn_re, sin, odd_re[i]);
                odd_im[i] = multiply_add::<T, LEVEL>(turn_im, sin, odd_im[i]);
            }
        }
        mirrored(&even_re, &odd_re, index * LANES, out_re);
        mirrored(&even_im, &odd_im, index * LANES, out_im);
    }
}

/// Writes `even + odd` from `start` on, and `even - odd` to the mirror places, back from the end.
#[inline(always)]
fn mirrored<T: Real>(even: &[T; LANES], odd: &[T; LANES], start: usize, out: &mut [T]) {
    let (mut low, mut high) = ([T::zero(); LANES], [T::zero(); LANES]);
    for i in 0..LANES {
        low[i] = even[i] + odd[i];
        high[LANES - 1 - i] = even[i] - odd[i];
    }
    let length = out.len();
    let count = LANES.min(length.div_ceil(2).saturating_sub(start));
    // The whole block is the usual case and copies as vectors.
    if count == LANES {
        let end = length - start;
        out[end - LANES..end].copy_from_slice(&high);
        out[start..start + LANES].copy_from_slice(&low);
    } else if count > 0 {
        let end = length - start;
        out[end - count..end].copy_from_slice(&high[LANES - count..]);
        // Last, so that the middle of an odd length has its odd part, too.
        out[start..start + count].copy_from_slice(&low[..count]);
    }
}

/// All columns of each row to its pixels: `z[x] = sum_kx Re(G(kx) exp 2 pi i kx (x + 1/2) / W)`.
#[inline(always)]
fn pass_x<T: Real, const ROWS: usize, const LEVEL: u8>(
    dense: &Dense<T>,
    re: &[T],
    im: &[T],
    pixels: &mut [T],
) {
    let (height, width) = dense.tile;
    if height < ROWS {
        for row in 0..height {
            rows_x::<T, 1, LEVEL>(dense, re, im, row, pixels, width);
        }
        return;
    }
    for row in (0..height).step_by(ROWS) {
        // The last rows may be made twice: the same sums, so the same bits.
        rows_x::<T, ROWS, LEVEL>(dense, re, im, row.min(height - ROWS), pixels, width);
    }
}

#[inline(always)]
fn rows_x<T: Real, const ROWS: usize, const LEVEL: u8>(
    dense: &Dense<T>,
    re: &[T],
    im: &[T],
    first: usize,
    pixels: &mut [T],
    width: usize,
) {
    let (height, block) = (dense.tile.0, 2 * LANES * dense.columns);
    for index in 0..dense.half.1 / LANES {
        let tables = &dense.x[index * block..(index + 1) * block];
        let mut even = [[T::zero(); LANES]; ROWS];
        let mut odd = [[T::zero(); LANES]; ROWS];
        let columns = re.chunks_exact(height).zip(im.chunks_exact(height));
        for ((re, im), table) in columns.zip(tables.chunks_exact(2 * LANES)) {
            let (re, im) = (&re[first..first + ROWS], &im[first..first + ROWS]);
            for row in 0..ROWS {
                for i in 0..LANES {
                    // Minus, as the real part of a product has it.
                    even[row][i] = multiply_add::<T, LEVEL>(re[row], table[i], even[row][i]);
                    odd[row][i] = multiply_add::<T, LEVEL>(-im[row], table[LANES + i], odd[row][i]);
                }
            }
        }
        for row in 0..ROWS {
            let line = &mut pixels[(first + row) * width..(first + row + 1) * width];
            mirrored(&even[row], &odd[row], index * LANES, line);
        }
    }
}

dispatch! {
    /// [`transform_with`] on the best instructions.
    pub fn transform<T: Real>(
        dense: &Dense<T>,
        re: &[T],
        im: &[T],
        work: &mut Work<T>,
        pixels: &mut [T],
    ) = transform_with
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectral::band::Band;

    #[test]
    fn the_passes_are_the_sum_of_cosines() {
        for (height, width) in [(64, 64), (9, 9), (31, 33), (8, 17), (5, 64), (65, 12)] {
            let band = Band { shortest: 2.5, longest: 20.0, exponent: 0.5 };
            let waves = Waves::new((height, width), band, &[]).unwrap();
            let dense = Dense::<f64>::new(&waves).unwrap();
            let (mut re, mut im) = (vec![0.0; dense.bins()], vec![0.0; dense.bins()]);
            let mut direct = vec![0.0; height * width];
            for (i, wave) in waves.list.iter().enumerate() {
                let phase = (0.618 * i as f64).fract();
                let (sin, cos) = (TAU * (phase - dense.half_pixel(wave.ky, wave.kx))).sin_cos();
                let (re_, im_) = (wave.amplitude * cos, wave.amplitude * sin);
                re[dense.place(wave.ky, wave.kx)] = re_;
                im[dense.place(wave.ky, wave.kx)] = im_;
                if wave.kx == 0 {
                    re[dense.place(-wave.ky, 0)] = re_;
                    im[dense.place(-wave.ky, 0)] = -im_;
                }
                for (at, pixel) in direct.iter_mut().enumerate() {
                    let turns = phase
                        + (at / width) as f64 * wave.ky as f64 / height as f64
                        + (at % width) as f64 * wave.kx as f64 / width as f64;
                    *pixel += 2.0 * wave.amplitude * (TAU * turns).cos();
                }
            }
            let mut work = dense.work().unwrap();
            let mut pixels = vec![f64::NAN; height * width];
            transform(&dense, &re, &im, &mut work, &mut pixels);
            let worst = pixels.iter().zip(&direct).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            assert!(worst < 2e-13, "{height} x {width}: {worst:e}");
        }
    }
}
