//! The tiles of a picture: what they share, their buffers, and their pixels.

use std::ops::Range;

use ndarray::{ArrayView2, ArrayViewMut2, ArrayViewMut3, Axis};

use super::batch::{Plane, TILE, Tile};
use super::cut::Ground;
use super::draw::{Drawing, Entry, draw};
use super::rays::{Rays, Sheet};
use super::sprite::{Eye, Form, Sprite};
use crate::base::error::{Cancel, Error, collected, layout, pushed};
use crate::base::normal::{Normal, least, most};
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::dispatch;

/// The places of the sprites that are seen, in the order in which they are drawn.
fn order(sprites: &[Sprite], sorted: bool) -> Result<Vec<u32>, Error> {
    let mut order: Vec<u32> = collected(0..sprites.len() as u32)?;
    order.retain(|&place| sprites[place as usize].rows[0] < sprites[place as usize].rows[1]);
    if sorted {
        let key = |place: u32| sprites[place as usize].key;
        order.sort_unstable_by(|&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
    }
    Ok(order)
}

/// What sprites touch, found once for any number of pictures of their frame.
pub struct Touched {
    /// For each row of tiles what touches it, in drawing order. Not for each tile: a particle near the
    /// eye covers thousands of tiles, and few bands.
    bands: Vec<Vec<Entry>>,
    by_ray: bool,
    colored: bool,
}

impl Touched {
    /// Lists the sprites of a frame of so many rows; they are drawn in order if they differ in color.
    pub fn of(sprites: &[Sprite], colors: &[[f64; 3]], height: usize) -> Result<Self, Error> {
        let colored = colors.iter().any(|color| *color != colors[0]);
        let order = order(sprites, colored)?;
        let mut bands = vec![Vec::new(); height.div_ceil(TILE)];
        let mut by_ray = false;
        for place in order {
            let seen = &sprites[place as usize];
            let ([top, bottom], [left, right]) = (seen.rows.map(|row| row as usize), seen.columns);
            for band in &mut bands[top / TILE..bottom.div_ceil(TILE)] {
                pushed(band, Entry { sprite: place, left, right })?;
            }
            by_ray |= seen.form == Form::Ray;
        }
        Ok(Self { bands, by_ray, colored })
    }
}

pub struct Picture<'a, M> {
    pub shape: (usize, usize),
    pub eye: &'a Eye,
    pub drawing: Drawing<'a>,
    pub touched: &'a Touched,
    pub depth: Option<ArrayView2<'a, M>>,
}

/// Buffers of one tile, kept from tile to tile.
struct Scratch<P> {
    through: Box<Plane<P>>,
    /// Premultiplied light, if particles differ in color.
    light: Option<Box<[Plane<P>; 3]>>,
    depth: Option<Box<Plane<P>>>,
    rays: Option<Box<Rays<P, TILE>>>,
}

fn nothing<P: Normal>() -> Plane<P> {
    Plane([[P::zero(); TILE]; TILE])
}

