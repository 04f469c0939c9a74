//! Sheets read into a picture: layers add up, each where its flakes have moved to.
//!
//! A pixel reads every layer at its own whole-pixel offset, from the place of the sheet that is nearest
//! in quarters of a pixel. The sum goes over the layers in their order, pixel by pixel: bits don't depend
//! on threads, windows or parts.

use std::ops::Range;

use ndarray::{ArrayView2, ArrayViewMut2, Axis};

use super::sheet::Sheet;
use crate::base::error::{Cancel, Error, finite, pushed};
use crate::base::normal::{Normal, least, most};
use crate::base::pool;
use crate::base::simd::{dispatch, multiply_add};

/// Rounds of a torus that are told apart, at least.
const FARTHEST: f64 = 1e9;

/// Beyond this optical depth nothing is left to see.
const OPAQUE: f32 = 80.0;

/// Pixels that are weighed by a depth together, and pixels whose sums stay in the first cache.
const RUN: usize = 64;
const BLOCK: usize = 16 * RUN;

/// A sheet in a picture.
#[derive(Clone, Copy)]
pub struct Layer<'a> {
    /// Its flakes.
    pub sheet: &'a Sheet,
    /// Pixels, x and y, by which they have moved.
    pub shift: [f64; 2],
    /// Factor of the optical depth, and what is added to it.
    pub gain: f32,
    /// See `gain`.
    pub base: f32,
    /// Depths between which they lie, evenly.
    pub near: f32,
    /// See `near`.
    pub far: f32,
}

/// A layer at the place that a picture reads.
struct Sight<'a> {
    bytes: &'a [u8],
    /// Of the torus; and the pixel of it that the picture's first one reads.
    period: (usize, usize),
    shear: usize,
    from: (usize, usize),
    /// Optical depth of a step, and of none.
    gain: f32,
    base: f32,
    near: f32,
    far: f32,
    /// Of the slab's share before a wall.
    slope: f32,
}

impl<'a> Sight<'a> {
    fn new(layer: &Layer<'a>, origin: [i64; 2], cancel: &Cancel) -> Result<Self, Error> {
        finite("gain", layer.gain.into())?;
        finite("base", layer.base.into())?;
        finite("near", layer.near.into())?;
        if layer.far < layer.near || layer.far.is_nan() {
            let words = format!("must be {} or more, got {}", layer.near, layer.far);
            return Err(Error::invalid("far", words));
        }
        let sheet = layer.sheet;
        let period = sheet.law.period;
        // The place within a pixel, and the pixel that is read, as far as the torus and how often it has
        // wrapped before.
        let axis = |shift: f64, period: usize, origin: i64| {
            let period = period as i64;
            let quarters = finite("shift", libm::floor(4.0 * shift + 0.5))?;
            let most = 4.0 * period as f64 * FARTHEST;
            let quarters = libm::fmod(quarters, most) as i64;
            let pixel = origin - quarters.div_euclid(4);
            let (at, rounds) = (pixel.rem_euclid(period), pixel.div_euclid(period));
            Ok((quarters.rem_euclid(4) as usize, at as usize, rounds))
        };
        let (down, row, rounds) = axis(layer.shift[1], period.0, origin[0])?;
        let (right, col, _) = axis(layer.shift[0], period.1, origin[1])?;
        let (shear, cols) = (sheet.law.shear, period.1 as i64);
        let aside = (rounds.rem_euclid(cols) * shear as i64).rem_euclid(cols);
        let col = (col as i64 - aside).rem_euclid(cols) as usize;
        Ok(Self {
            bytes: sheet.place(4 * down + right, cancel)?,
            period,
            shear,
            from: (row, col),
            gain: layer.gain * sheet.stamps.unit,
            base: layer.base,
            near: layer.near,
            far: layer.far,
            slope: 1.0 / (layer.far - layer.near),
        })
    }
}

