//! Sheets read into a picture: layers add up, each where its flakes have moved to.
//!
//! A pixel reads every layer at its own whole-pixel offset, from the place of the sheet that is nearest
//! in quarters of a pixel. The sum goes over the layers in their order, pixel by pixel: bits don't depend
//! on threads, windows or parts.

use ndarray::{ArrayView2, ArrayViewMut2};

use super::sheet::Sheet;
use crate::base::error::{Cancel, Error, finite, layout, pushed};
use crate::base::normal::{Normal, least, most, polynomial_at};
use crate::base::pool::{self, line};
use crate::base::simd::{dispatch, multiply_add};

/// Rounds of a torus that are told apart, at least.
const FARTHEST: f64 = 1e9;

/// Beyond this optical depth nothing is left to see.
const OPAQUE: f32 = 80.0;

/// Pixels that are weighed by a depth together, and pixels whose sums stay in the first cache.
const RUN: usize = 64;
const BLOCK: usize = 16 * RUN;

#[derive(Clone, Copy)]
pub struct Layer<'a> {
    pub sheet: &'a Sheet,
    /// Pixels, x and y, by which they have moved.
    pub shift: [f64; 2],
    /// Factor of the optical depth, and what is added to it.
    pub gain: f32,
    pub base: f32,
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
    cancel: &Cancel,
) -> Result<(), Error> {
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
        for (row, mut out) in rows.zip(part.rows_mut()) {
            cancel.check()?;
            let out = out.as_slice_mut().ok_or_else(layout)?;
            let mut lines = [None; 3];
            for (own, plane) in lines.iter_mut().zip(planes) {
                *own = plane.map(|plane| line(plane, row)).transpose()?;
            }
            for (index, out) in out.chunks_mut(BLOCK).enumerate() {
                let own = index * BLOCK..index * BLOCK + out.len();
                let lines = lines.map(|line| line.map(|line| &line[own.clone()]));
                block(out, (row, own.start), &sights, lines, beside);
            }
        }
        Ok(())
    })
}

/// The sum along some pixels of a row, and what it hides, which wants the factor of what is drawn and the light that an
/// even veil leaves. `lines` are those of the depth, of what is drawn and of the veil.
#[dispatch]
fn block<const LEVEL: u8>(
    out: &mut [f32],
    at: (usize, usize),
    sights: &[Sight<'_>],
    lines: [Option<&[f32]>; 3],
    beside: Option<(f32, f32)>,
) {
    let [depth, drawn, veil] = lines;
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
    let Some((gain, clear)) = beside else { return };
    if let Some(drawn) = drawn {
        for (out, &drawn) in out.iter_mut().zip(drawn) {
            *out -= gain * ln::<LEVEL>(1.0 - drawn);
        }
    }
    match veil {
        Some(veil) => {
            for (out, &veil) in out.iter_mut().zip(veil) {
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

/// The light that an optical depth leaves.
#[inline(always)]
pub fn left<const LEVEL: u8>(depth: f32) -> f32 {
    f32::exp_at::<LEVEL>(-most(least(depth, OPAQUE), 0.0))
}

/// The natural logarithm of a number from 0 to 1, and a large negative number of 0.
///
/// 2 artanh(y) of y = (m - 1) / (m + 1), for a mantissa m from the root of 1/2 to that of 2.
#[inline(always)]
fn ln<const LEVEL: u8>(x: f32) -> f32 {
    let bits = most(x, 1e-36).to_bits();
    let steps = bits.wrapping_sub(0x3F35_04F3) as i32 >> 23;
    let m = f32::from_bits(bits.wrapping_sub((steps << 23) as u32));
    let y = (m - 1.0) / (m + 1.0);
    let odd = polynomial_at::<f32, 5, LEVEL>([2.0 / 9.0, 2.0 / 7.0, 0.4, 2.0 / 3.0, 2.0], y * y);
    multiply_add::<f32, LEVEL>(steps as f32, std::f32::consts::LN_2, y * odd)
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

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::super::sheet::tests::law;
    use super::super::stamp::Law;
    use super::*;

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
        let one = |i: usize| Law {
            seed: i as u64,
            ..law(0.2, &[0.6, 1.2], [1.0, 2.0], (150 + i, 400 - 31 * i))
        };
        (0..3).map(|i| Sheet::new(one(i)).unwrap()).collect()
    }

    #[test]
    fn a_wall_hides_what_lies_behind_it() {
        let sheets = sheets();
        let (layers, depth) = scene(&sheets);
        let mut out = Array2::zeros(depth.dim());
        read(out.view_mut(), [0, 0], &layers, Some(depth.view()), Some(Others::default()), &CANCEL)
            .unwrap();
        let alone = |&layer: &Layer<'_>| {
            let mut out = Array2::from_elem(depth.dim(), f32::NAN);
            read(out.view_mut(), [0, 0], &[layer], None, None, &CANCEL).unwrap();
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
    fn it_hides_what_the_product_of_all_does() {
        let sheets = sheets();
        let (layers, _) = scene(&sheets);
        let plane =
            |k: usize| Array2::from_shape_fn((9, 1150), |(i, j)| ((k * i + j) % 17) as f32 / 16.0);
        let (drawn, veil) = (plane(3), plane(5));
        let mut sum = Array2::zeros(drawn.dim());
        read(sum.view_mut(), [0, 0], &layers, None, None, &CANCEL).unwrap();
        for gain in [1.0, 2.7, 40.0] {
            let both =
                Others { drawn: Some((drawn.view(), gain)), veil: Some(veil.view()), haze: 0.1 };
            let mut out = Array2::zeros(drawn.dim());
            read(out.view_mut(), [0, 0], &layers, None, Some(both), &CANCEL).unwrap();
            for (at, &got) in out.indexed_iter() {
                let flakes = (1.0 - f64::from(drawn[at])).powf(gain.into());
                let left = 0.9 * (1.0 - f64::from(veil[at])) * flakes;
                let wanted = 1.0 - left * (-f64::from(sum[at])).exp();
                assert!((f64::from(got) - wanted).abs() < 1e-6, "{at:?} {got} {wanted}");
            }
        }
    }
}
