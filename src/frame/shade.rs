//! Light that differs over the picture: the mean light of a plate's cells, a layer whose color lies
//! between cells, and linear light written as bytes.

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut3, Axis};

use crate::base::error::{Cancel, Error};
use crate::base::pool;

/// How bytes are read as linear light and written again.
pub struct Coding<'a> {
    /// The light of each of the 256 values.
    pub light: &'a [f32],
    /// The least light of each value from 1 to 255.
    pub edges: &'a [f32],
}

/// Even steps of light by which a value is looked up first.
const STEPS: usize = 4096;

impl Coding<'_> {
    fn check(&self) -> Result<(), Error> {
        let sorted = self.edges.windows(2).all(|pair| pair[1] - pair[0] > 1.001 / STEPS as f32);
        if self.light.len() == 256 && self.edges.len() == 255 && sorted {
            Ok(())
        } else {
            Err(Error::Internal("no coding of bytes looks like that".into()))
        }
    }

    /// Tables to look bytes up in.
    fn tables(&self) -> Tables {
        let mut tables = Tables { first: [0; STEPS + 1], edges: [f32::INFINITY; 256] };
        tables.edges[..255].copy_from_slice(self.edges);
        let mut level = 0;
        for (step, first) in tables.first.iter_mut().enumerate() {
            let light = step as f32 / STEPS as f32;
            while level < 255 && self.edges[level] <= light {
                level += 1;
            }
            *first = level as u8;
        }
        tables
    }
}

/// Tables to look bytes up in.
struct Tables {
    /// The value at which each step of light begins: no step holds two edges, even at black.
    first: [u8; STEPS + 1],
    edges: [f32; 256],
}

impl Tables {
    /// The byte of a light: clipped, NaN is 0.
    #[inline(always)]
    fn byte(&self, light: f32) -> u8 {
        let light = light.clamp(0.0, 1.0);
        let level = self.first[((light * STEPS as f32) as usize).min(STEPS)];
        level + u8::from(self.edges[usize::from(level)] <= light)
    }
}

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

/// A place between two cells: the first one, and how far it is to the second.
#[derive(Clone, Copy)]
struct Between {
    first: usize,
    second: usize,
    part: f32,
}

