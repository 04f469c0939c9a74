//! The transform of a narrow band as two small dense products, y then x.
//!
//! A 64 px tile's band fills 16 of 33 columns and 31 of 64 rows of the half spectrum. Multiplying by
//! constant cosine tables, with vector lanes along the contiguous axis and everything in the first
//! cache, takes fewer and faster operations than an FFT, which transforms the zeros too.
//!
//! Pixels are sampled half a pixel off (a phase that the waves carry, see [`Dense::half_pixel`]), so
//! that pixel i and pixel n-1-i share their cosines and have opposite sines. Where n is a multiple of
//! four, pixel n/2-1-i shares them too, but for the sign of the odd k's cosines and of the even k's
//! sines: with sums over even and odd k apart, n/4 sums make n pixels.

use std::f64::consts::TAU;

use super::phases::columns_padded;
use super::waves::Waves;
use crate::error::{Error, zeroed};
use crate::real::Real;
use crate::simd::{AVX2, AVX512, dispatch, multiply_add};

/// Sums that stand together in a table: one AVX-512 register of float32, or two of float64.
const LANES: usize = 16;

/// Cosine and sine tables of a tile and a band.
pub struct Dense<T> {
    tile: (usize, usize),
    // Rows ky = 0 .. half, then 0 .. half downwards, of `stride` columns each.
    half: usize,
    stride: usize,
    down: Tables<T>,
    across: Tables<T>,
}

/// What the sums along one axis are multiplied by.
struct Tables<T> {
    /// How the pixels of the axis share their sums.
    symmetry: Symmetry,
    /// Values of k, made even in number by one more of zeros.
    terms: usize,
    /// Blocks of LANES sums; in a block for each k the cosines, then the sines.
    values: Vec<T>,
}

/// How many pixels a sum makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Symmetry {
    /// Pixels i and n-1-i.
    Halves,
    /// Also n/2-1-i and n/2+i.
    Quarters,
}

impl Symmetry {
    /// The better one for n pixels.
    const fn of(n: usize) -> Self {
        if n % 4 == 0 && padded(n / 4) < padded(n.div_ceil(2)) {
            Self::Quarters
        } else {
            Self::Halves
        }
    }

    /// Sums for n pixels.
    const fn sums(self, n: usize) -> usize {
        match self {
            Self::Halves => n.div_ceil(2),
            Self::Quarters => n / 4,
        }
    }
}

/// n, or one more.
const fn even(n: usize) -> usize {
    n + n % 2
}

const fn padded(n: usize) -> usize {
    n.div_ceil(LANES) * LANES
}

/// Work space: the spectrum folded to what cosines and sines are multiplied by, and the rows of each
/// column between the passes.
pub struct Work<T> {
    cos: Vec<T>,
    sin: Vec<T>,
    between: Vec<T>,
}

impl<T: Real> Tables<T> {
    fn new(n: usize, count: usize, doubled: bool) -> Result<Self, Error> {
        let symmetry = Symmetry::of(n);
        let terms = even(count);
        let sums = symmetry.sums(n);
        let mut values = zeroed(2 * terms * padded(sums))?;
        for i in 0..sums {
            let block = i / LANES * 2 * LANES * terms;
            for k in 0..count {
                let weight = if doubled && k > 0 { 2.0 } else { 1.0 };
                // Reduced as an integer first: exact for any size.
                let turns = ((2 * i + 1) * k % (2 * n)) as f64 / (2 * n) as f64;
                let (sin, cos) = libm::sincos(TAU * turns);
                let at = block + k * 2 * LANES + i % LANES;
                values[at] = T::of(weight * cos);
                values[at + LANES] = T::of(weight * sin);
            }
        }
        Ok(Self { symmetry, terms, values })
    }
}

impl<T: Real> Dense<T> {
    /// Tables for the waves of a tile.
    pub fn new(waves: &Waves) -> Result<Self, Error> {
        let half = waves.reach + 1;
        Ok(Self {
            tile: waves.tile,
            half,
            stride: columns_padded(waves.columns),
            down: Tables::new(waves.tile.0, half, false)?,
            // Columns kx > 0 stand for their mirrors as well.
            across: Tables::new(waves.tile.1, waves.columns, true)?,
        })
    }

