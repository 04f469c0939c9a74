//! Light that differs over the picture: the mean light of a plate's cells, a layer whose color lies
//! between cells.

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut3, Axis};

use super::coding::Coding;
use crate::base::error::{Cancel, Error};
use crate::base::pool;
use crate::base::simd::dispatch;

/// What a cell of a plate sums up.
pub trait Light: Copy + Sync + Send {
    /// Linear light times `cover`, by the table of integers; `straight` where that is still to be done.
    fn light(self, table: &[f32], cover: f32) -> f32;
    /// An opacity, 0 to 1.
    fn cover(self) -> f32;
}

macro_rules! integer_light {
    ($integer:ty) => {
        impl Light for $integer {
            #[inline(always)]
            fn light(self, table: &[f32], cover: f32) -> f32 {
                table[usize::from(self)] * cover
            }
            #[inline(always)]
            fn cover(self) -> f32 {
                f32::from(self) / f32::from(<$integer>::MAX)
            }
        }
    };
}
integer_light!(u8);
integer_light!(u16);

impl Light for f32 {
    #[inline(always)]
    fn light(self, _: &[f32], _: f32) -> f32 {
        self
    }
    #[inline(always)]
    fn cover(self) -> f32 {
        self
    }
}

/// Fills `out` (rows, columns, 4) with the sums of linear light over cells of `cell` pixels, and of
/// what covers them. Pixels that are not finite do not count.
pub fn cells<S: Light>(
    mut out: ArrayViewMut3<'_, f32>,
    picture: ArrayView3<'_, S>,
    table: &[f32],
    cell: usize,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (height, width, channels) = picture.dim();
    let rows = height.div_ceil(cell.max(1));
    if cell == 0 || out.dim() != (rows, width.div_ceil(cell), 4) || !(3..=4).contains(&channels) {
        return Err(Error::Internal("the cells do not fit the picture".into()));
    }
    let most = S::cover as fn(S) -> f32;
    let tasks: Vec<_> = out.axis_iter_mut(Axis(0)).enumerate().collect();
    pool::for_each(tasks, |(row, mut sums)| {
        cancel.check()?;
        sums.fill(0.0);
        for y in row * cell..((row + 1) * cell).min(height) {
            let line = picture.index_axis(Axis(0), y);
            for (column, mut sum) in sums.outer_iter_mut().enumerate() {
                let mut found = [0.0_f32; 4];
                for x in column * cell..((column + 1) * cell).min(width) {
                    let cover = if channels == 4 { most(line[[x, 3]]) } else { 1.0 };
                    let rgb: [f32; 3] =
                        std::array::from_fn(|channel| line[[x, channel]].light(table, cover));
                    if rgb.iter().all(|v| v.is_finite()) {
                        (0..3).for_each(|channel| found[channel] += rgb[channel]);
                        found[3] += cover;
                    }
                }
                (0..4).for_each(|channel| sum[channel] += found[channel]);
            }
        }
        Ok(())
    })
}

/// Colors at the middles of cells of a frame.
pub struct Grid<'a> {
    /// (rows, columns, 3), in the light of the mix.
    pub colors: ArrayView3<'a, f32>,
    /// Side of a cell, px.
    pub cell: f64,
    /// The frame's pixel (row, column) that the layer begins at.
    pub first: (usize, usize),
}

/// Pixels between the same two cells: these, and how far each is from the first to the second.
struct Run {
    cells: [usize; 2],
    parts: Vec<f32>,
}

