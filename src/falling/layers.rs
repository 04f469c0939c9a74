//! Sheets read into a picture: layers add up, each where its flakes have moved to.
//!
//! A pixel reads every layer at its own whole-pixel offset, from the place of the sheet that is nearest
//! in quarters of a pixel. The sum goes over the layers in their order, pixel by pixel: bits don't depend
//! on threads, windows or parts.

use ndarray::{ArrayView2, ArrayViewMut2, Axis, s};

use super::gains::Gains;
use super::sheet::Sheet;
use crate::base::error::{Cancel, Error, finite, layout, pushed};
use crate::base::normal::{Normal, least, ln, most};
use crate::base::pool::{self, line};
use crate::base::simd::{dispatch, multiply_add};

/// Rounds of a torus that are told apart, at least.
const FARTHEST: f64 = 1e9;

/// Beyond this optical depth nothing is left to see.
const OPAQUE: f32 = 80.0;

/// Pixels that are weighed by a depth together, and those whose sums stay in the first cache: of a narrow picture
/// several rows, since a layer that is read row after row is foreseen.
const RUN: usize = 64;
const BLOCK: usize = 64 * RUN;

/// Pixels that are read at once, and that sheets have more at their ends.
pub const LANES: usize = 16;

#[derive(Clone, Copy)]
pub struct Layer<'a> {
    pub sheet: &'a Sheet,
    /// Pixels, x and y, by which they have moved.
    pub shift: [f64; 2],
    /// Pixels to the right by which they lean for each row down, and rows of the sheet in one of the picture's.
    pub lean: (f64, f64),
    /// Factor of the optical depth, and what is added to it.
    pub gain: (f32, f32),
    /// Depths between which they lie, evenly.
    pub near: f32,
    pub far: f32,
}

/// What hides the picture besides sheets.
#[derive(Clone, Copy, Default)]
pub struct Others<'a> {
    /// Opacities of flakes that are drawn, and the factor of their optical depth.
    pub drawn: Option<(ArrayView2<'a, f32>, f32)>,
    pub veil: Option<ArrayView2<'a, f32>>,
    pub haze: f32,
}

/// A layer at the place that a picture reads.
struct Sight<'a> {
    /// At the place, and half a pixel further right.
    bytes: [&'a [u8]; 2],
    /// Of the torus; and the pixel of it that the picture's first one reads.
    period: (usize, usize),
    shear: usize,
    from: (usize, usize),
    /// Half pixels to the right and rows of the sheet for each row, in parts of 2^-32.
    lean: i64,
    scale: u64,
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
        let half = if layer.lean.0 == 0.0 { right } else { right | 2 };
        Ok(Self {
            bytes: [sheet.place(4 * down + right, cancel)?, sheet.place(4 * down + half, cancel)?],
            period,
            shear,
            from: (row, col),
            lean: (8_589_934_592.0 * layer.lean.0) as i64,
            scale: (4_294_967_296.0 * layer.lean.1) as u64,
            gain: layer.gain.0 * sheet.stamps.unit,
            base: layer.gain.1,
            near: layer.near,
            far: layer.far,
            slope: 1.0 / (layer.far - layer.near),
        })
    }

    /// The row of a torus that a row of the picture reads, and the column of it for one of the picture's.
    #[inline(always)]
    fn row(&self, (row, col): (usize, usize)) -> (&'a [u8], usize) {
        let (rows, cols) = self.period;
        let mut at = self.from.0 + ((self.scale * row as u64) >> 32) as usize;
        let halves = (self.lean * row as i64 + (1 << 31)) >> 32;
        let mut col = (self.from.1 + col) as i64 - (halves >> 1);
        // Divisions would take longer than to read a short row.
        if at >= rows {
            col -= (at / rows * self.shear % cols) as i64;
            at %= rows;
        }
        if !(0..cols as i64).contains(&col) {
            col = col.rem_euclid(cols as i64);
        }
        (&self.bytes[(halves & 1) as usize][at * cols..][..cols + LANES], col as usize)
    }
}