    /// Phase in cycles that shifts a wave of index k by half a pixel along an axis of n, to be taken
    /// from its own.
    pub fn half_pixel(k: i64, n: usize) -> f64 {
        0.5 * k as f64 / n as f64
    }

    /// Work space for this transform.
    pub fn work(&self) -> Result<Work<T>, Error> {
        Ok(Work {
            cos: zeroed(2 * self.stride * even(self.half))?,
            sin: zeroed(2 * self.stride * even(self.half))?,
            between: zeroed(2 * self.stride * self.tile.0)?,
        })
    }
}

/// Multiply-adds of both passes for the waves of a tile.
pub fn operations(waves: &Waves) -> f64 {
    let sums = |n: usize| padded(Symmetry::of(n).sums(n)) as f64;
    let columns = columns_padded(waves.columns) as f64;
    4.0 * columns * (waves.reach + 1) as f64 * sums(waves.tile.0)
        + 2.0 * columns * waves.tile.0 as f64 * sums(waves.tile.1)
}

/// Transforms the rows `re` and `im` of a spectrum (its column kx = 0 complete) to `pixels`, row by row.
#[inline(always)]
fn transform_with<T: Real, const LEVEL: u8>(
    dense: &Dense<T>,
    re: &[T],
    im: &[T],
    work: &mut Work<T>,
    pixels: &mut [T],
) {
    let (height, width) = dense.tile;
    let (stride, rows) = (2 * dense.stride, 2 * dense.stride);
    fold(dense, re, im, work);
    let folded = Factors { cos: &work.cos, sin: &work.sin, stride };
    products::<T, LEVEL>(&dense.down, folded, rows, &mut work.between, height);
    let (cos, sin) = work.between.split_at(dense.stride * height);
    let between = Factors { cos, sin, stride: height };
    products::<T, LEVEL>(&dense.across, between, height, pixels, width);
}

/// Folds S(k) and S(-k) of each column into what cosines and sines are multiplied by: for the real
/// part S(k) + S(-k) and i (S(k) - S(-k)), for the imaginary part the same with its sign changed, as
/// the real part of a product wants it.
#[inline(always)]
fn fold<T: Real>(dense: &Dense<T>, re: &[T], im: &[T], work: &mut Work<T>) {
    let (stride, size) = (dense.stride, dense.stride * dense.half);
    let ((re_up, re_down), (im_up, im_down)) = (re.split_at(size), im.split_at(size));
    let up = re_up.chunks_exact(stride).zip(im_up.chunks_exact(stride));
    let down = re_down.chunks_exact(stride).zip(im_down.chunks_exact(stride));
    let folded = work.cos.chunks_exact_mut(2 * stride).zip(work.sin.chunks_exact_mut(2 * stride));
    for ((up, down), (cos, sin)) in up.zip(down).zip(folded) {
        let ((re_up, im_up), (re_down, im_down)) = (up, down);
        let (cos_re, cos_im) = cos.split_at_mut(stride);
        let (sin_re, sin_im) = sin.split_at_mut(stride);
        for k in 0..stride {
            cos_re[k] = re_up[k] + re_down[k];
            cos_im[k] = -(im_up[k] + im_down[k]);
            sin_re[k] = im_down[k] - im_up[k];
            sin_im[k] = re_down[k] - re_up[k];
        }
    }
}

/// What the tables are multiplied by: for each k `stride` values, one for each row of sums.
#[derive(Clone, Copy)]
struct Factors<'a, T> {
    cos: &'a [T],
    sin: &'a [T],
    stride: usize,
}

/// All rows of sums of one pass: `out[row][i] = sum_k cos(k) C(i, k) + sin(k) S(i, k)`.
#[inline(always)]
fn products<T: Real, const LEVEL: u8>(
    tables: &Tables<T>,
    factors: Factors<'_, T>,
    rows: usize,
    out: &mut [T],
    length: usize,
) {
    // Rows and sums made at once: as many as the registers hold, with their four accumulators each.
    // The bits are the same for all.
    match (LEVEL, size_of::<T>()) {
        (AVX512, 4) => each_row::<T, 4, 16, LEVEL>(tables, factors, rows, out, length),
        (AVX512, _) => each_row::<T, 2, 8, LEVEL>(tables, factors, rows, out, length),
        (AVX2, 4) => each_row::<T, 2, 8, LEVEL>(tables, factors, rows, out, length),
        (AVX2, _) => each_row::<T, 2, 4, LEVEL>(tables, factors, rows, out, length),
        (_, 4) => each_row::<T, 2, 4, LEVEL>(tables, factors, rows, out, length),
        _ => each_row::<T, 2, 2, LEVEL>(tables, factors, rows, out, length),
    }
}