impl Grid<'_> {
    /// The cells before and after a pixel, and its place between them.
    fn between(&self, pixel: usize, count: usize) -> ([usize; 2], f32) {
        let last = count.saturating_sub(1);
        let place = ((pixel as f64 + 0.5) / self.cell - 0.5).clamp(0.0, last as f64);
        let first = place.floor() as usize;
        ([first, (first + 1).min(last)], (place - first as f64) as f32)
    }

    fn across(&self, width: usize) -> Vec<Run> {
        let count = self.colors.dim().1;
        let mut runs: Vec<Run> = Vec::new();
        for x in 0..width {
            let (cells, part) = self.between(self.first.1 + x, count);
            match runs.last_mut() {
                Some(run) if run.cells == cells => run.parts.push(part),
                _ => runs.push(Run { cells, parts: vec![part] }),
            }
        }
        runs
    }

    /// The colors of a row of pixels of the layer.
    fn row(&self, row: usize, across: &[Run], line: &mut Vec<[f32; 3]>, out: &mut [[f32; 3]]) {
        let (rows, columns, _) = self.colors.dim();
        if rows == 1 && columns == 1 && !line.is_empty() {
            // One color: that of the row before.
            return;
        }
        let ([above, below], part) = self.between(self.first.0 + row, rows);
        line.clear();
        line.extend((0..columns).map(|column| {
            std::array::from_fn(|channel| {
                let low = self.colors[[above, column, channel]];
                low + part * (self.colors[[below, column, channel]] - low)
            })
        }));
        let mut rest = out;
        for run in across {
            let (pixels, after) = rest.split_at_mut(run.parts.len());
            blend(pixels, &run.parts, line[run.cells[0]], line[run.cells[1]]);
            rest = after;
        }
    }

    fn check(&self) -> Result<(), Error> {
        let (rows, columns, channels) = self.colors.dim();
        if rows == 0 || columns == 0 || channels != 3 || self.cell.is_nan() || self.cell <= 0.0 {
            return Err(Error::Internal("no grid of colors looks like that".into()));
        }
        Ok(())
    }
}

#[inline(always)]
fn blend_with<const LEVEL: u8>(out: &mut [[f32; 3]], parts: &[f32], low: [f32; 3], high: [f32; 3]) {
    let step = [high[0] - low[0], high[1] - low[1], high[2] - low[2]];
    for (out, &part) in out.iter_mut().zip(parts) {
        for c in 0..3 {
            out[c] = low[c] + part * step[c];
        }
    }
}

dispatch! {
    /// Colors between two.
    fn blend(out: &mut [[f32; 3]], parts: &[f32], low: [f32; 3], high: [f32; 3]) = blend_with
}

/// What is laid over a picture.
pub struct Lit<'a> {
    /// (H, W), 0 to 1.
    pub alpha: ArrayView2<'a, f32>,
    /// Its color.
    pub grid: Grid<'a>,
    /// Light besides, (H, W, 3), already multiplied by opacities.
    pub glow: Option<ArrayView3<'a, f32>>,
}

/// Lays it over a picture of linear light.
pub fn over(
    out: ArrayViewMut3<'_, f32>,
    back: ArrayView3<'_, f32>,
    lit: &Lit<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    laid(out, back, lit, cancel, |out, back, layer| {
        out.copy_from_slice(back);
        layer.over(out);
    })
}

/// Lays it over bytes, in linear light.
pub fn over_bytes(
    out: ArrayViewMut3<'_, u8>,
    back: ArrayView3<'_, u8>,
    lit: &Lit<'_>,
    coding: &Coding<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let tables = coding.tables()?;
    laid(out, back, lit, cancel, |out, back, layer| {
        // A few pixels at a time, which stay in the cache.
        let mut light = [0.0_f32; 3 * PIXELS];
        for (part, (out, back)) in
            out.chunks_mut(3 * PIXELS).zip(back.chunks(3 * PIXELS)).enumerate()
        {
            let light = &mut light[..out.len()];
            tables.decode(light, back);
            let layer = layer.from(part * PIXELS);
            lay_finite(light, layer.alpha, layer.colors, layer.glow);
            tables.encode(out, light);
        }
    })
}

/// Pixels of a row that are read, mixed and written at a time.
const PIXELS: usize = 256;

/// A layer along a row of pixels, or from one of them on.
struct Along<'a> {
    alpha: &'a [f32],
    colors: &'a [[f32; 3]],
    glow: Option<&'a [[f32; 3]]>,
}

