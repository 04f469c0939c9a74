//! The light of lamps that slices of gas scatter towards the eye: once, with extinction on both ways.
//!
//! L = sum over slices of T * k * what `beam` finds, T the transmittance up to the slice, k its extinction there.
//!
//! For a slice's own k and T that integral is smooth over the picture too: it is found at every second sample of the
//! slices' coarse grid; near a lamp, and where gas is rough, at each. What comes of a pixel's opacity, L over 1 - T of all
//! slices, is smooth as well: coarse samples give it, but nearest to a lamp, in the light of a spot and where the scene ends a
//! slice, which each pixel adds up by itself.

use ndarray::{Array3, ArrayView2, ArrayViewMut2, ArrayViewMut3, Axis, Zip, s};

use super::beam::{LANES, Lane, Rays, near};
use super::slices::{COARSE, MARGIN, Slices, lines, pixels};
use crate::base::error::{Cancel, Error, layout, zeroed};
use crate::base::lamps::{Lamps, left};
use crate::base::normal::most;
use crate::base::pool;
use crate::base::simd::dispatch;

/// Rows of pixels of one task.
const BAND: usize = 64;

/// A lamp that is nearer than so many coarse samples wants each of them, and nearer than so many each pixel.
const STEEP: [f32; 2] = [16.0, 7.0];

/// Gas whose optical depth in a slice, times what reaches the eye from there, changes by so much from one place to
/// the next wants each sample.
const ROUGH: f32 = 0.05;

/// The least opacity of a slice: light and depth are divided by it.
const LEAST: f32 = 1e-9;

/// What is seen of slices up to some depth on rays: over their opacity light and depth, and what goes through.
struct Seen {
    through: Lane,
    opacity: Lane,
    parts: [Lane; 4],
}

impl Seen {
    fn none() -> Self {
        Self { through: [1.0; LANES], opacity: [0.0; LANES], parts: [[0.0; LANES]; 4] }
    }

    /// Adds a slice of the depth `place`, and its light over its extinction and what goes through.
    #[inline(always)]
    fn add<const LEVEL: u8>(&mut self, rays: &Rays, light: &[Lane; 3], place: f32) {
        let extinction = &rays.extinction;
        for k in 0..LANES {
            let (way, before) = (rays.to[k] - rays.from[k], self.through[k]);
            self.through[k] *= left::<f32, LEVEL>(extinction[k] * way);
            // Of gas too thin to be seen, too.
            let taken = before - self.through[k] + LEAST;
            let scale = if way > 0.0 { extinction[k] * before } else { 0.0 };
            for c in 0..3 {
                self.parts[c][k] += if scale > 0.0 { light[c][k] * scale } else { 0.0 };
            }
            self.parts[3][k] += place * taken;
            self.opacity[k] += taken;
        }
    }

    #[inline(always)]
    fn part(&self, part: usize, k: usize) -> f32 {
        self.parts[part][k] / self.opacity[k]
    }
}

/// Slices, the slopes of coarse columns and rows, and the depths that stand for slices.
pub type Gas<'a> = (&'a Slices<'a>, (&'a [f32], &'a [f32]), &'a [f32]);

