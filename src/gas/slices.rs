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
    /// What ends them, planar depth (H, W).
    pub ground: Option<ArrayView2<'a, f32>>,
    /// Slopes of the rays of columns (W,) and rows (H,).
    pub slopes: (&'a [f32], &'a [f32]),
}

impl Slices<'_> {
    /// Refuses slices that do not fit a picture (H, W).
    pub fn check(&self, (height, width): (usize, usize)) -> Result<(), Error> {
        let (count, rows, columns) = self.density.dim();
        let room = |side: usize| side.div_ceil(COARSE) + 2 * MARGIN;
        let fits = (rows, columns) == (room(height), room(width))
            && self.edges.len() == count + 1
            && self.ground.is_none_or(|ground| ground.dim() == (height, width))
            && (self.slopes.0.len(), self.slopes.1.len()) == (width, height);
        if fits && self.density.is_standard_layout() {
            return Ok(());
        }
        Err(Error::Internal("slices of gas do not fit the picture".into()))
    }

    /// Writes where each pixel of a row ends; nothing ends those beyond the picture's border.
    pub fn ends(&self, row: usize, end: &mut [f32]) -> Result<(), Error> {
        end.fill(f32::INFINITY);
        if let Some(ground) = self.ground {
            end[..ground.ncols()].copy_from_slice(pool::line(ground, row)?);
        }
        Ok(())
    }
}

/// Calls `each` with the coarse line of every plane (n, rows, columns) at a row of pixels, and its number.
pub fn lines(
    planes: &ArrayView3<'_, f32>,
    row: usize,
    line: &mut [f32],
    mut each: impl FnMut(&[f32], usize),
) -> Result<(), Error> {
    let (columns, first) = (line.len(), row / COARSE + MARGIN - 1);
    let weights = WEIGHTS.map(|pixels| pixels[row % COARSE]);
    for (number, plane) in planes.outer_iter().enumerate() {
        let samples = plane.to_slice().ok_or_else(layout)?;
        between(line, &samples[first * columns..(first + 3) * columns], weights);
        each(line, number);
    }
    Ok(())
}

/// Adds their optical depth to `out` (H, W).
///
/// `detail` are short waves (H, W) of the logarithm of all slices' densities, and their strength in one:
/// where several slices show, the waves that they share stand for as many of their own.
pub fn add(
    mut out: ArrayViewMut2<'_, f32>,
    slices: &Slices<'_>,
    detail: Option<(ArrayView2<'_, f32>, f32)>,
    cancel: &Cancel,
) -> Result<(), Error> {
    slices.check(out.dim())?;
    if detail.is_some_and(|(waves, _)| waves.dim() != out.dim()) {
        return Err(Error::Internal("short waves do not fit the picture".into()));
    }
    let columns = slices.density.dim().2;
    let tasks: Vec<_> = out.axis_chunks_iter_mut(Axis(0), 32).enumerate().collect();
    pool::for_each(tasks, |(number, mut band)| {
        cancel.check()?;
        let (mut line, mut end) = (zeroed::<f32>(columns)?, zeroed::<f32>(columns * COARSE)?);
        let (mut sum, mut squares) = (zeroed(columns * COARSE)?, zeroed(columns * COARSE)?);
        for (row, mut out) in band.outer_iter_mut().enumerate() {
            let row = 32 * number + row;
            slices.ends(row, &mut end)?;
            sum.fill(0.0);
            squares.fill(0.0);
            lines(&slices.density, row, &mut line, |line, number| {
                let ends = [slices.edges[number], slices.edges[number + 1]];
                spread(&mut sum, &mut squares, line, &end, ends);
            })?;
            let waves = match detail {
                Some((waves, strength)) => Some((pool::line(waves, row)?, strength)),
                None => None,
            };
            let down = slices.slopes.1[row];
            let slopes = (slices.slopes.0, 1.0 + down * down);
            finish(out.as_slice_mut().ok_or_else(layout)?, (&sum, &squares), waves, slopes);
        }
        Ok(())
    })
}

/// Writes the coarse samples that lie between three lines of them.
#[dispatch]
fn between<const LEVEL: u8>(line: &mut [f32], three: &[f32], weights: [f32; 3]) {
    let columns = line.len();
    let (before, rest) = three.split_at(columns);
    let (at, after) = rest.split_at(columns);
    for (((line, &before), &at), &after) in line.iter_mut().zip(before).zip(at).zip(after) {
        let value = multiply_add::<f32, LEVEL>(weights[1], at, weights[0] * before);
        *line = multiply_add::<f32, LEVEL>(weights[2], after, value);
    }
}

/// The pixels of a coarse sample, of it and its neighbours.
#[inline(always)]
pub fn pixels<const LEVEL: u8>(three: &[f32]) -> [f32; COARSE] {
    let mut values = [0.0_f32; COARSE];
    for sample in 0..3 {
        for pixel in 0..COARSE {
            let weight = WEIGHTS[sample][pixel];
            values[pixel] = multiply_add::<f32, LEVEL>(weight, three[sample], values[pixel]);
        }
    }
    values
}

/// Adds the pixels that follow from a line of coarse samples, times the part of the slice that they see.
#[dispatch]
fn spread<const LEVEL: u8>(
    sum: &mut [f32],
    squares: &mut [f32],
    line: &[f32],
    end: &[f32],
    ends: [f32; 2],
) {
    let thick = ends[1] - ends[0];
    let cells = sum.as_chunks_mut::<COARSE>().0.iter_mut();
    let cells = cells.zip(squares.as_chunks_mut::<COARSE>().0).zip(end.as_chunks::<COARSE>().0);
    for (((sum, squares), end), three) in cells.zip(line.windows(3)) {
        let values = pixels::<LEVEL>(three);
        for pixel in 0..COARSE {
            let optical = values[pixel] * least(most(end[pixel] - ends[0], 0.0), thick);
            sum[pixel] += optical;
            squares[pixel] = multiply_add::<f32, LEVEL>(optical, optical, squares[pixel]);
        }
    }
}

/// Adds a row with its short waves, times the length of its rays.
#[dispatch]
fn finish<const LEVEL: u8>(
    out: &mut [f32],
    sums: (&[f32], &[f32]),
    waves: Option<(&[f32], f32)>,
    slopes: (&[f32], f32),
) {
    let length = |x: f32| multiply_add::<f32, LEVEL>(x, x, slopes.1).sqrt();
    let Some((waves, strength)) = waves else {
        for ((out, &sum), &x) in out.iter_mut().zip(sums.0).zip(slopes.0) {
            *out = multiply_add::<f32, LEVEL>(sum, length(x), *out);
        }
        return;
    };
    let pixels = out.iter_mut().zip(sums.0).zip(sums.1).zip(waves).zip(slopes.0);
    for ((((out, &sum), &squares), &wave), &x) in pixels {
        let dense = most(multiply_add::<f32, LEVEL>(strength * wave, squares.sqrt(), sum), 0.0);
        *out = multiply_add::<f32, LEVEL>(dense, length(x), *out);
    }
}