impl Along<'_> {
    fn from(&self, x: usize) -> Along<'_> {
        Along {
            alpha: &self.alpha[x..],
            colors: &self.colors[x..],
            glow: self.glow.map(|glow| &glow[x..]),
        }
    }

    /// Lays it over linear light. What nothing lies over keeps its bits.
    fn over(&self, light: &mut [f32]) {
        let (light, _) = light.as_chunks_mut::<3>();
        let pixels = light.iter_mut().zip(self.alpha).zip(self.colors);
        for (x, ((light, &cover), color)) in pixels.enumerate() {
            let more = self.glow.map_or([0.0; 3], |glow| glow[x]);
            if cover == 0.0 && more == [0.0; 3] {
                continue;
            }
            for c in 0..3 {
                // Where it is opaque what is behind may be anything, NaN too.
                let through = if cover == 1.0 { 0.0 } else { (1.0 - cover) * light[c] };
                light[c] = through + (cover * color[c] + more[c]);
            }
        }
    }
}

#[inline(always)]
fn lay_finite_with<const LEVEL: u8>(
    light: &mut [f32],
    alpha: &[f32],
    colors: &[[f32; 3]],
    glow: Option<&[[f32; 3]]>,
) {
    let (light, _) = light.as_chunks_mut::<3>();
    let (alpha, colors) = (&alpha[..light.len()], &colors[..light.len()]);
    if let Some(glow) = glow {
        let glow = &glow[..light.len()];
        for (((light, &cover), color), more) in light.iter_mut().zip(alpha).zip(colors).zip(glow) {
            for c in 0..3 {
                light[c] = (1.0 - cover) * light[c] + (cover * color[c] + more[c]);
            }
        }
        return;
    }
    for ((light, &cover), color) in light.iter_mut().zip(alpha).zip(colors) {
        for c in 0..3 {
            light[c] = (1.0 - cover) * light[c] + cover * color[c];
        }
    }
}

dispatch! {
    /// Lays a layer over light that is finite, with the bits of `Along::over`.
    fn lay_finite(
        light: &mut [f32],
        alpha: &[f32],
        colors: &[[f32; 3]],
        glow: Option<&[[f32; 3]]>
    ) = lay_finite_with
}

