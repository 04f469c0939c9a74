//! The light of lamps that slices of gas scatter towards the eye: once, with extinction on both ways.
//!
//! L = sum over slices of T * k * what `beam` finds, T the transmittance up to the slice, k its extinction there.
//!
//! Of a slice of even gas that integral is smooth over the picture: it is found at every fourth sample of the slices' coarse
//! grid, with its slopes by extinction, from which that of a sample's own gas follows, but near a lamp and in rough gas.
//! L over 1 - T of all slices is smooth as well: coarse samples give it, but nearest to a lamp, in the light of a spot and
//! where the scene ends a slice, which each pixel adds up by itself.

use ndarray::{Array3, ArrayView2, ArrayViewMut2, ArrayViewMut3, Axis, s};

use super::beam::{LANES, Lane, Rays, moments, near, suns};
use super::slices::{COARSE, MARGIN, Slices, fill, lines};
use crate::base::error::{Cancel, Error, layout, zeroed};
use crate::base::lamps::{Lamps, left};
use crate::base::normal::most;
use crate::base::pool;
use crate::base::simd::dispatch;

/// Rows of pixels of one task.
const BAND: usize = 64;

/// Coarse samples from one whose light is found in even gas to the next.
const APART: usize = 4;

/// A lamp that is nearer than so many coarse samples wants each of them, and nearer than so many each pixel.
const STEEP: [f32; 2] = [24.0, 7.0];

/// Weights of the four values around a place by its distance from the second, by Catmull and Rom.
const AROUND: [[f32; 4]; APART] = [
    [0.0, 1.0, 0.0, 0.0],
    [-0.0703125, 0.8671875, 0.2265625, -0.0234375],
    [-0.0625, 0.5625, 0.5625, -0.0625],
    [-0.0234375, 0.2265625, 0.8671875, -0.0703125],
];

/// Gas wants its own light where the variance of its optical depth by the way of light, times what reaches the eye from
/// there, is more than this: the third power of the depth then counts for a hundredth.
const ROUGH: f32 = 0.1;

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
    let even: Vec<f32> = slices.density.outer_iter().filter_map(|plane| plane.mean()).collect();
    let wide = 9 * count * (columns.div_ceil(LANES) * (LANES / APART) + 3);
    let mut spaces = vec![zeroed(wide)?; rows.div_ceil(APART) + 3];
    let filled = spaces.iter_mut().enumerate().take(if lit { rows + 3 } else { 0 });
    pool::for_each(filled, |(row, out)| {
        cancel.check()?;
        spaced(gas, lamps, &even, row, out);
        Ok(())
    })?;
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
        let last = (first + BAND / COARSE + 2 * MARGIN).min(rows);
        let shape = (3 * count + 4, last - first, columns);
        let coarse = zeroed(shape.0 * shape.1 * shape.2)?;
        let mut coarse = Array3::from_shape_vec(shape, coarse).map_err(|_| layout())?;
        let mut between = zeroed(wide)?;
        for (row, at) in (first..last).enumerate() {
            between.fill(0.0);
            for (line, weight) in spaces[at / APART..].iter().zip(AROUND[at % APART]) {
                between.iter_mut().zip(line).for_each(|(out, value)| *out += weight * value);
            }
            samples(gas, lamps, (&even, &between), at, coarse.index_axis_mut(Axis(1), row));
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

/// Fills a line with what even slices have at every fourth sample of a fourth row, and beyond the last: the light of red,
/// green and blue over its extinction and what reaches the eye, mean and variance of its ways; NaN nearer to a lamp.
#[dispatch]
fn spaced<const LEVEL: u8>(gas: Gas<'_>, lamps: &Lamps, even: &[f32], row: usize, out: &mut [f32]) {
    let ((slices, grid, middles), out) = (gas, out);
    let (width, reach) = (out.len() / (9 * middles.len()), STEEP[0] * apart(grid));
    let place = |l: &[f32], at: usize| l[0] + (l[1] - l[0]) * APART as f32 * (at as f32 - 1.0);
    for at in (0..width).step_by(LANES) {
        let slopes = std::array::from_fn(|k| place(grid.0, at + k));
        let mut rays = Rays::new(slopes, place(grid.1, row));
        for (number, &even) in even.iter().enumerate() {
            rays.at(&slices.edges[number..], &[f32::INFINITY; LANES], [even; LANES]);
            for (c, found) in moments::<LEVEL>(lamps, &rays, reach).iter().enumerate() {
                for k in 0..LANES.min(width - at) {
                    let [light, once, twice] = found.map(|moment| moment[k]);
                    let [way, square] = [once, twice].map(|moment| moment / most(light, 1e-30));
                    let said = [light, way, most(square - way * way, 0.0)];
                    for (part, said) in said.into_iter().enumerate() {
                        out[(9 * number + 3 * c + part) * width + at + k] = said;
                    }
                }
            }
        }
    }
}

/// Fills a row of coarse samples with the light of lamps in each slice over its extinction and what reaches the eye, red, green
/// and blue of one after the other, of a line of what even gas has there; and the last four lines with what is [`Seen`] of
/// all slices. NaN is left nearest to a lamp.
#[dispatch]
fn samples<const LEVEL: u8>(
    gas: Gas<'_>,
    lamps: &Lamps,
    even: (&[f32], &[f32]),
    row: usize,
    out: ArrayViewMut2<'_, f32>,
) {
    let ((slices, grid, middles), mut out) = (gas, out);
    let (last, width) = (grid.0.len() - 1, even.1.len() / (9 * middles.len()));
    for at in (0..=last).step_by(LANES) {
        let columns: [usize; LANES] = std::array::from_fn(|k| (at + k).min(last));
        let mut rays = Rays::new(columns.map(|column| grid.0[column]), grid.1[row]);
        let mut seen = Seen::none();
        for (number, &middle) in middles.iter().enumerate() {
            let own = columns.map(|column| slices.density[[number, row, column]]);
            rays.at(&slices.edges[number..], &[f32::INFINITY; LANES], own);
            let (mut found, mut exact) = (suns::<LEVEL>(lamps, &rays), 0);
            for c in 0..3 {
                let [light, way, spread] = [0, 1, 2].map(|part| {
                    let from = (9 * number + 3 * c + part) * width + at / APART;
                    between(&even.1[from..from + LANES / APART + 3])
                });
                for k in 0..LANES {
                    let more = own[k] - even.0[number];
                    let mean = most(way[k] - 0.5 * more * spread[k], 0.5 * way[k]);
                    let rough = more * more * spread[k] * seen.through[k] > ROUGH;
                    exact += u32::from(rough | light[k].is_nan());
                    found[c][k] += light[k] * left::<f32, LEVEL>(more * mean);
                }
            }
            if exact > 0 {
                found = near::<LEVEL>(lamps, &rays, STEEP[1] * apart(grid));
            }
            seen.add::<LEVEL>(&rays, &found, middle);
            for (k, column) in (at..=last).take(LANES).enumerate() {
                (0..3).for_each(|c| out[[3 * number + c, column]] = found[c][k]);
            }
        }
        for (k, column) in (at..=last).take(LANES).enumerate() {
            (0..4).for_each(|part| out[[3 * middles.len() + part, column]] = seen.part(part, k));
        }
    }
}

/// What lies between values that are [`APART`].
#[inline(always)]
fn between(values: &[f32]) -> Lane {
    std::array::from_fn(|k| {
        let ([a, b, c, d], at) = (AROUND[k % APART], &values[k / APART..]);
        a * at[0] + b * at[1] + (c * at[2] + d * at[3])
    })
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