/// Writes the sum of the layers' optical depths, or with `others` what all of it hides: 1 - exp(-sum) of
/// sheets alone.
///
/// `origin` is the row and column of the first pixel, counted from where sheets hang. A layer shows what
/// lies before the `depth` of a pixel, of the shape of `out`; NaN hides nothing.
pub fn read(
    out: ArrayViewMut2<'_, f32>,
    origin: [i64; 2],
    layers: &[Layer<'_>],
    depth: Option<ArrayView2<'_, f32>>,
    others: Option<Others<'_>>,
    gains: Option<Gains<'_>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    gains.map_or(Ok(()), |gains| gains.check(out.dim(), layers.len()))?;
    let (drawn, veil) = others.map_or((None, None), |others| (others.drawn, others.veil));
    let planes = [depth, drawn.map(|drawn| drawn.0), veil];
    if planes.iter().flatten().any(|plane| plane.dim() != out.dim()) {
        return Err(layout());
    }
    let beside = others.map(|others| (drawn.map_or(0.0, |drawn| drawn.1), 1.0 - others.haze));
    let mut sights = Vec::new();
    for layer in layers {
        pushed(&mut sights, Sight::new(layer, origin, cancel)?)?;
    }
    pool::for_each(pool::rows(out, pool::threads()), |(rows, mut part)| {
        let wide = part.ncols().clamp(1, BLOCK);
        let tall = BLOCK / wide.max(RUN);
        for (down, mut below) in part.axis_chunks_iter_mut(Axis(0), tall).enumerate() {
            for (across, out) in below.axis_chunks_iter_mut(Axis(1), wide).enumerate() {
                cancel.check()?;
                let at = (rows.start + down * tall, across * wide);
                let own = s![at.0..at.0 + out.nrows(), at.1..at.1 + out.ncols()];
                let planes = planes.map(|plane| plane.map(|plane| plane.slice_move(own)));
                block(out, at, &sights, planes, gains, beside).ok_or_else(layout)?;
            }
        }
        Ok(())
    })
}

/// The sum in a block of pixels, and what it hides, which wants the factor of what is drawn and the light that an
/// even veil leaves. `planes` are the depth, what is drawn and the veil.
#[dispatch]
fn block<const LEVEL: u8>(
    out: ArrayViewMut2<'_, f32>,
    at: (usize, usize),
    sights: &[Sight<'_>],
    planes: [Option<ArrayView2<'_, f32>>; 3],
    gains: Option<Gains<'_>>,
    beside: Option<(f32, f32)>,
) -> Option<()> {
    let (wide, mut out, mut sums) = (out.ncols(), out, [0.0; BLOCK + LANES]);
    let sums = &mut sums[..out.len() + LANES];
    let [depth, drawn, veil] = planes;
    let mut rest = sights;
    let counts = [sights.len()];
    let counts = gains.map_or(&counts[..], |gains| gains.counts);
    for (group, &count) in counts.iter().enumerate() {
        let (own, after) = rest.split_at(count);
        depths::<LEVEL>(sums, (wide, at), own, depth)?;
        for (row, sums) in (0..out.nrows()).zip(sums.chunks_exact(wide)) {
            let out = out.row_mut(row).into_slice()?;
            let Some(gains) = gains else {
                out.copy_from_slice(sums);
                continue;
            };
            if group == 0 {
                out.fill(0.0);
            }
            gains.add(group, (at.0 + row, at.1), out, sums);
        }
        rest = after;
    }
    let Some((gain, clear)) = beside else { return Some(()) };
    for (row, out) in out.rows_mut().into_iter().enumerate() {
        let out = out.into_slice()?;
        if let Some(drawn) = drawn {
            for (out, &drawn) in out.iter_mut().zip(line(drawn, row).ok()?) {
                *out -= gain * ln::<LEVEL>(1.0 - drawn);
            }
        }
        match veil {
            Some(veil) => {
                for (out, &veil) in out.iter_mut().zip(line(veil, row).ok()?) {
                    *out = 1.0 - clear * (1.0 - veil) * left::<LEVEL>(*out);
                }
            }
            None => {
                for out in out {
                    *out = 1.0 - clear * left::<LEVEL>(*out);
                }
            }
        }
    }
    Some(())
}

/// The sums of layers' optical depths in a block that is so wide, and begins at a row and a column.
#[inline(always)]
fn depths<const LEVEL: u8>(
    sums: &mut [f32],
    (wide, at): (usize, (usize, usize)),
    sights: &[Sight<'_>],
    depth: Option<ArrayView2<'_, f32>>,
) -> Option<()> {
    // Without walls all layers' bases are one number.
    let even = if depth.is_none() { sights.iter().map(|sight| sight.base).sum() } else { 0.0 };
    sums.fill(even);
    let each = wide.div_ceil(RUN);
    let mut bounds = [(f32::INFINITY, f32::INFINITY); 2 * BLOCK / RUN];
    if let Some(depth) = depth {
        for (row, bounds) in (0..depth.nrows()).zip(bounds.chunks_mut(each)) {
            let depth = line(depth, row).ok()?;
            for (bound, depth) in bounds.iter_mut().zip(depth.chunks(RUN)) {
                *bound = nearest_and_farthest(depth);
            }
        }
    }
    for sights in sights.chunks(4) {
        let bare = depth.is_none() || sights.iter().all(|sight| sight.base == 0.0);
        let far = sights.iter().fold(0.0, |far, sight| most(far, sight.far));
        let rows = (sums.len() - LANES) / wide;
        for (row, bounds) in (0..rows).zip(bounds.chunks(each)) {
            let (sums, at) = (&mut sums[row * wide..][..wide + LANES], (at.0 + row, at.1));
            if !bare || bounds.iter().any(|bound| bound.0 < far) {
                let depth = line(depth?, row).ok()?;
                for sight in sights {
                    added::<LEVEL>(sums, sight.row(at), sight, depth, bounds);
                }
                continue;
            }
            match sights {
                [a, b, c, d] => together::<LEVEL, 4>(sums, at, [a, b, c, d]),
                [a, b, c] => together::<LEVEL, 3>(sums, at, [a, b, c]),
                [a, b] => together::<LEVEL, 2>(sums, at, [a, b]),
                _ => together::<LEVEL, 1>(sums, at, [&sights[0]]),
            }
        }
    }
    Some(())
}

/// Adds the optical depths of some layers, all of which are before the walls, along a row of sums, which are read and
/// written once for all of them.
#[inline(always)]
fn together<const LEVEL: u8, const N: usize>(
    sums: &mut [f32],
    at: (usize, usize),
    sights: [&Sight<'_>; N],
) {
    let (wide, gains) = (sums.len() - LANES, sights.map(|sight| sight.gain));
    let (mut from, mut done) = (sights.map(|sight| sight.row(at)), 0);
    while done < wide {
        let ends = from.iter().map(|(bytes, col)| bytes.len() - LANES - col);
        let run = ends.fold(wide - done, usize::min);
        let out = &mut sums[done..][..run + LANES];
        summed::<LEVEL, N>(out, from.map(|(bytes, col)| &bytes[col..][..run + LANES]), gains);
        done += run;
        for (bytes, col) in &mut from {
            *col = if *col + run + LANES == bytes.len() { 0 } else { *col + run };
        }
    }
}

/// Adds a layer's optical depth along a row before a wall: `bytes` are a row of its sheet, from a column on, and
/// `bounds` the nearest and the farthest depth of each run. Sheets and sums have some lanes more.
#[inline(always)]
fn added<const LEVEL: u8>(
    out: &mut [f32],
    (bytes, mut col): (&[u8], usize),
    sight: &Sight<'_>,
    depth: &[f32],
    bounds: &[(f32, f32)],
) {
    let (wide, cols, mut done) = (out.len() - LANES, bytes.len() - LANES, 0);
    while done < wide {
        let (near, far) = bounds[done / RUN];
        let alike = bounds[done / RUN..].iter().take_while(|bound| bound.0 >= sight.far);
        let run = alike.count().max(1) * RUN - done % RUN;
        let run = run.min(wide - done).min(cols - col);
        if near >= sight.far {
            let out = &mut out[done..done + run + LANES];
            summed::<LEVEL, 1>(out, [&bytes[col..col + run + LANES]], [sight.gain]);
            if sight.base != 0.0 {
                out[..run].iter_mut().for_each(|out| *out += sight.base);
            }
        } else if far > sight.near {
            weighed::<LEVEL>(&mut out[done..], &bytes[col..], &depth[done..done + run], sight);
        }
        done += run;
        col = if col + run == cols { 0 } else { col + run };
    }
}

/// Adds layers' bytes times their factors, and nothing to the lanes that slices have more.
#[inline(always)]
fn summed<const LEVEL: u8, const N: usize>(out: &mut [f32], bytes: [&[u8]; N], gains: [f32; N]) {
    let (whole, odd) = ((out.len() - LANES) / LANES, out.len() % LANES);
    let lines = &mut out.as_chunks_mut::<LANES>().0[..whole + 1];
    let own = bytes.map(|one| &one.as_chunks::<LANES>().0[..whole + 1]);
    for index in 0..whole {
        let mut sum = lines[index];
        for layer in 0..N {
            lanes::<LEVEL>(&mut sum, &own[layer][index], gains[layer]);
        }
        lines[index] = sum;
    }
    if odd > 0 {
        let there = u128::MAX >> (8 * (LANES - odd));
        for layer in 0..N {
            let bytes = (u128::from_le_bytes(own[layer][whole]) & there).to_le_bytes();
            lanes::<LEVEL>(&mut lines[whole], &bytes, gains[layer]);
        }
    }
}

#[inline(always)]
fn lanes<const LEVEL: u8>(out: &mut [f32; LANES], bytes: &[u8; LANES], gain: f32) {
    for lane in 0..LANES {
        out[lane] = multiply_add::<f32, LEVEL>(f32::from(bytes[lane]), gain, out[lane]);
    }
}

/// The light that an optical depth leaves.
#[inline(always)]
pub fn left<const LEVEL: u8>(depth: f32) -> f32 {
    f32::exp_at::<LEVEL>(-most(least(depth, OPAQUE), 0.0))
}

/// Of a run of depths; NaN hides nothing, as what is infinitely far.
#[inline(always)]
fn nearest_and_farthest(depth: &[f32]) -> (f32, f32) {
    // Bits as whole numbers have the order of depths before the camera; behind it all hide alike.
    let number =
        |&depth: &f32| if depth.is_nan() { f32::INFINITY } else { depth }.to_bits().cast_signed();
    let ends = |(near, far): (i32, i32), depth: i32| (near.min(depth), far.max(depth));
    let (near, far) = depth.iter().map(number).fold((i32::MAX, i32::MIN), ends);
    (f32::from_bits(near.cast_unsigned()), f32::from_bits(far.cast_unsigned()))
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