#[inline(always)]
fn each_row<T: Real, const ROWS: usize, const WIDE: usize, const LEVEL: u8>(
    tables: &Tables<T>,
    factors: Factors<'_, T>,
    rows: usize,
    out: &mut [T],
    length: usize,
) {
    if rows < ROWS {
        for row in 0..rows {
            sums::<T, 1, WIDE, LEVEL>(tables, factors, row, out, length);
        }
        return;
    }
    for row in (0..rows).step_by(ROWS) {
        // The last rows may be made twice: the same sums, so the same bits.
        sums::<T, ROWS, WIDE, LEVEL>(tables, factors, row.min(rows - ROWS), out, length);
    }
}

#[inline(always)]
fn sums<T: Real, const ROWS: usize, const WIDE: usize, const LEVEL: u8>(
    tables: &Tables<T>,
    factors: Factors<'_, T>,
    first: usize,
    out: &mut [T],
    length: usize,
) {
    let (terms, stride) = (tables.terms, factors.stride);
    let size = 2 * LANES * terms;
    let count = tables.symmetry.sums(length);
    let (cos, sin) = (factors.cos, factors.sin);
    // What the reads below rely on.
    assert!(first + ROWS <= stride && terms * stride <= cos.len().min(sin.len()));
    for (index, block) in tables.values.chunks_exact(size).enumerate() {
        for part in 0..LANES / WIDE {
            let start = index * LANES + part * WIDE;
            if start >= count {
                return;
            }
            // Cosines and sines, of even k and of odd k.
            let mut cos_even = [[T::zero(); WIDE]; ROWS];
            let mut sin_even = [[T::zero(); WIDE]; ROWS];
            let mut cos_odd = [[T::zero(); WIDE]; ROWS];
            let mut sin_odd = [[T::zero(); WIDE]; ROWS];
            for k in (0..terms).step_by(2) {
                for row in 0..ROWS {
                    let at = k * stride + first + row;
                    for i in 0..WIDE {
                        let table = k * 2 * LANES + part * WIDE + i;
                        // SAFETY: `terms` is even, so k + 1 < terms; a block has 2 LANES values for
                        // each term, and the factors `stride` ones, by the assertion above.
                        unsafe {
                            let (c, s) = (*cos.get_unchecked(at), *sin.get_unchecked(at));
                            let even =
                                (*block.get_unchecked(table), *block.get_unchecked(table + LANES));
                            let odd = (
                                *block.get_unchecked(table + 2 * LANES),
                                *block.get_unchecked(table + 3 * LANES),
                            );
                            cos_even[row][i] =
                                multiply_add::<T, LEVEL>(c, even.0, cos_even[row][i]);
                            sin_even[row][i] =
                                multiply_add::<T, LEVEL>(s, even.1, sin_even[row][i]);
                            let at = at + stride;
                            let (c, s) = (*cos.get_unchecked(at), *sin.get_unchecked(at));
                            cos_odd[row][i] = multiply_add::<T, LEVEL>(c, odd.0, cos_odd[row][i]);
                            sin_odd[row][i] = multiply_add::<T, LEVEL>(s, odd.1, sin_odd[row][i]);
                        }
                    }
                }
            }
            // Whole vectors are the usual case, and take no loop with an end of its own.
            let whole = count - start >= WIDE;
            for row in 0..ROWS {
                let line = &mut out[(first + row) * length..(first + row + 1) * length];
                let sums = [cos_even[row], sin_even[row], cos_odd[row], sin_odd[row]];
                match (tables.symmetry, whole) {
                    (Symmetry::Quarters, true) => quarters::<T, WIDE>(&sums, start, WIDE, line),
                    (Symmetry::Quarters, false) => quarters(&sums, start, count - start, line),
                    (Symmetry::Halves, true) => halves::<T, WIDE>(&sums, start, WIDE, line),
                    (Symmetry::Halves, false) => halves(&sums, start, count - start, line),
                }
            }
        }
    }
}