/// Adds the light of lamps that slices scatter to `light`, (H, W, 3), or writes their mean depth to `far` (H, W), or
/// both, for an opacity (H, W) of theirs.
pub fn see(
    mut light: Option<ArrayViewMut3<'_, f32>>,
    mut far: Option<ArrayViewMut2<'_, f32>>,
    opacity: ArrayView2<'_, f32>,
    gas: Gas<'_>,
    lamps: &Lamps,
    cancel: &Cancel,
) -> Result<(), Error> {
    let ((height, width), (slices, grid, middles)) = (opacity.dim(), gas);
    slices.check((height, width))?;
    let (count, rows, columns) = slices.density.dim();
    let fits = (middles.len(), grid.0.len(), grid.1.len()) == (count, columns, rows)
        && light.as_ref().is_none_or(|light| light.dim() == (height, width, 3))
        && far.as_ref().is_none_or(|far| far.dim() == (height, width));
    if !fits {
        return Err(Error::Internal("slices of gas do not fit their planes".into()));
    }
    let (room, lit) = (columns * COARSE + LANES, light.is_some());
    let shown = if lit { 0 } else { 3 }..if far.is_some() { 4 } else { 3 };
    let bands = height.div_ceil(BAND);
    let mut light = light.as_mut().map(|light| light.axis_chunks_iter_mut(Axis(0), BAND));
    let mut far = far.as_mut().map(|far| far.axis_chunks_iter_mut(Axis(0), BAND));
    let mut next =
        || (light.as_mut().and_then(Iterator::next), far.as_mut().and_then(Iterator::next));
    let tasks: Vec<_> = (0..bands).map(|band| (band, next())).collect();
    pool::for_each(tasks, |(band, (mut light, mut far))| {
        cancel.check()?;
        let lines_of = |count| (0..count).map(|_| zeroed(room)).collect::<Result<Vec<_>, _>>();
        let (mut line, mut end, mut slopes) = (zeroed(columns)?, zeroed(room)?, zeroed(room)?);
        let (mut dense, mut glow) = (lines_of(count)?, lines_of(3 * count + 4)?);
        slopes[..width].copy_from_slice(slices.slopes.0);
        let first = band * BAND / COARSE;
        let last = (first + BAND / COARSE + 2 * MARGIN + 1).min(rows);
        let shape = (3 * count + 4, last - first, columns);
        let coarse = zeroed(shape.0 * shape.1 * shape.2)?;
        let mut coarse = Array3::from_shape_vec(shape, coarse).map_err(|_| layout())?;
        let row = |row: usize| row - first;
        for at in (first..last).filter(|at| lit && (row(*at) % 2 == 0 || at + 1 == last)) {
            second(gas, lamps, at, coarse.index_axis_mut(Axis(1), row(at)));
        }
        for at in (first + 1..last - 1).step_by(2).filter(|_| lit) {
            let around = (s![.., row(at) - 1, ..], s![.., row(at), ..], s![.., row(at) + 1, ..]);
            let (above, here, below) = coarse.multi_slice_mut(around);
            Zip::from(here).and(above).and(below).for_each(|here, a, b| *here = 0.5 * (*a + *b));
        }
        for at in first..last {
            samples(gas, lamps, at, coarse.index_axis_mut(Axis(1), row(at)));
        }
        let (own, smooth) = coarse.view().split_at(Axis(0), 3 * count);
        let smooth = smooth.slice(s![shown.clone(), .., ..]);
        for row in band * BAND..height.min((band + 1) * BAND) {
            let within = row - band * BAND;
            slices.ends(row, &mut end)?;
            lines(&smooth, within, &mut line, |line, plane| {
                fill(&mut glow[3 * count + shown.start + plane], line)
            })?;
            let (mut known, opacity) = (false, pool::line(opacity, row)?);
            for (number, opacity) in opacity.chunks(LANES).enumerate() {
                let at = number * LANES;
                let mut found = [0, 1, 2, 3].map(|part| lane(&glow[3 * count + part], at));
                let cut = |k: usize| end[at + k] < slices.edges[count] || found[0][k].is_nan();
                if (0..opacity.len()).any(cut) {
                    if !known {
                        let dense = |line: &[f32], plane: usize| fill(&mut dense[plane], line);
                        lines(&slices.density, row, &mut line, dense)?;
                        let glow = |line: &[f32], plane: usize| fill(&mut glow[plane], line);
                        if lit {
                            lines(&own, within, &mut line, glow)?;
                        }
                        known = true;
                    }
                    let rays = (&slopes[..], slices.slopes.1[row], &end[..]);
                    found = block(gas, lamps, (&dense[..], &glow[..]), rays, at);
                }
                if let Some(light) = &mut light {
                    let mut light = light.slice_mut(s![within, at..at + opacity.len(), ..]);
                    let light = light.as_slice_mut().ok_or_else(layout)?.as_chunks_mut::<3>().0;
                    for (k, (light, &opacity)) in light.iter_mut().zip(opacity).enumerate() {
                        (0..3).for_each(|c| light[c] += found[c][k] * opacity);
                    }
                }
                if let Some(far) = &mut far {
                    for (k, &opacity) in opacity.iter().enumerate() {
                        let there = opacity > 0.0;
                        far[[within, at + k]] = if there { found[3][k] } else { f32::INFINITY };
                    }
                }
            }
        }
        Ok(())
    })
}

/// How far coarse samples are apart, for a depth of 1.
fn apart(grid: (&[f32], &[f32])) -> f32 {
    most(grid.0[1] - grid.0[0], grid.1[1] - grid.1[0])
}