fn laid<S: Copy + Send + Sync>(
    mut out: ArrayViewMut3<'_, S>,
    back: ArrayView3<'_, S>,
    lit: &Lit<'_>,
    cancel: &Cancel,
    lay: impl Fn(&mut [S], &[S], &Along<'_>) + Sync,
) -> Result<(), Error> {
    let (height, width, channels) = out.dim();
    let same = back.dim() == out.dim() && lit.alpha.dim() == (height, width) && channels == 3;
    if !same || lit.glow.is_some_and(|glow| glow.dim() != (height, width, 3)) {
        return Err(Error::Internal("a layer and its picture differ in size".into()));
    }
    lit.grid.check()?;
    let layout = || Error::Internal("rows are not contiguous".into());
    let across = lit.grid.across(width);
    let tasks: Vec<_> = out.axis_chunks_iter_mut(Axis(0), 32).enumerate().collect();
    pool::for_each(tasks, |(number, mut band)| {
        cancel.check()?;
        let (mut line, mut colors) = (Vec::new(), vec![[0.0_f32; 3]; width]);
        for (row, mut out) in band.outer_iter_mut().enumerate() {
            let row = 32 * number + row;
            lit.grid.row(row, &across, &mut line, &mut colors);
            let alpha = lit.alpha.index_axis_move(Axis(0), row);
            let alpha = alpha.to_slice().ok_or_else(layout)?;
            let glow = lit.glow.map(|glow| glow.index_axis_move(Axis(0), row));
            let glow = glow.as_ref().map(|glow| glow.to_slice().ok_or_else(layout)).transpose()?;
            let glow = glow.map(|glow| glow.as_chunks::<3>().0);
            let back = back.index_axis_move(Axis(0), row);
            let back = back.to_slice().ok_or_else(layout)?;
            let along = Along { alpha, colors: &colors, glow };
            lay(out.as_slice_mut().ok_or_else(layout)?, back, &along);
        }
        Ok(())
    })
}

/// Fills `out` (H, W, 3) with the premultiplied light of a layer.
pub fn light(mut out: ArrayViewMut3<'_, f32>, lit: &Lit<'_>, cancel: &Cancel) -> Result<(), Error> {
    out.fill(0.0);
    let (height, width, _) = out.dim();
    let back = ndarray::Array3::<f32>::zeros((height, width, 3));
    over(out, back.view(), lit, cancel)
}

/// Adds to `glow` (H, W, 3) the light of what has a color: its opacity times that.
pub fn add(
    mut glow: ArrayViewMut3<'_, f32>,
    behind: &Lit<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let behind = Behind::of(behind, (glow.dim().0, glow.dim().1))?;
    let tasks: Vec<_> = glow.axis_chunks_iter_mut(Axis(0), 32).enumerate().collect();
    pool::for_each(tasks, |(number, band)| {
        cancel.check()?;
        behind.add(32 * number, band, None)
    })
}

/// What lies behind flakes, with the light that it has.
pub struct Behind<'a, 'b> {
    lit: &'a Lit<'b>,
    across: Vec<Run>,
}

impl<'a, 'b> Behind<'a, 'b> {
    /// Of a layer before a picture of `shape`.
    pub fn of(lit: &'a Lit<'b>, shape: (usize, usize)) -> Result<Self, Error> {
        if lit.alpha.dim() != shape {
            return Err(Error::Internal("a layer and its light differ in size".into()));
        }
        lit.grid.check()?;
        Ok(Self { lit, across: lit.grid.across(shape.1) })
    }

    /// Adds its light to rows from `first` on, as far as `front`, the opacity of these rows, lets it through.
    pub fn add(
        &self,
        first: usize,
        mut glow: ArrayViewMut3<'_, f32>,
        front: Option<ArrayView2<'_, f32>>,
    ) -> Result<(), Error> {
        let layout = || Error::Internal("rows are not contiguous".into());
        let width = glow.dim().1;
        let (mut line, mut colors) = (Vec::new(), vec![[0.0_f32; 3]; width]);
        let mut cover = vec![0.0_f32; width];
        for (row, mut glow) in glow.outer_iter_mut().enumerate() {
            self.lit.grid.row(first + row, &self.across, &mut line, &mut colors);
            let alpha = self.lit.alpha.index_axis_move(Axis(0), first + row);
            cover.copy_from_slice(alpha.to_slice().ok_or_else(layout)?);
            if let Some(front) = front {
                let front = front.index_axis_move(Axis(0), row);
                let front = front.to_slice().ok_or_else(layout)?;
                cover.iter_mut().zip(front).for_each(|(cover, front)| *cover *= 1.0 - front);
            }
            let (glow, _) = glow.as_slice_mut().ok_or_else(layout)?.as_chunks_mut::<3>();
            add_light(glow, &colors, &cover);
        }
        Ok(())
    }
}

#[inline(always)]
fn add_light_with<const LEVEL: u8>(glow: &mut [[f32; 3]], colors: &[[f32; 3]], cover: &[f32]) {
    for ((glow, color), cover) in glow.iter_mut().zip(colors).zip(cover) {
        for c in 0..3 {
            glow[c] += cover * color[c];
        }
    }
}

dispatch! {
    /// Adds colors times opacities.
    fn add_light(glow: &mut [[f32; 3]], colors: &[[f32; 3]], cover: &[f32]) = add_light_with
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, Array3};

    #[test]
    fn an_even_grid_is_one_color() {
        let colors = Array3::from_elem((2, 3, 3), 0.5_f32);
        let alpha = Array2::from_elem((5, 7), 0.25_f32);
        let back = Array3::from_elem((5, 7, 3), 1.0_f32);
        let glow = Array3::from_elem((5, 7, 3), 0.1_f32);
        let grid = Grid { colors: colors.view(), cell: 3.0, first: (0, 0) };
        let lit = Lit { alpha: alpha.view(), grid, glow: Some(glow.view()) };
        let mut out = Array3::zeros((5, 7, 3));
        over(out.view_mut(), back.view(), &lit, &Cancel::new()).unwrap();
        assert!(out.iter().all(|&v| (v - (0.75 + 0.125 + 0.1)).abs() < 1e-6));
    }
}