/// The first `count` sums of both parities to the pixels i and n-1-i, from i = `start` on.
#[inline(always)]
fn halves<T: Real, const WIDE: usize>(
    sum: &[[T; WIDE]; 4],
    start: usize,
    count: usize,
    line: &mut [T],
) {
    let (mut low, mut high) = ([T::zero(); WIDE], [T::zero(); WIDE]);
    for i in 0..WIDE {
        let (even, odd) = (sum[0][i] + sum[2][i], sum[1][i] + sum[3][i]);
        low[i] = even + odd;
        high[WIDE - 1 - i] = even - odd;
    }
    let end = line.len() - start;
    line[end - count..end].copy_from_slice(&high[WIDE - count..]);
    // Last, so that the middle of an odd length has its odd part, too.
    line[start..start + count].copy_from_slice(&low[..count]);
}

/// The same to the pixels i, n/2-1-i, n/2+i and n-1-i.
#[inline(always)]
fn quarters<T: Real, const WIDE: usize>(
    sum: &[[T; WIDE]; 4],
    start: usize,
    count: usize,
    line: &mut [T],
) {
    let (mut first, mut second) = ([T::zero(); WIDE], [T::zero(); WIDE]);
    let (mut third, mut fourth) = ([T::zero(); WIDE], [T::zero(); WIDE]);
    for i in 0..WIDE {
        let (even, odd) = (sum[0][i] + sum[2][i], sum[1][i] + sum[3][i]);
        let (even_back, odd_back) = (sum[0][i] - sum[2][i], sum[3][i] - sum[1][i]);
        first[i] = even + odd;
        fourth[WIDE - 1 - i] = even - odd;
        second[WIDE - 1 - i] = even_back + odd_back;
        third[i] = even_back - odd_back;
    }
    let half = line.len() / 2;
    let (low, high) = line.split_at_mut(half);
    low[start..start + count].copy_from_slice(&first[..count]);
    low[half - start - count..half - start].copy_from_slice(&second[WIDE - count..]);
    high[start..start + count].copy_from_slice(&third[..count]);
    let end = high.len() - start;
    high[end - count..end].copy_from_slice(&fourth[WIDE - count..]);
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
    use crate::spectral::phases::Columns;

    #[test]
    fn the_passes_are_the_sum_of_cosines() {
        for (height, width) in
            [(64, 64), (9, 9), (31, 33), (8, 17), (5, 64), (65, 12), (72, 80), (128, 60)]
        {
            let band = Band { shortest: 2.5, longest: 20.0, exponent: 0.5 };
            let waves = Waves::new((height, width), band, &[]).unwrap();
            let dense = Dense::<f64>::new(&waves).unwrap();
            let layout = Columns::new(&waves, |_, _| 0.0).unwrap();
            let mut re = vec![0.0; layout.len()];
            let mut im = vec![0.0; layout.len()];
            let mut direct = vec![0.0; height * width];
            for (i, wave) in waves.list.iter().enumerate() {
                let phase = (0.618 * i as f64).fract();
                let off = Dense::<f64>::half_pixel(wave.ky, height)
                    + Dense::<f64>::half_pixel(wave.kx, width);
                let (sin, cos) = (TAU * (phase - off)).sin_cos();
                let at = layout.place(wave.ky, wave.kx);
                re[at] = wave.amplitude * cos;
                im[at] = wave.amplitude * sin;
                for (at, pixel) in direct.iter_mut().enumerate() {
                    let turns = phase
                        + (at / width) as f64 * wave.ky as f64 / height as f64
                        + (at % width) as f64 * wave.kx as f64 / width as f64;
                    *pixel += 2.0 * wave.amplitude * (TAU * turns).cos();
                }
            }
            layout.mirror(&mut re, &mut im);
            let mut work = dense.work().unwrap();
            let mut pixels = vec![f64::NAN; height * width];
            transform(&dense, &re, &im, &mut work, &mut pixels);
            let worst = pixels.iter().zip(&direct).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            assert!(worst < 2e-13, "{height} x {width}: {worst:e}");
        }
    }
}
