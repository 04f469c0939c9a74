//! The optical depth of a bank of gas: slices whose density is known on a coarse grid.
//!
//! Pixels follow from the three coarse samples around them on each axis by the quadratic spline, which
//! has no corners for ghosts of the grid to stick to.

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut2, Axis};

use crate::base::error::{Cancel, Error, layout, zeroed};
use crate::base::normal::{least, most};
use crate::base::pool;
use crate::base::simd::{dispatch, multiply_add};

/// Pixels to a coarse sample, along each side.
pub const COARSE: usize = 4;

/// Coarse samples beyond the picture on each side.
pub const MARGIN: usize = 1;

/// The spline's weights of the sample before, at and after, for the pixels of a sample.
const WEIGHTS: [[f32; COARSE]; 3] = [
    [0.3828125, 0.1953125, 0.0703125, 0.0078125],
    [0.609375, 0.734375, 0.734375, 0.609375],
    [0.0078125, 0.0703125, 0.1953125, 0.3828125],
];

pub struct Slices<'a> {
    /// Extinction of each on the coarse grid, (slices, rows, columns).
    pub density: ArrayView3<'a, f32>,
    /// Where they begin and end, planar depth; one more than slices.
    pub edges: &'a [f32],
    /// Short waves (H, W) and their strength: the density of all is multiplied by 1 + strength * waves,
    /// no less than 0.
    pub detail: (ArrayView2<'a, f32>, f32),
    /// What ends them, planar depth (H, W).
    pub ground: Option<ArrayView2<'a, f32>>,
    /// Slopes of the rays of columns (W,) and rows (H,); without, planar depth counts.
    pub slopes: Option<(&'a [f32], &'a [f32])>,
}

/// Adds their optical depth to `out` (H, W).
pub fn add(
    mut out: ArrayViewMut2<'_, f32>,
    slices: &Slices<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (height, width) = out.dim();
    let (count, rows, columns) = slices.density.dim();
    let room = |side: usize| side.div_ceil(COARSE) + 2 * MARGIN;
    let fits = (rows, columns) == (room(height), room(width))
        && slices.edges.len() == count + 1
        && slices.detail.0.dim() == (height, width)
        && slices.ground.is_none_or(|ground| ground.dim() == (height, width))
        && slices.slopes.is_none_or(|(x, y)| (x.len(), y.len()) == (width, height));
    if !fits || !slices.density.is_standard_layout() {
        return Err(Error::Internal("slices of gas do not fit the picture".into()));
    }
    let tasks: Vec<_> = out.axis_chunks_iter_mut(Axis(0), 32).enumerate().collect();
    pool::for_each(tasks, |(number, mut band)| {
        cancel.check()?;
        let mut line = zeroed::<f32>(columns)?;
        let (mut sum, mut end) = (zeroed(columns * COARSE)?, zeroed(columns * COARSE)?);
        for (row, mut out) in band.outer_iter_mut().enumerate() {
            let row = 32 * number + row;
            let first = row / COARSE + MARGIN - 1;
            let weights = WEIGHTS.map(|pixels| pixels[row % COARSE]);
            if let Some(ground) = slices.ground {
                end[..width].copy_from_slice(pool::line(ground, row)?);
            }
            line.fill(0.0);
            sum.fill(0.0);
            for (slice, ends) in slices.density.outer_iter().zip(slices.edges.windows(2)) {
                let samples = slice.to_slice().ok_or_else(layout)?;
                let three = &samples[first * columns..(first + 3) * columns];
                let thick = ends[1] - ends[0];
                let scale = if slices.ground.is_none() { thick } else { 1.0 };
                between(&mut line, three, weights.map(|weight| weight * scale));
                if slices.ground.is_some() {
                    spread(&mut sum, &line, Some((&end, ends[0], thick)));
                    line.fill(0.0);
                }
            }
            if slices.ground.is_none() {
                spread(&mut sum, &line, None);
            }
            let detail = (pool::line(slices.detail.0, row)?, slices.detail.1);
            let slopes = slices.slopes.map(|(x, y)| (x, 1.0 + y[row] * y[row]));
            finish(out.as_slice_mut().ok_or_else(layout)?, &sum, detail, slopes);
        }
        Ok(())
    })
}

/// Adds to a line of coarse samples what lies between three of them.
#[dispatch]
fn between<const LEVEL: u8>(line: &mut [f32], three: &[f32], weights: [f32; 3]) {
    let columns = line.len();
    let (before, rest) = three.split_at(columns);
    let (at, after) = rest.split_at(columns);
    for (((line, &before), &at), &after) in line.iter_mut().zip(before).zip(at).zip(after) {
        let value = multiply_add::<f32, LEVEL>(weights[0], before, *line);
        let value = multiply_add::<f32, LEVEL>(weights[1], at, value);
        *line = multiply_add::<f32, LEVEL>(weights[2], after, value);
    }
}

#[inline(always)]
fn pixels<const LEVEL: u8>(three: [f32; 3]) -> [f32; COARSE] {
    let mut values = [0.0_f32; COARSE];
    for sample in 0..3 {
        for pixel in 0..COARSE {
            let weight = WEIGHTS[sample][pixel];
            values[pixel] = multiply_add::<f32, LEVEL>(weight, three[sample], values[pixel]);
        }
    }
    values
}

/// The pixels that follow from a line of coarse samples; before a ground they are added, times the
/// part of the slice before it.
#[dispatch]
fn spread<const LEVEL: u8>(sum: &mut [f32], line: &[f32], ground: Option<(&[f32], f32, f32)>) {
    let (cells, _) = sum.as_chunks_mut::<COARSE>();
    let count = cells.len().min(line.len() - 2);
    let Some((ground, first, thick)) = ground else {
        for (cell, four) in cells[..count].iter_mut().enumerate() {
            *four = pixels::<LEVEL>([line[cell], line[cell + 1], line[cell + 2]]);
        }
        return;
    };
    let (ground, _) = ground.as_chunks::<COARSE>();
    let ground = &ground[..count];
    for (cell, four) in cells[..count].iter_mut().enumerate() {
        let values = pixels::<LEVEL>([line[cell], line[cell + 1], line[cell + 2]]);
        for pixel in 0..COARSE {
            let part = least(most(ground[cell][pixel] - first, 0.0), thick);
            four[pixel] = multiply_add::<f32, LEVEL>(values[pixel], part, four[pixel]);
        }
    }
}

/// Adds a row, times its short waves and the length of its rays.
#[dispatch]
fn finish<const LEVEL: u8>(
    out: &mut [f32],
    sum: &[f32],
    waves: (&[f32], f32),
    slopes: Option<(&[f32], f32)>,
) {
    let (waves, strength) = waves;
    let dense =
        |sum: f32, wave: f32| sum * most(multiply_add::<f32, LEVEL>(strength, wave, 1.0), 0.0);
    let Some((slopes, down)) = slopes else {
        for ((out, &sum), &wave) in out.iter_mut().zip(sum).zip(waves) {
            *out += dense(sum, wave);
        }
        return;
    };
    for (((out, &sum), &wave), &x) in out.iter_mut().zip(sum).zip(waves).zip(slopes) {
        let length = multiply_add::<f32, LEVEL>(x, x, down).sqrt();
        *out = multiply_add::<f32, LEVEL>(dense(sum, wave), length, *out);
    }
}