impl Grid<'_> {
    fn between(&self, pixel: usize, count: usize) -> Between {
        let last = count.saturating_sub(1);
        let place = ((pixel as f64 + 0.5) / self.cell - 0.5).clamp(0.0, last as f64);
        let first = place.floor() as usize;
        Between { first, second: (first + 1).min(last), part: (place - first as f64) as f32 }
    }

    fn across(&self, width: usize) -> Vec<Between> {
        let count = self.colors.dim().1;
        (0..width).map(|x| self.between(self.first.1 + x, count)).collect()
    }

    /// The colors of a row of pixels of the layer.
    fn row(&self, row: usize, across: &[Between], line: &mut Vec<[f32; 3]>, out: &mut [[f32; 3]]) {
        let (rows, columns, _) = self.colors.dim();
        let at = self.between(self.first.0 + row, rows);
        line.clear();
        line.extend((0..columns).map(|column| {
            std::array::from_fn(|channel| {
                let low = self.colors[[at.first, column, channel]];
                low + at.part * (self.colors[[at.second, column, channel]] - low)
            })
        }));
        for (out, at) in out.iter_mut().zip(across) {
            let (low, high) = (line[at.first], line[at.second]);
            *out = std::array::from_fn(|c| low[c] + at.part * (high[c] - low[c]));
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
    laid(out, back, lit, cancel, |value| value, |light| light)
}

/// Lays it over bytes, in linear light.
pub fn over_bytes(
    out: ArrayViewMut3<'_, u8>,
    back: ArrayView3<'_, u8>,
    lit: &Lit<'_>,
    coding: &Coding<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    coding.check()?;
    let tables = coding.tables();
    let mut lights = [0.0_f32; 256];
    lights.copy_from_slice(coding.light);
    laid(out, back, lit, cancel, |value: u8| lights[usize::from(value)], |light| tables.byte(light))
}

fn laid<S: Copy + Send + Sync>(
    mut out: ArrayViewMut3<'_, S>,
    back: ArrayView3<'_, S>,
    lit: &Lit<'_>,
    cancel: &Cancel,
    read: impl Fn(S) -> f32 + Sync,
    write: impl Fn(f32) -> S + Sync,
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
            let out = out.as_slice_mut().ok_or_else(layout)?;
            let back = back.index_axis_move(Axis(0), row);
            let back = back.to_slice().ok_or_else(layout)?;
            let alpha = lit.alpha.index_axis(Axis(0), row);
            let glow = lit.glow.map(|glow| glow.index_axis_move(Axis(0), row));
            let glow = glow.as_ref().map(|glow| glow.to_slice().ok_or_else(layout)).transpose()?;
            let pixels = out.chunks_exact_mut(3).zip(back.chunks_exact(3));
            for (x, (out, back)) in pixels.enumerate() {
                let cover = alpha[x];
                let more = glow.map_or([0.0; 3], |g| [g[3 * x], g[3 * x + 1], g[3 * x + 2]]);
                if cover == 0.0 && more == [0.0; 3] {
                    // What nothing lies over keeps its bits.
                    out.copy_from_slice(back);
                    continue;
                }
                for c in 0..3 {
                    let light = cover * colors[x][c] + more[c];
                    let through = if cover == 1.0 { 0.0 } else { (1.0 - cover) * read(back[c]) };
                    out[c] = write(through + light);
                }
            }
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

/// Adds to `glow` (H, W, 3) the light of what lies behind flakes: its opacity times a color, as far as
/// `front` lets it through.
pub fn add_behind(
    mut glow: ArrayViewMut3<'_, f32>,
    behind: &Lit<'_>,
    front: Option<ArrayView2<'_, f32>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let (height, width, _) = glow.dim();
    if behind.alpha.dim() != (height, width)
        || front.is_some_and(|front| front.dim() != (height, width))
    {
        return Err(Error::Internal("a layer and its light differ in size".into()));
    }
    behind.grid.check()?;
    let layout = || Error::Internal("rows are not contiguous".into());
    let across = behind.grid.across(width);
    let tasks: Vec<_> = glow.axis_chunks_iter_mut(Axis(0), 32).enumerate().collect();
    pool::for_each(tasks, |(number, mut band)| {
        cancel.check()?;
        let (mut line, mut colors) = (Vec::new(), vec![[0.0_f32; 3]; width]);
        for (row, mut glow) in band.outer_iter_mut().enumerate() {
            let row = 32 * number + row;
            behind.grid.row(row, &across, &mut line, &mut colors);
            let alpha = behind.alpha.index_axis_move(Axis(0), row);
            let alpha = alpha.to_slice().ok_or_else(layout)?;
            let front = front.map(|front| front.index_axis_move(Axis(0), row));
            let front = front.as_ref().map(|row| row.to_slice().ok_or_else(layout)).transpose()?;
            let (glow, _) = glow.as_slice_mut().ok_or_else(layout)?.as_chunks_mut::<3>();
            for (x, ((glow, color), &cover)) in glow.iter_mut().zip(&colors).zip(alpha).enumerate()
            {
                let cover = cover * front.map_or(1.0, |front| 1.0 - front[x]);
                (0..3).for_each(|c| glow[c] += cover * color[c]);
            }
        }
        Ok(())
    })
}

/// Writes linear light as bytes.
pub fn bytes(
    out: &mut [u8],
    light: &[f32],
    coding: &Coding<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    coding.check()?;
    if out.len() != light.len() {
        return Err(Error::Internal("bytes and light differ in number".into()));
    }
    let tables = coding.tables();
    let tasks: Vec<_> = out.chunks_mut(1 << 16).zip(light.chunks(1 << 16)).collect();
    pool::for_each(tasks, |(out, light)| {
        cancel.check()?;
        for (out, &light) in out.iter_mut().zip(light) {
            *out = tables.byte(light);
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, Array3};

    fn coding() -> (Vec<f32>, Vec<f32>) {
        let law = |v: f32| if v < 0.04 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
        let light: Vec<f32> = (0..256).map(|v| law(v as f32 / 255.0)).collect();
        let edges = (0..255).map(|v| law((v as f32 + 0.5) / 255.0)).collect();
        (light, edges)
    }

    #[test]
    fn bytes_survive_their_light() {
        let (light, edges) = coding();
        let coding = Coding { light: &light, edges: &edges };
        let mut out = vec![7_u8; 256];
        bytes(&mut out, &light, &coding, &Cancel::new()).unwrap();
        assert!(out.iter().enumerate().all(|(value, &byte)| value == usize::from(byte)));
        let mut odd = vec![9_u8; 3];
        bytes(&mut odd, &[f32::NAN, -1.0, f32::INFINITY], &coding, &Cancel::new()).unwrap();
        assert_eq!(odd, [0, 0, 255]);
    }

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