impl<M: Real> Picture<'_, M> {
    fn scratch<P: Normal>(&self) -> Scratch<P> {
        let Touched { by_ray, colored, .. } = *self.touched;
        Scratch {
            through: Box::new(nothing()),
            light: colored.then(|| Box::new([nothing(), nothing(), nothing()])),
            depth: self.depth.map(|_| Box::new(nothing())),
            rays: by_ray.then(|| Box::new(Rays::none())),
        }
    }

    /// Draws the tile whose corner is at `origin` (x, y).
    fn tile<P: Normal>(
        &self,
        origin: [usize; 2],
        scratch: &mut Scratch<P>,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let [left, top] = origin;
        let (height, width) = (self.shape.0 - top, self.shape.1 - left);
        for (row, values) in scratch.through.0.iter_mut().enumerate() {
            // Beyond the border nothing is let through, so that a tile there can be finished.
            let inside = if row < height { width.min(TILE) } else { 0 };
            values[..inside].fill(P::one());
            values[inside..].fill(P::zero());
        }
        if let Some(light) = &mut scratch.light {
            light.iter_mut().for_each(|plane| plane.0.fill([P::zero(); TILE]));
        }
        let ground = match (&self.depth, &mut scratch.depth) {
            (Some(map), Some(depth)) => Some(standing(map, origin, &mut depth.0)),
            _ => None,
        };
        let corner = origin.map(|place| place as f64 + 0.5);
        let mut tile = Tile {
            origin,
            through: &mut scratch.through,
            light: scratch.light.as_deref_mut(),
            sheet: Sheet::of(self.eye, corner, 1.0, TILE),
            rays: scratch.rays.as_deref_mut(),
            ground: ground.as_ref(),
        };
        draw(&mut tile, &self.touched.bands[top / TILE], &self.drawing, cancel)
    }

    /// Draws a part of the frame, `channels` numbers to a pixel; `store` writes a row of a tile from
    /// some column on.
    fn draw<P: Normal>(
        &self,
        out: ArrayViewMut2<'_, P>,
        [top, bottom, left, right]: Part,
        channels: usize,
        store: impl Fn(&mut [P], &Scratch<P>, usize, usize) + Sync + Send,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        if self.depth.is_some_and(|depth| depth.dim() != self.shape) {
            return Err(Error::invalid("depth", format!("must have shape {:?}", self.shape)));
        }
        let inside = top <= bottom && bottom <= self.shape.0 && left <= right;
        let wanted = (bottom.wrapping_sub(top), channels * right.wrapping_sub(left));
        if !(inside && right <= self.shape.1 && out.dim() == wanted) {
            return Err(Error::Internal("the part is not one of the frame, or not out's".into()));
        }
        pool::for_each(runs_of(out, [top, bottom, left, right], channels)?, |(tiles, mut run)| {
            let mut scratch = self.scratch();
            for Cut { origin, skipped: (down, across), columns } in tiles {
                cancel.check()?;
                self.tile(origin, &mut scratch, cancel)?;
                for (row, mut pixels) in run.rows_mut().into_iter().enumerate() {
                    let pixels = pixels.as_slice_mut().expect("rows are contiguous");
                    let pixels = &mut pixels[channels * columns.start..channels * columns.end];
                    store(pixels, &scratch, down + row, across);
                }
            }
            Ok(())
        })
    }

    /// Draws the alpha of a part of the frame, in the bits of the whole.
    pub fn alpha<P: Normal>(
        &self,
        out: ArrayViewMut2<'_, P>,
        part: Part,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let store = |pixels: &mut [P], done: &Scratch<P>, row: usize, from: usize| {
            opacity(pixels, &done.through.0[row][from..]);
        };
        self.draw(out, part, 1, store, cancel)
    }

    /// Draws premultiplied RGBA of a part of the frame, in the bits of the whole.
    pub fn light<P: Normal>(
        &self,
        out: ArrayViewMut3<'_, P>,
        part: Part,
        cancel: &Cancel,
    ) -> Result<(), Error> {
        let (height, width, channels) = out.dim();
        let flat = out
            .into_shape_with_order((height, width * channels))
            .ok()
            .filter(|_| channels == 4)
            .ok_or_else(layout)?;
        let color = self.drawing.colors[0].map(P::of);
        let store = |pixels: &mut [P], done: &Scratch<P>, row: usize, from: usize| {
            let through = &done.through.0[row][from..];
            match &done.light {
                None => one_color(pixels, through, color),
                Some(light) => {
                    many_colors(pixels, through, [0, 1, 2].map(|c| &light[c].0[row][from..]));
                }
            }
        };
        self.draw(flat, part, 4, store, cancel)
    }
}

/// A part of a frame, pixels: top, bottom, left, right.
pub type Part = [usize; 4];

/// A tile of the depth map; beyond the picture it goes on as it ended.
fn standing<'a, P: Normal, M: Real>(
    map: &ArrayView2<M>,
    [left, top]: [usize; 2],
    depth: &'a mut [[P; TILE]; TILE],
) -> Ground<'a, P, TILE> {
    let height = (map.nrows() - top).min(TILE);
    let width = (map.ncols() - left).min(TILE);
    let mut stands = [[0.0; TILE]; TILE];
    for (values, row) in stands.iter_mut().zip(map.outer_iter().skip(top)) {
        match row.to_slice() {
            Some(row) => widen(&mut values[..width], &row[left..left + width]),
            None => values.iter_mut().zip(row.iter().skip(left)).for_each(|(v, m)| *v = m.wide()),
        }
        // No other depths than those inside.
        let last = values[width - 1];
        values[width..].fill(last);
    }
    let range = stand(&mut depth[..height], &stands[..height]);
    for values in &mut depth[..height] {
        for column in width..TILE {
            values[column] = further(values[column - 1], values[column.max(2) - 2]);
        }
    }
    for row in height..TILE {
        let (done, rest) = depth.split_at_mut(row);
        let (last, before) = (&done[row - 1], &done[row.max(2) - 2]);
        for (column, value) in rest[0].iter_mut().enumerate() {
            *value = further(last[column], before[column]);
        }
    }
    Ground { depth, range }
}

