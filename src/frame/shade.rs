//! Light that differs over the picture: a layer whose color lies between cells.

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut3, Axis};

use super::coding::{Coding, decode, encode};
use super::grid::{Colors, Grid, PIXELS};
use super::mix::mix_pixels;
use crate::base::error::{Cancel, Error, layout};
use crate::base::normal::most;
use crate::base::pool;
use crate::base::simd::dispatch;

/// What is laid over a picture.
pub struct Lit<'a> {
    /// (H, W), 0 to 1.
    pub alpha: ArrayView2<'a, f32>,
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
    laid(out, back, lit, cancel, lay)
}

/// Lays it over bytes by Eq. 7 in their own values, as its colors are; nothing of it glows.
pub fn over_values(
    out: ArrayViewMut3<'_, u8>,
    back: ArrayView3<'_, u8>,
    lit: &Lit<'_>,
    cancel: &Cancel,
) -> Result<(), Error> {
    laid(out, back, lit, cancel, |out, back, layer| {
        mix_pixels(out, back, layer.colors.as_flattened(), layer.alpha, 3);
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
        let [behind, light] = &mut [[0.0_f32; 3 * PIXELS]; 2];
        let (behind, light) = (&mut behind[..out.len()], &mut light[..out.len()]);
        decode(behind, back, &tables);
        lay(light, behind, layer);
        whiten(light);
        encode(out, light, &tables);
    })
}

/// Turns light (n, 3) that is brighter than white to white, as far as it is brighter. Clipped channel by
/// channel the light of an orange lamp would have a yellow ring.
#[dispatch]
pub fn whiten<const LEVEL: u8>(light: &mut [f32]) {
    if light.iter().fold(true, |all, &c| all & (c <= 1.0)) {
        return;
    }
    for color in light.as_chunks_mut::<3>().0 {
        let [red, green, blue] = color.map(|c| if c > BRIGHTEST { BRIGHTEST } else { c });
        let scale = 1.0 / most(most(red, most(green, blue)), 1.0);
        *color = [red, green, blue].map(|c| c * scale + (1.0 - scale) * (1.0 - c * scale));
    }
}

/// Light that is white whatever its color.
const BRIGHTEST: f32 = 1e6;

/// A layer along some pixels of a row.
struct Along<'a> {
    alpha: &'a [f32],
    colors: &'a [[f32; 3]],
    glow: Option<&'a [f32]>,
}

/// Lays it over linear light. What nothing lies over keeps its bits.
fn lay(out: &mut [f32], back: &[f32], layer: &Along<'_>) {
    mix_pixels(out, back, layer.colors.as_flattened(), layer.alpha, 3);
    for (out, &more) in out.iter_mut().zip(layer.glow.unwrap_or_default()) {
        *out = if more == 0.0 { *out } else { *out + more };
    }
}

fn laid<S: Copy + Send + Sync>(
    mut out: ArrayViewMut3<'_, S>,
    back: ArrayView3<'_, S>,
    lit: &Lit<'_>,
    cancel: &Cancel,
    each: impl Fn(&mut [S], &[S], &Along<'_>) + Sync,
) -> Result<(), Error> {
    let (height, width, channels) = out.dim();
    let same = back.dim() == out.dim() && lit.alpha.dim() == (height, width) && channels == 3;
    if !same || lit.glow.is_some_and(|glow| glow.dim() != (height, width, 3)) {
        return Err(Error::Internal("a layer and its picture differ in size".into()));
    }
    lit.grid.check()?;
    let across = lit.grid.across(width);
    let tasks: Vec<_> = out.axis_chunks_iter_mut(Axis(0), 32).enumerate().collect();
    pool::for_each(tasks, |(number, mut band)| {
        cancel.check()?;
        let mut colors = Colors::new(&lit.grid, &across);
        for (row, mut out) in band.outer_iter_mut().enumerate() {
            let row = 32 * number + row;
            colors.go(row)?;
            let glow = lit.glow.map(|glow| pool::line(glow, row)).transpose()?;
            let out = out.as_slice_mut().ok_or_else(layout)?.chunks_mut(3 * PIXELS);
            let parts = out.zip(pool::line(back, row)?.chunks(3 * PIXELS));
            let parts = parts.zip(pool::line(lit.alpha, row)?.chunks(PIXELS));
            for (part, ((out, back), alpha)) in parts.enumerate() {
                let (from, count) = (part * PIXELS, alpha.len());
                let glow = glow.map(|glow| &glow[3 * from..][..out.len()]);
                each(out, back, &Along { alpha, colors: colors.some(from, count), glow });
            }
        }
        Ok(())
    })
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
    across: Vec<(u32, f32)>,
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
        let mut cover = vec![0.0_f32; glow.dim().1];
        let mut colors = Colors::new(&self.lit.grid, &self.across);
        for (row, mut glow) in glow.outer_iter_mut().enumerate() {
            colors.go(first + row)?;
            cover.copy_from_slice(pool::line(self.lit.alpha, first + row)?);
            if let Some(front) = front {
                let front = pool::line(front, row)?;
                cover.iter_mut().zip(front).for_each(|(cover, front)| *cover *= 1.0 - front);
            }
            let (glow, _) = glow.as_slice_mut().ok_or_else(layout)?.as_chunks_mut::<3>();
            let parts = glow.chunks_mut(PIXELS).zip(cover.chunks(PIXELS));
            for (part, (glow, cover)) in parts.enumerate() {
                add_light(glow, colors.some(part * PIXELS, cover.len()), cover);
            }
        }
        Ok(())
    }
}

#[dispatch]
fn add_light<const LEVEL: u8>(glow: &mut [[f32; 3]], colors: &[[f32; 3]], cover: &[f32]) {
    for ((glow, color), cover) in glow.iter_mut().zip(colors).zip(cover) {
        for c in 0..3 {
            glow[c] += cover * color[c];
        }
    }
}
