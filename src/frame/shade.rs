//! Light that differs over the picture: a layer whose color lies between cells.

use ndarray::{ArrayView2, ArrayView3, ArrayViewMut3, Axis};

use super::coding::Coding;
use super::grid::{Grid, Run};
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
            whiten(light);
            tables.encode(out, light);
        }
    })
}

/// Turns light (n, 3) that is brighter than white to white, as far as it is brighter. Clipped channel by
/// channel the light of an orange lamp would have a yellow ring.
#[dispatch]
pub fn whiten<const LEVEL: u8>(light: &mut [f32]) {
    for color in light.as_chunks_mut::<3>().0 {
        let [red, green, blue] = color.map(|c| if c > BRIGHTEST { BRIGHTEST } else { c });
        let scale = 1.0 / most(most(red, most(green, blue)), 1.0);
        *color = [red, green, blue].map(|c| c * scale + (1.0 - scale) * (1.0 - c * scale));
    }
}

/// Light that is white whatever its color.
const BRIGHTEST: f32 = 1e6;

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

/// Lays a layer over light that is finite, with the bits of `Along::over`.
#[dispatch]
fn lay_finite<const LEVEL: u8>(
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
    let across = lit.grid.across(width);
    let tasks: Vec<_> = out.axis_chunks_iter_mut(Axis(0), 32).enumerate().collect();
    pool::for_each(tasks, |(number, mut band)| {
        cancel.check()?;
        let (mut line, mut colors) = (Vec::new(), vec![[0.0_f32; 3]; width]);
        for (row, mut out) in band.outer_iter_mut().enumerate() {
            let row = 32 * number + row;
            lit.grid.row(row, &across, &mut line, &mut colors);
            let alpha = pool::line(lit.alpha, row)?;
            let glow = lit.glow.map(|glow| pool::line(glow, row)).transpose()?;
            let glow = glow.map(|glow| glow.as_chunks::<3>().0);
            let back = pool::line(back, row)?;
            let along = Along { alpha, colors: &colors, glow };
            lay(out.as_slice_mut().ok_or_else(layout)?, back, &along);
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
        let width = glow.dim().1;
        let (mut line, mut colors) = (Vec::new(), vec![[0.0_f32; 3]; width]);
        let mut cover = vec![0.0_f32; width];
        for (row, mut glow) in glow.outer_iter_mut().enumerate() {
            self.lit.grid.row(first + row, &self.across, &mut line, &mut colors);
            cover.copy_from_slice(pool::line(self.lit.alpha, first + row)?);
            if let Some(front) = front {
                let front = pool::line(front, row)?;
                cover.iter_mut().zip(front).for_each(|(cover, front)| *cover *= 1.0 - front);
            }
            let (glow, _) = glow.as_slice_mut().ok_or_else(layout)?.as_chunks_mut::<3>();
            add_light(glow, &colors, &cover);
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
