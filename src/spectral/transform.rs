//! From amplitudes and phases of all bins to the real field, through half of the spectrum.

use flurries_fft::ComplexToReal;
use ndarray::{ArrayView2, ArrayViewMut2};
use num_complex::Complex;

use super::grid::{position, signed};
use crate::base::error::{Cancel, Error, layout, spare, zeroed};
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::{PORTABLE, reproducible};

/// Refuses a shape whose plans would not find the memory: a planner asks for it without a way to
/// fail. Plans of awkward lengths (Bluestein's) hold ten numbers for each point.
pub fn room_for_plans<T>((height, width): (usize, usize)) -> Result<(), Error> {
    spare(height.saturating_add(width).saturating_mul(16 * size_of::<Complex<T>>()))
}

/// `sum_k amplitude(k) cos 2 pi (f_k . (x, y) + phase(k))` over all bins, for any two arrays.
///
/// Tables need not be symmetric: the sum of cosines is the transform of the Hermitian part
/// (S(k) + conj S(-k)) / 2, which is what is formed here. Columns of zeros are not transformed.
pub fn inverse_transform<T: Real>(
    out: ArrayViewMut2<'_, T>,
    amplitude: ArrayView2<'_, f64>,
    phase: ArrayView2<'_, f64>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (height, width) = out.dim();
    let half = width / 2 + 1;
    let used: Vec<usize> = (0..half)
        .filter(|&col| {
            let mirror = position(-signed(col, width), width);
            (0..height).any(|row| amplitude[(row, col)] != 0.0 || amplitude[(row, mirror)] != 0.0)
        })
        .collect();
    let mut columns = zeroed::<Complex<T>>(used.len() * height)?;
    let plain = reproducible();
    room_for_plans::<T>((height, width))?;
    let rows = T::inverse(height, plain);
    let bin = |row: usize, col: usize| {
        T::turn::<PORTABLE>(T::of(super::grid::reduce(phase[(row, col)])))
            .scale(T::of(amplitude[(row, col)]))
    };
    let tasks = columns.chunks_mut(height).zip(&used);
    pool::for_each(tasks, |(column, &col): (&mut [Complex<T>], &usize)| {
        cancel.check()?;
        let mirror_col = position(-signed(col, width), width);
        for (row, value) in column.iter_mut().enumerate() {
            let mirror_row = position(-signed(row, height), height);
            let sum = bin(row, col) + bin(mirror_row, mirror_col).conj();
            *value = sum.scale(T::of(0.5));
        }
        rows.process_with_scratch(column, &mut zeroed(rows.get_inplace_scratch_len())?);
        Ok(())
    })?;

    let to_real = T::to_real(width, plain);
    pool::for_each(pool::rows(out, pool::threads()), |(run, part)| {
        real_rows(part, run.start, &columns, &used, to_real.as_ref(), cancel)
    })
}

/// Fills `out` with rows of pixels from row `first` on, from the transforms along y of the columns
/// `used`, one after the other.
pub fn real_rows<T: Real>(
    mut out: ArrayViewMut2<'_, T>,
    first: usize,
    columns: &[Complex<T>],
    used: &[usize],
    to_real: &dyn ComplexToReal<T>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let width = out.ncols();
    let mut line = zeroed::<Complex<T>>(width / 2 + 1)?;
    let mut scratch = zeroed(to_real.get_scratch_len())?;
    let height = columns.len() / used.len().max(1);
    for (row, mut pixels) in (first..).zip(out.rows_mut()) {
        cancel.check()?;
        line.fill(Complex::new(T::zero(), T::zero()));
        for (column, &col) in columns.chunks(height.max(1)).zip(used) {
            line[col] = column[row];
        }
        // Imaginary parts that vanish but for rounding.
        line[0].im = T::zero();
        if width.is_multiple_of(2) {
            line[width / 2].im = T::zero();
        }
        let pixels = pixels.as_slice_mut().ok_or_else(layout)?;
        to_real
            .process_with_scratch(&mut line, pixels, &mut scratch)
            .map_err(|error| Error::Internal(error.to_string()))?;
    }
    Ok(())
}