/// Fills a row of coarse samples with the light of lamps in each slice over its extinction and what reaches the
/// eye, red, green and blue of one after the other; NaN where the samples are too far apart. Every second is found.
#[dispatch]
fn second<const LEVEL: u8>(gas: Gas<'_>, lamps: &Lamps, row: usize, out: ArrayViewMut2<'_, f32>) {
    let ((slices, grid, middles), mut out) = (gas, out);
    let (last, reach) = (grid.0.len() - 1, STEEP[0] * apart(grid));
    for at in (0..=last + 1).step_by(2 * LANES) {
        let columns: [usize; LANES] = std::array::from_fn(|k| (at + 2 * k).min(last));
        let mut rays = Rays::new(columns.map(|column| grid.0[column]), grid.1[row]);
        for number in 0..middles.len() {
            let dense = |row: usize| slices.density.slice(s![number, row, ..]);
            let (dense, above) = (dense(row), dense(row.max(2) - 2));
            let own = columns.map(|column| dense[column]);
            rays.at(&slices.edges[number..], &[f32::INFINITY; LANES], own);
            let light = near::<LEVEL>(lamps, &rays, reach);
            for (k, column) in columns.into_iter().enumerate() {
                let (beside, above) = (dense[column.max(2) - 2], above[column]);
                let change = most((beside - own[k]).abs(), (above - own[k]).abs());
                let seen = left::<f32, LEVEL>(own[k] * rays.from[k]);
                let rough = change * (rays.to[k] - rays.from[k]) * seen > ROUGH;
                for c in 0..3 {
                    out[[3 * number + c, column]] = if rough { f32::NAN } else { light[c][k] };
                }
            }
        }
    }
    for mut line in out.outer_iter_mut() {
        for column in (1..last).step_by(2) {
            line[column] = 0.5 * (line[column - 1] + line[column + 1]);
        }
    }
}

/// Fills the last four lines of a row of coarse samples with what is [`Seen`] of all slices; the light that is NaN is found
/// for that, and NaN is left where these samples are too far apart.
#[dispatch]
fn samples<const LEVEL: u8>(gas: Gas<'_>, lamps: &Lamps, row: usize, out: ArrayViewMut2<'_, f32>) {
    let ((slices, grid, middles), mut out) = (gas, out);
    let (last, reach) = (grid.0.len() - 1, STEEP[1] * apart(grid));
    for at in (0..=last).step_by(LANES) {
        let columns: [usize; LANES] = std::array::from_fn(|k| (at + k).min(last));
        let mut rays = Rays::new(columns.map(|column| grid.0[column]), grid.1[row]);
        let mut seen = Seen::none();
        for (number, &middle) in middles.iter().enumerate() {
            let dense = slices.density.slice(s![number, row, ..]);
            let own = columns.map(|column| dense[column]);
            rays.at(&slices.edges[number..], &[f32::INFINITY; LANES], own);
            let mut found = [0, 1, 2].map(|c| columns.map(|column| out[[3 * number + c, column]]));
            if found[0].iter().any(|light| light.is_nan()) {
                found = near::<LEVEL>(lamps, &rays, reach);
            }
            seen.add::<LEVEL>(&rays, &found, middle);
        }
        for (k, column) in columns.into_iter().enumerate() {
            (0..4).for_each(|part| out[[3 * middles.len() + part, column]] = seen.part(part, k));
        }
    }
}

#[dispatch]
fn fill<const LEVEL: u8>(plane: &mut [f32], line: &[f32]) {
    for (four, three) in plane.as_chunks_mut::<COARSE>().0.iter_mut().zip(line.windows(3)) {
        *four = pixels::<LEVEL>(three);
    }
}

#[inline(always)]
fn lane(line: &[f32], at: usize) -> Lane {
    *line[at..].first_chunk().expect("lines have room for whole lanes")
}

/// What is [`Seen`] at some pixels of a row from `at` on; of lines of the slices' extinction and of the light that was
/// found on the coarse grid.
#[dispatch]
fn block<const LEVEL: u8>(
    gas: Gas<'_>,
    lamps: &Lamps,
    known: (&[Vec<f32>], &[Vec<f32>]),
    row: (&[f32], f32, &[f32]),
    at: usize,
) -> [Lane; 4] {
    let ((dense, glow), (slopes, down, end)) = (known, row);
    let (mut rays, end, mut seen) =
        (Rays::new(lane(slopes, at), down), lane(end, at), Seen::none());
    for (number, edges) in gas.0.edges.windows(2).enumerate() {
        rays.at(edges, &end, lane(&dense[number], at));
        let mut found = [0, 1, 2].map(|c| lane(&glow[3 * number + c], at));
        let mut exact = 0;
        for k in 0..LANES {
            // Counted, since a reduction of floats or of booleans takes no vectors.
            let rough = (end[k] < edges[1]) | found[0][k].is_nan();
            exact += u32::from((end[k] > edges[0]) & rough);
        }
        if exact > 0 && !lamps.lamps.is_empty() {
            found = near::<LEVEL>(lamps, &rays, 0.0);
        }
        seen.add::<LEVEL>(&rays, &found, gas.2[number]);
    }
    [0, 1, 2, 3].map(|part| std::array::from_fn(|k| seen.part(part, k)))
}
