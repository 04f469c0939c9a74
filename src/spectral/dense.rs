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

#![expect(unsafe_code, reason = "sums that stay in registers, by `Lanes`")]

use super::cosines::{LANES, Symmetry, Tables, by_sum, even, in_blocks, mirrored, padded};
use super::spectrum::columns_padded;
use super::waves::Waves;
use crate::base::aligned::Aligned;
use crate::base::error::Error;
use crate::base::lanes::Lanes;
use crate::base::real::Real;
use crate::base::simd::{AVX2, AVX512, dispatch};

/// Cosine and sine tables of a tile and a band.
pub struct Dense<T> {
    tile: (usize, usize),
    // Rows ky = 0 .. half, then 0 .. half downwards, of `stride` columns each.
    half: usize,
    stride: usize,
    down: Tables<T>,
    across: Tables<T>,
}

/// Work space: the spectrum folded to what cosines and sines are multiplied by, and the rows of each
/// column between the passes.
pub struct Work<T> {
    pub cos: Aligned<T>,
    pub sin: Aligned<T>,
    between: Aligned<T>,
}

impl<T: Real> Dense<T> {
    pub fn new(waves: &Waves) -> Result<Self, Error> {
        Self::with(waves.tile, waves.reach + 1, waves.columns, columns_padded(waves.columns))
    }

    /// Tables for the waves of a square tile of n px whose indices are below `half`, whole lanes in a row.
    pub fn square(n: usize, half: usize) -> Result<Self, Error> {
        Self::with((n, n), half, half, padded(half))
    }

    fn with(
        tile: (usize, usize),
        half: usize,
        columns: usize,
        stride: usize,
    ) -> Result<Self, Error> {
        let down = Tables::new(tile.0, half, |_| 1.0, by_sum)?;
        let across = Tables::new(tile.1, columns, mirrored, in_blocks)?;
        Ok(Self { tile, half, stride, down, across })
    }

    /// Places of a row of the spectrum.
    pub const fn stride(&self) -> usize {
        self.stride
    }

    /// Phase in cycles that shifts a wave of index k by half a pixel along an axis of n, to be taken
    /// from its own.
    pub fn half_pixel(k: i64, n: usize) -> f64 {
        0.5 * k as f64 / n as f64
    }