/// Depths in float64.
#[dispatch]
fn widen<const LEVEL: u8, M: Real>(values: &mut [f64], stands: &[M]) {
    values.iter_mut().zip(stands).for_each(|(value, stands)| *value = stands.wide());
}

/// Rows of depths in the samples' type, and the nearest and the farthest of them.
#[dispatch]
fn stand<const LEVEL: u8, P: Normal>(depth: &mut [[P; TILE]], stands: &[[f64; TILE]]) -> [f64; 2] {
    let (mut nearest, mut farthest) = ([P::infinity(); TILE], [P::neg_infinity(); TILE]);
    for (values, stands) in depth.iter_mut().zip(stands) {
        for k in 0..TILE {
            values[k] = P::of(stands[k]);
            nearest[k] = least(values[k], nearest[k]);
            farthest[k] = most(values[k], farthest[k]);
        }
    }
    [
        nearest.iter().fold(f64::INFINITY, |a, b| a.min(b.wide())),
        farthest.iter().fold(f64::NEG_INFINITY, |a, b| a.max(b.wide())),
    ]
}

/// A straight line's next number after two.
fn further<P: Normal>(last: P, before: P) -> P {
    let step = last - before;
    if step.is_finite() { last + step } else { last }
}

/// alpha = 1 - T for a row of a tile.
#[dispatch]
fn opacity<const LEVEL: u8, P: Normal>(pixels: &mut [P], through: &[P]) {
    for (pixel, through) in pixels.iter_mut().zip(through) {
        *pixel = P::one() - *through;
    }
}

fn one_color<P: Normal>(pixels: &mut [P], through: &[P], color: [P; 3]) {
    for (pixel, through) in pixels.chunks_exact_mut(4).zip(through) {
        let alpha = P::one() - *through;
        pixel[0] = color[0] * alpha;
        pixel[1] = color[1] * alpha;
        pixel[2] = color[2] * alpha;
        pixel[3] = alpha;
    }
}

fn many_colors<P: Normal>(pixels: &mut [P], through: &[P], light: [&[P]; 3]) {
    for (k, (pixel, through)) in pixels.chunks_exact_mut(4).zip(through).enumerate() {
        pixel[0] = light[0][k];
        pixel[1] = light[1][k];
        pixel[2] = light[2][k];
        pixel[3] = P::one() - *through;
    }
}

/// A tile as far as a part of the frame has it.
struct Cut {
    /// Its corner (x, y) in the frame, px.
    origin: [usize; 2],
    /// Its rows and columns before the part.
    skipped: (usize, usize),
    /// Columns of the run's pixels that it fills.
    columns: Range<usize>,
}

/// Tiles of a run that one task draws, one after the other, and its part of the picture.
type Run<'a, P> = (Vec<Cut>, ArrayViewMut2<'a, P>);

/// A part of the frame cut into runs of up to four tiles side by side; `channels` numbers to a pixel.
fn runs_of<P>(
    out: ArrayViewMut2<'_, P>,
    [mut top, bottom, first, right]: Part,
    channels: usize,
) -> Result<Vec<Run<'_, P>>, Error> {
    const TOGETHER: usize = 4;
    let mut runs = Vec::new();
    let mut rest = out;
    while top < bottom {
        let below = ((top / TILE + 1) * TILE).min(bottom);
        let (mut band, later) = rest.split_at(Axis(0), below - top);
        let mut left = first;
        while left < right {
            let end = ((left / TILE + TOGETHER) * TILE).min(right);
            let (run, aside) = band.split_at(Axis(1), (end - left) * channels);
            let tiles = collected((left / TILE..end.div_ceil(TILE)).map(|tile| {
                let from = left.max(tile * TILE);
                Cut {
                    origin: [tile * TILE, top / TILE * TILE],
                    skipped: (top % TILE, from % TILE),
                    columns: from - left..((tile + 1) * TILE).min(end) - left,
                }
            }))?;
            pushed(&mut runs, (tiles, run))?;
            band = aside;
            left = end;
        }
        rest = later;
        top = below;
    }
    Ok(runs)
}
