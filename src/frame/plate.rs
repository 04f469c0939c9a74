//! The mean light of a plate, cell by cell.

use ndarray::{ArrayView3, ArrayViewMut3, Axis};

use super::sample::Sample;
use crate::base::error::{Cancel, Error, layout};
use crate::base::pool;

/// Fills `out` (rows, columns, 4) with the sums of linear light over cells of `cell` pixels, and of
/// what covers them, in each `step`-th of their rows; of integers by a table of their light. Pixels that are not finite do not count.
pub fn cells<S: Sample<Working = f32>>(
    mut out: ArrayViewMut3<'_, f32>,
    picture: ArrayView3<'_, S>,
    table: &[f32],
    (cell, step): (usize, usize),
    cancel: &Cancel,
) -> Result<(), Error> {
    let (height, width, channels) = picture.dim();
    let rows = height.div_ceil(cell.max(1));
    if cell == 0 || out.dim() != (rows, width.div_ceil(cell), 4) || !(3..=4).contains(&channels) {
        return Err(Error::Internal("the cells do not fit the picture".into()));
    }
    let summed = if channels == 3 { summed::<S, 3> } else { summed::<S, 4> };
    let tasks: Vec<_> = out.axis_iter_mut(Axis(0)).enumerate().collect();
    pool::for_each(tasks, |(row, mut sums)| {
        cancel.check()?;
        let sums = sums.as_slice_mut().ok_or_else(layout)?;
        sums.fill(0.0);
        for y in (row * cell..((row + 1) * cell).min(height)).step_by(step.max(1)) {
            let line = picture.index_axis(Axis(0), y).to_slice().ok_or_else(layout)?;
            summed(sums.as_chunks_mut().0, line, cell, table);
        }
        Ok(())
    })
}

/// Adds a row of pixels of so many channels to sums of its cells.
fn summed<S: Sample<Working = f32>, const N: usize>(
    sums: &mut [[f32; 4]],
    line: &[S],
    cell: usize,
    table: &[f32],
) {
    for (sum, pixels) in sums.iter_mut().zip(line.as_chunks::<N>().0.chunks(cell)) {
        let mut found = [0.0_f32; 4];
        for pixel in pixels {
            let cover = if N == 4 { pixel[3].load() / S::SCALE as f32 } else { 1.0 };
            let light = |v: S| if S::INTEGER { table[v.level()] * cover } else { v.load() };
            let rgb = [pixel[0], pixel[1], pixel[2]].map(light);
            if S::INTEGER || rgb.iter().all(|v| v.is_finite()) {
                found = std::array::from_fn(|k| found[k] + if k < 3 { rgb[k] } else { cover });
            }
        }
        *sum = std::array::from_fn(|k| sum[k] + found[k]);
    }
}