    pub fn work(&self) -> Result<Work<T>, Error> {
        Ok(Work {
            cos: Aligned::zeroed(2 * self.stride * even(self.half))?,
            sin: Aligned::zeroed(2 * self.stride * even(self.half))?,
            between: Aligned::zeroed(2 * self.stride * self.tile.0)?,
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
#[dispatch]
pub fn transform<const LEVEL: u8, T: Real>(
    dense: &Dense<T>,
    re: &[T],
    im: &[T],
    work: &mut Work<T>,
    pixels: &mut [T],
) {
    fold(dense, re, im, work);
    passes_on::<T, LEVEL>(dense, work, None, pixels);
}

/// Both passes over what `work` holds folded.
#[inline(always)]
pub fn passes_on<T: Real, const LEVEL: u8>(
    dense: &Dense<T>,
    work: &mut Work<T>,
    turns: Option<&[T]>,
    pixels: &mut [T],
) {
    // As many sums at once as the registers hold, with their four accumulators each. The bits are the
    // same for all.
    match LEVEL {
        AVX512 => passes::<T, T::Avx512, 4>(dense, work, turns, pixels),
        AVX2 => passes::<T, T::Avx2, 2>(dense, work, turns, pixels),
        _ => passes::<T, T::Portable, 2>(dense, work, turns, pixels),
    }
}

/// Multiplies each row of `between`, whose imaginary parts have their signs changed, by cos - i sin:
/// `turns` has a cosine for each place of a row, then sines.
#[inline(always)]
fn turn_rows<T: Real, V: Lanes<T>>(between: &mut [T], turns: &[T], stride: usize) {
    assert!(turns.len() == between.len() && stride.is_multiple_of(V::N));
    for (line, turns) in between.chunks_exact_mut(2 * stride).zip(turns.chunks_exact(2 * stride)) {
        for at in (0..stride).step_by(V::N) {
            // SAFETY: `at` + N is at most `stride`, and both rows have twice as many values.
            unsafe {
                let (cos, sin) = (turns.as_ptr().add(at), turns.as_ptr().add(stride + at));
                let (cos, sin) = (V::load(cos), V::load(sin));
                let (re, im) = (line.as_mut_ptr().add(at), line.as_mut_ptr().add(stride + at));
                let (x, y) = (V::load(re), V::load(im));
                y.product_from(sin, x.mul(cos)).store(re);
                x.multiply_add(sin, y.mul(cos)).store(im);
            }
        }
    }
}

#[inline(always)]
fn passes<T: Real, V: Lanes<T>, const ROWS: usize>(
    dense: &Dense<T>,
    work: &mut Work<T>,
    turns: Option<&[T]>,
    pixels: &mut [T],
) {
    let (sums, rows) = (dense.down.symmetry.sums(dense.tile.0), dense.tile.0);
    // The last ones may be made twice: the same sums, so the same bits.
    for i in (0..sums).step_by(ROWS) {
        if sums < ROWS {
            (0..sums).for_each(|i| down::<T, V, 1>(dense, i, work));
        } else {
            down::<T, V, ROWS>(dense, i.min(sums - ROWS), work);
        }
    }
    if let Some(turns) = turns {
        turn_rows::<T, V>(&mut work.between[..2 * dense.stride * rows], turns, dense.stride);
    }
    let between = &work.between[..];
    for y in (0..rows).step_by(ROWS) {
        if rows < ROWS {
            (0..rows).for_each(|y| across::<T, V, 1>(dense, y, between, pixels));
        } else {
            across::<T, V, ROWS>(dense, y.min(rows - ROWS), between, pixels);
        }
    }
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

/// Sums `first` to `first + ROWS` of the first pass, lanes along the columns, and the rows that they
/// make: `between[y] = sum_k cos[k] C(y, k) + sin[k] S(y, k)`, real parts and then imaginary ones.
#[inline(always)]
fn down<T: Real, V: Lanes<T>, const ROWS: usize>(
    dense: &Dense<T>,
    first: usize,
    work: &mut Work<T>,
) {
    let (n, stride) = (dense.tile.0, 2 * dense.stride);
    let Tables { symmetry, terms, values } = &dense.down;
    let terms = *terms;
    let tables = &values[2 * terms * first..2 * terms * (first + ROWS)];
    let (cos, sin) = (&work.cos[..terms * stride], &work.sin[..terms * stride]);
    let between = &mut work.between[..n * stride];
    // What the reads and writes below rely on; `terms` is even.
    assert!(stride % V::N == 0 && first + ROWS <= symmetry.sums(n) && terms % 2 == 0);
    for start in (0..stride).step_by(V::N) {
        // SAFETY: `start + V::N <= stride`, k and k + 1 are below `terms`, the tables have 2 `terms`
        // values for each of ROWS sums, and i and the places made of it are below n.
        unsafe {
            let mut sums = [Sums::<V>::none(); ROWS];
            for k in (0..terms).step_by(2) {
                let at = k * stride + start;
                let cos = [at, at + stride].map(|at| V::load(cos.as_ptr().add(at)));
                let sin = [at, at + stride].map(|at| V::load(sin.as_ptr().add(at)));
                for (row, sums) in sums.iter_mut().enumerate() {
                    let c = tables.as_ptr().add(2 * terms * row + k);
                    let s = c.add(terms);
                    let cosines = [V::splat(*c), V::splat(*c.add(1))];
                    let sines = [V::splat(*s), V::splat(*s.add(1))];
                    sums.add(cosines, cos, sines, sin);
                }
            }
            for (i, sums) in (first..).zip(sums) {
                let made = sums.pixels();
                let mut line = |y: usize| between.as_mut_ptr().add(y * stride + start);
                made[3].store(line(n - 1 - i));
                if *symmetry == Symmetry::Quarters {
                    made[1].store(line(n / 2 - 1 - i));
                    made[2].store(line(n / 2 + i));
                }
                // Last, so that the middle of an odd length has its odd part, too.
                made[0].store(line(i));
            }
        }
    }
}

/// Sums over k that make up to four pixels each.
#[derive(Clone, Copy)]
struct Sums<V> {
    cos: [V; 2],
    sin: [V; 2],
}

impl<V> Sums<V> {
    #[inline(always)]
    unsafe fn none<T: Real>() -> Self
    where
        V: Lanes<T>,
    {
        // SAFETY: the caller has the instructions.
        let zero = unsafe { V::splat(T::zero()) };
        Self { cos: [zero; 2], sin: [zero; 2] }
    }

    /// Adds an even k's and the next odd one's products.
    #[inline(always)]
    unsafe fn add<T: Real>(&mut self, a: [V; 2], cos: [V; 2], b: [V; 2], sin: [V; 2])
    where
        V: Lanes<T>,
    {
        for parity in 0..2 {
            // SAFETY: the caller has the instructions.
            unsafe {
                self.cos[parity] = a[parity].multiply_add(cos[parity], self.cos[parity]);
                self.sin[parity] = b[parity].multiply_add(sin[parity], self.sin[parity]);
            }
        }
    }

    /// The pixels i, n/2-1-i, n/2+i and n-1-i.
    #[inline(always)]
    unsafe fn pixels<T: Real>(self) -> [V; 4]
    where
        V: Lanes<T>,
    {
        let Self { cos, sin } = self;
        // SAFETY: the caller has the instructions.
        unsafe {
            let (even, odd) = (cos[0].add(cos[1]), sin[0].add(sin[1]));
            let (even_back, odd_back) = (cos[0].sub(cos[1]), sin[1].sub(sin[0]));
            [even.add(odd), even_back.add(odd_back), even_back.sub(odd_back), even.sub(odd)]
        }
    }
}

/// Rows `first` to `first + ROWS` of the second pass, lanes along the rows.
#[inline(always)]
fn across<T: Real, V: Lanes<T>, const ROWS: usize>(
    dense: &Dense<T>,
    first: usize,
    between: &[T],
    pixels: &mut [T],
) {
    let (n, stride) = (dense.tile.1, dense.stride);
    let Tables { symmetry, terms, values } = &dense.across;
    let terms = *terms;
    let count = symmetry.sums(n);
    let between = &between[2 * stride * first..2 * stride * (first + ROWS)];
    let pixels = &mut pixels[n * first..n * (first + ROWS)];
    // What the reads and writes below rely on; `terms` is even.
    assert!(terms <= stride && terms % 2 == 0 && LANES.is_multiple_of(V::N));
    for (index, block) in values.chunks_exact(2 * LANES * terms).enumerate() {
        for part in (0..LANES).step_by(V::N) {
            let start = index * LANES + part;
            if start >= count {
                return;
            }
            // SAFETY: k and k + 1 are below `terms`, a block has 2 LANES values for each, and the rows
            // between the passes twice `stride`; `put` looks after the pixels.
            unsafe {
                let mut sums = [Sums::<V>::none(); ROWS];
                for k in (0..terms).step_by(2) {
                    let table = block.as_ptr().add(2 * LANES * k + part);
                    let cos = [0, 2 * LANES].map(|at| V::load(table.add(at)));
                    let sin = [LANES, 3 * LANES].map(|at| V::load(table.add(at)));
                    for (row, sums) in sums.iter_mut().enumerate() {
                        let c = between.as_ptr().add(2 * stride * row + k);
                        let s = c.add(stride);
                        let factors = [V::splat(*c), V::splat(*c.add(1))];
                        let others = [V::splat(*s), V::splat(*s.add(1))];
                        sums.add(factors, cos, others, sin);
                    }
                }
                for (row, sums) in sums.into_iter().enumerate() {
                    let line = &mut pixels[n * row..n * (row + 1)];
                    put(sums.pixels(), *symmetry, start, count - start, line);
                }
            }
        }
    }
}

/// The first `count` of the pixels made to their places in a row, from i = `start` on.
#[inline(always)]
unsafe fn put<T: Real, V: Lanes<T>>(
    made: [V; 4],
    symmetry: Symmetry,
    start: usize,
    count: usize,
    line: &mut [T],
) {
    let (half, end) = (line.len() / 2, line.len() - start);
    let quarters = symmetry == Symmetry::Quarters;
    if count >= V::N {
        // SAFETY: there are `symmetry.sums(n)` sums, so all of these places are in the row.
        unsafe {
            made[3].reversed().store(line.as_mut_ptr().add(end - V::N));
            if quarters {
                made[1].reversed().store(line.as_mut_ptr().add(half - start - V::N));
                made[2].store(line.as_mut_ptr().add(half + start));
            }
            made[0].store(line.as_mut_ptr().add(start));
        }
        return;
    }
    let mut lanes = [[T::zero(); LANES]; 4];
    for (lanes, made) in lanes.iter_mut().zip(made) {
        // SAFETY: no vector has more than LANES numbers.
        unsafe { made.store(lanes.as_mut_ptr()) };
    }
    put_few(&lanes, quarters, start, count, line);
}

/// The same where a row ends within a vector. Apart, so that the usual case stays short enough for its
/// sums to stay in registers.
#[cold]
#[inline(never)]
fn put_few<T: Real>(
    made: &[[T; LANES]; 4],
    quarters: bool,
    start: usize,
    count: usize,
    line: &mut [T],
) {
    let (half, end) = (line.len() / 2, line.len() - start);
    for i in 0..count {
        line[end - 1 - i] = made[3][i];
        if quarters {
            line[half - 1 - start - i] = made[1][i];
            line[half + start + i] = made[2][i];
        }
        line[start + i] = made[0][i];
    }
}
