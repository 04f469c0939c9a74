//! The opacity of a bank of gas: slices whose density is known on a coarse grid.
//!
//! Pixels follow from the three coarse samples around them on each axis by the quadratic spline, which
//! has no corners for ghosts of the grid to stick to.

use ndarray::{Array3, ArrayView2, ArrayView3, ArrayViewMut2, Axis};

use crate::base::error::{Cancel, Error, collected, layout, pushed, zeroed};
use crate::base::lamps::left;
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
    /// Short waves (H, W) of the logarithm of all slices' densities, and their strength in one: where several
    /// show, the waves that they share stand for as many of their own.
    pub detail: Option<(ArrayView2<'a, f32>, f32)>,
}

impl Slices<'_> {
    /// Refuses slices that do not fit a picture (H, W).
    pub fn check(&self, (height, width): (usize, usize)) -> Result<(), Error> {
        let (count, rows, columns) = self.density.dim();
        let room = |side: usize| side.div_ceil(COARSE) + 2 * MARGIN;
        let fits = (rows, columns) == (room(height), room(width))
            && self.edges.len() == count + 1
            && self.ground.is_none_or(|ground| ground.dim() == (height, width))
            && self.detail.is_none_or(|(waves, _)| waves.dim() == (height, width))
            && (self.slopes.0.len(), self.slopes.1.len()) == (width, height);
        if fits && self.density.is_standard_layout() {
            return Ok(());
        }
        Err(Error::Internal("slices of gas do not fit the picture".into()))
    }

    /// Where nothing ends them the sum of their optical depths on the coarse grid, and that of the squares.
    fn whole(&self) -> Result<Array3<f32>, Error> {
        let (_, rows, columns) = self.density.dim();
        let room = zeroed(2 * rows * columns)?;
        let mut whole = Array3::from_shape_vec((2, rows, columns), room).map_err(|_| layout())?;
        let (mut sum, mut squares) = whole.view_mut().split_at(Axis(0), 1);
        for (plane, edges) in self.density.axis_chunks_iter(Axis(0), 1).zip(self.edges.windows(2)) {
            sum.zip_mut_with(&plane, |sum, dense| *sum += dense * (edges[1] - edges[0]));
            squares
                .zip_mut_with(&plane, |sum, dense| *sum += (dense * (edges[1] - edges[0])).powi(2));
        }
        Ok(whole)
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

/// Writes the opacity of groups of slices to `out` (H, W).
pub fn hide(
    mut out: ArrayViewMut2<'_, f32>,
    groups: &[Slices<'_>],
    cancel: &Cancel,
) -> Result<(), Error> {
    let (mut coarse, mut columns) = (Vec::new(), 0);
    for slices in groups {
        slices.check(out.dim())?;
        // Only slices that something ends ask for squares of their own.
        let squares = slices.ground.map(|_| slices.density.iter().map(|dense| dense * dense));
        pushed(&mut coarse, (slices.whole()?, squares.map_or(Ok(Vec::new()), collected)?))?;
        columns = slices.density.dim().2;
    }
    let tasks: Vec<_> = out.axis_chunks_iter_mut(Axis(0), 32).enumerate().collect();
    pool::for_each(tasks, |(number, mut band)| {
        cancel.check()?;
        let (mut line, mut end) = (zeroed::<f32>(columns)?, zeroed::<f32>(columns * COARSE)?);
        let mut sums = [zeroed(columns * COARSE)?, zeroed(columns * COARSE)?];
        for (row, mut out) in band.outer_iter_mut().enumerate() {
            let (row, out) = (32 * number + row, out.as_slice_mut().ok_or_else(layout)?);
            out.fill(0.0);
            for (slices, (whole, squares)) in groups.iter().zip(&coarse) {
                slices.ends(row, &mut end)?;
                let last = slices.edges[slices.density.dim().0];
                // Counted, since a search takes no vectors.
                let cut = end.iter().map(|&end| u32::from(end < last)).sum::<u32>();
                if cut == 0 {
                    lines(&whole.view(), row, &mut line, |line, n| fill(&mut sums[n], line))?;
                } else {
                    let squares = ArrayView3::from_shape(slices.density.dim(), squares);
                    let planes = [slices.density, squares.map_err(|_| layout())?];
                    for (n, planes) in planes.iter().enumerate() {
                        sums[n].fill(0.0);
                        lines(planes, row, &mut line, |line, slice| {
                            spread(&mut sums[n], line, &end, &slices.edges[slice..], n > 0);
                        })?;
                    }
                }
                let (none, down) = (&sums[0][..], slices.slopes.1[row]);
                let waves = slices.detail.map_or(Ok(none), |(waves, _)| pool::line(waves, row))?;
                let waves = (waves, slices.detail.map_or(0.0, |(_, strength)| strength));
                finish(out, &sums, waves, (slices.slopes.0, 1.0 + down * down));
            }
            opacity(out);
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
fn pixels<const LEVEL: u8>(three: &[f32]) -> [f32; COARSE] {
    let mut values = [0.0_f32; COARSE];
    for sample in 0..3 {
        for pixel in 0..COARSE {
            let weight = WEIGHTS[sample][pixel];
            values[pixel] = multiply_add::<f32, LEVEL>(weight, three[sample], values[pixel]);
        }
    }
    values
}

/// Writes the pixels that follow from a line of coarse samples.
#[dispatch]
pub fn fill<const LEVEL: u8>(plane: &mut [f32], line: &[f32]) {
    for (four, three) in plane.as_chunks_mut::<COARSE>().0.iter_mut().zip(line.windows(3)) {
        *four = pixels::<LEVEL>(three);
    }
}

/// Adds the pixels that follow from a line of coarse samples, times the part of the slice that they see or its square.
#[dispatch]
fn spread<const LEVEL: u8>(
    sum: &mut [f32],
    line: &[f32],
    end: &[f32],
    edges: &[f32],
    squared: bool,
) {
    let thick = edges[1] - edges[0];
    let cells = sum.as_chunks_mut::<COARSE>().0.iter_mut().zip(end.as_chunks::<COARSE>().0);
    for ((sum, end), three) in cells.zip(line.windows(3)) {
        let values = pixels::<LEVEL>(three);
        for pixel in 0..COARSE {
            let way = least(most(end[pixel] - edges[0], 0.0), thick);
            let way = if squared { way * way } else { way };
            sum[pixel] = multiply_add::<f32, LEVEL>(values[pixel], way, sum[pixel]);
        }
    }
}

/// Adds a row with its short waves, times the length of its rays.
#[dispatch]
fn finish<const LEVEL: u8>(
    out: &mut [f32],
    sums: &[Vec<f32>; 2],
    waves: (&[f32], f32),
    slopes: (&[f32], f32),
) {
    let pixels = out.iter_mut().zip(&sums[0]).zip(&sums[1]).zip(waves.0).zip(slopes.0);
    for ((((out, &sum), &squares), &wave), &x) in pixels {
        let length = multiply_add::<f32, LEVEL>(x, x, slopes.1).sqrt();
        let dense = most(multiply_add::<f32, LEVEL>(waves.1 * wave, squares.sqrt(), sum), 0.0);
        *out = multiply_add::<f32, LEVEL>(dense, length, *out);
    }
}

#[dispatch]
fn opacity<const LEVEL: u8>(out: &mut [f32]) {
    for out in out {
        *out = 1.0 - left::<f32, LEVEL>(*out);
    }
}