/// Writes the sum of the layers' optical depths, or with `opacity` what it hides, 1 - exp(-sum).
///
/// `origin` is the row and column of the first pixel, counted from where sheets hang. A layer shows what
/// lies before the `depth` of a pixel, of the shape of `out`; NaN hides nothing.
pub fn read(
    mut out: ArrayViewMut2<'_, f32>,
    origin: [i64; 2],
    layers: &[Layer<'_>],
    depth: Option<ArrayView2<'_, f32>>,
    opacity: bool,
    cancel: &Cancel,
) -> Result<(), Error> {
    let layout = || Error::Internal("planes must be contiguous and of one shape".into());
    if depth.is_some_and(|depth| depth.dim() != out.dim()) {
        return Err(layout());
    }
    let mut sights = Vec::new();
    for layer in layers {
        pushed(&mut sights, Sight::new(layer, origin, cancel)?)?;
    }
    let mut tasks = Vec::new();
    for rows in pool::split(out.nrows(), pool::threads()) {
        let (part, rest) = out.split_at(Axis(0), rows.len());
        out = rest;
        pushed(&mut tasks, (rows, part))?;
    }
    pool::for_each(tasks, |(rows, mut part): (Range<usize>, ArrayViewMut2<'_, f32>)| {
        for (row, mut out) in rows.zip(part.rows_mut()) {
            cancel.check()?;
            let out = out.as_slice_mut().ok_or_else(layout)?;
            let depth = match &depth {
                Some(depth) => Some(depth.row(row).to_slice().ok_or_else(layout)?),
                None => None,
            };
            for (index, out) in out.chunks_mut(BLOCK).enumerate() {
                let col = index * BLOCK;
                let depth = depth.map(|depth| &depth[col..col + out.len()]);
                block(out, (row, col), &sights, depth, opacity);
            }
        }
        Ok(())
    })
}

#[inline(always)]
fn block_with<const LEVEL: u8>(
    out: &mut [f32],
    at: (usize, usize),
    sights: &[Sight<'_>],
    depth: Option<&[f32]>,
    opacity: bool,
) {
    // Without walls all layers' bases are one number.
    let bases = if depth.is_none() { sights.iter().map(|sight| sight.base).sum() } else { 0.0 };
    out.fill(bases);
    let mut bounds = [(f32::INFINITY, f32::INFINITY); BLOCK / RUN];
    for (bound, depth) in bounds.iter_mut().zip(depth.unwrap_or(&[]).chunks(RUN)) {
        *bound = nearest_and_farthest(depth);
    }
    for sight in sights {
        let (row, rounds) =
            ((sight.from.0 + at.0) % sight.period.0, (sight.from.0 + at.0) / sight.period.0);
        let bytes = &sight.bytes[row * sight.period.1..][..sight.period.1];
        let aside = rounds * sight.shear % sight.period.1;
        let mut col = (sight.from.1 + at.1 + sight.period.1 - aside) % sight.period.1;
        let mut done = 0;
        while done < out.len() {
            let mut run = (out.len() - done).min(bytes.len() - col);
            if let Some(depth) = depth {
                let (near, far) = bounds[done / RUN];
                let open = bounds[done / RUN..].iter().take_while(|bound| bound.0 >= sight.far);
                run = run.min(open.count().max(1) * RUN - done % RUN);
                if near < sight.far {
                    if far > sight.near {
                        let depth = &depth[done..done + run];
                        let (out, bytes) = (&mut out[done..done + run], &bytes[col..col + run]);
                        weighed::<LEVEL>(out, bytes, depth, sight);
                    }
                    (done, col) = (done + run, (col + run) % sight.period.1);
                    continue;
                }
            }
            let (out, bytes) = (&mut out[done..done + run], &bytes[col..col + run]);
            for (out, &byte) in out.iter_mut().zip(bytes) {
                *out = multiply_add::<f32, LEVEL>(f32::from(byte), sight.gain, *out);
            }
            if depth.is_some() && sight.base != 0.0 {
                out.iter_mut().for_each(|out| *out += sight.base);
            }
            (done, col) = (done + run, (col + run) % sight.period.1);
        }
    }
    if opacity {
        for out in out {
            let sum = most(least(*out, OPAQUE), 0.0);
            *out = 1.0 - f32::exp_at::<LEVEL>(-sum);
        }
    }
}

/// Of a run of depths; NaN hides nothing, as what is infinitely far.
#[inline(always)]
fn nearest_and_farthest(depth: &[f32]) -> (f32, f32) {
    const LANES: usize = 16;
    let (mut near, mut far) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
    let take = |near: &mut f32, far: &mut f32, depth: f32| {
        let depth = if depth.is_nan() { f32::INFINITY } else { depth };
        (*near, *far) = (least(*near, depth), most(*far, depth));
    };
    let (whole, rest) = depth.as_chunks::<LANES>();
    for depth in whole {
        for lane in 0..LANES {
            take(&mut near[lane], &mut far[lane], depth[lane]);
        }
    }
    rest.iter().for_each(|&depth| take(&mut near[0], &mut far[0], depth));
    (near.into_iter().fold(f32::INFINITY, least), far.into_iter().fold(f32::NEG_INFINITY, most))
}

/// Adds a layer by its share before a wall. Shares are exactly 0 and 1 outside the slab, so that it does
/// not matter which pixels came this way.
#[inline(always)]
fn weighed<const LEVEL: u8>(out: &mut [f32], bytes: &[u8], depth: &[f32], sight: &Sight<'_>) {
    for ((out, &byte), &depth) in out.iter_mut().zip(bytes).zip(depth) {
        let share = most(least((depth - sight.near) * sight.slope, 1.0), 0.0);
        let share = if depth < sight.far { share } else { 1.0 };
        *out = multiply_add::<f32, LEVEL>(f32::from(byte), sight.gain * share, *out);
        *out += sight.base * share;
    }
}

dispatch! {
    fn block(
        out: &mut [f32],
        at: (usize, usize),
        sights: &[Sight<'_>],
        depth: Option<&[f32]>,
        opacity: bool,
    ) = block_with
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, s};

    use super::super::sheet::Law;
    use super::*;
    use crate::base::scope::Scope;
    use crate::base::simd::PORTABLE;

    static CANCEL: Cancel = Cancel::new();

    /// Three layers before a wall with gaps, of pictures of 70 x 1300.
    fn scene(sheets: &[Sheet]) -> (Vec<Layer<'_>>, Array2<f32>) {
        let layer = |(i, sheet)| {
            let i: usize = i;
            let near = 2.0 + i as f32;
            Layer {
                sheet,
                shift: [i as f64 * 7.3, -2.0],
                gain: 0.7,
                base: 0.0,
                near,
                far: near + 1.0,
            }
        };
        let depth = Array2::from_shape_fn((70, 1300), |(row, col)| match (row + col) % 11 {
            0 if row % 3 == 0 => f32::NAN,
            1 if row % 5 == 0 => f32::INFINITY,
            _ => 1.0 + col as f32 / 300.0,
        });
        (sheets.iter().enumerate().map(layer).collect(), depth)
    }

    fn sheets() -> Vec<Sheet> {
        let law = |i: usize| Law {
            seed: i as u64,
            period: (150 + i, 400 - 31 * i),
            shear: 0,
            count: 0.2,
            diameters: vec![0.6, 1.2],
            streak: [1.0, 2.0],
            circle: 0.0,
            tau0: 4.3,
            ranks: (0.0, 1.0),
        };
        (0..3).map(|i| Sheet::new(law(i)).unwrap()).collect()
    }

    #[test]
    fn a_wall_hides_what_lies_behind_it() {
        let sheets = sheets();
        let (layers, depth) = scene(&sheets);
        let mut out = Array2::zeros(depth.dim());
        read(out.view_mut(), [0, 0], &layers, Some(depth.view()), true, &CANCEL).unwrap();
        let alone = |&layer: &Layer<'_>| {
            let mut out = Array2::from_elem(depth.dim(), f32::NAN);
            read(out.view_mut(), [0, 0], &[layer], None, false, &CANCEL).unwrap();
            out
        };
        let each: Vec<_> = layers.iter().map(alone).collect();
        for (at, &got) in out.indexed_iter() {
            let share = |layer: &Layer<'_>| {
                let share = f64::from((depth[at] - layer.near) / (layer.far - layer.near));
                if share.is_nan() { 1.0 } else { share.clamp(0.0, 1.0) }
            };
            let sum: f64 = layers.iter().zip(&each).map(|(l, e)| share(l) * f64::from(e[at])).sum();
            assert!((f64::from(got) + (-sum).exp_m1()).abs() < 1e-6, "{at:?} {got} {sum}");
        }
    }

    #[test]
    fn bits_do_not_depend_on_threads_windows_or_vectors() {
        let run = |threads, reproducible| {
            let scope = Scope { threads: Some(threads), reproducible: Some(reproducible) };
            let _entered = scope.enter();
            let sheets = sheets();
            let (layers, depth) = scene(&sheets);
            let mut whole = Array2::zeros(depth.dim());
            read(whole.view_mut(), [3, -9], &layers, Some(depth.view()), true, &CANCEL).unwrap();
            let window = s![13..60, 101..1207];
            let (mut part, depth) = (Array2::zeros((47, 1106)), depth.slice(window).to_owned());
            read(part.view_mut(), [16, 92], &layers, Some(depth.view()), true, &CANCEL).unwrap();
            assert_eq!(part, whole.slice(window));
            whole
        };
        assert_eq!(run(1, false), run(4, false));
        let reproducible = run(3, true);
        let sheets = sheets();
        let (layers, depth) = scene(&sheets);
        let sights: Vec<_> =
            layers.iter().map(|layer| Sight::new(layer, [3, -9], &CANCEL).unwrap()).collect();
        for (row, depth) in depth.rows().into_iter().enumerate() {
            let (mut out, depth) = ([0.0; BLOCK], &depth.to_slice().unwrap()[..BLOCK]);
            block_with::<PORTABLE>(&mut out, (row, 0), &sights, Some(depth), true);
            assert_eq!(reproducible.row(row).as_slice().unwrap()[..BLOCK], out);
        }
    }
}
