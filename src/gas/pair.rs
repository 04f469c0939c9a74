//! Both eyes at once: what the second eye may see with a small error is drawn for less.
//!
//! Eyes side by side see a particle at depth D `f I / D` px apart. Particles whose disparities differ
//! by at most twice `slab` px are drawn into one impostor, which the first eye takes as it is and the
//! second one shifted by the middle disparity: none of them is off by more than `slab` px. Only the
//! gas of one colour can be done so, since the eyes' transmittances are products of the slabs'.
//! Particles that are small, close, or cut off by what stands in the picture are drawn for each eye.
//!
//! A slab costs some additions and multiplications for every pixel, a particle three for each of its
//! own. Where disparities are many, the second eye sees its large particles at half the resolution
//! (see [`super::coarse`]), each in its own place; where particles are few, all as the first eye does.
//! A count of operations says which of the three is least work, and never a clock.

use std::ops::Range;

use ndarray::{ArrayView2, ArrayViewMut2, Axis};

use super::bins::{Bands, Entry};
use super::coarse;
use super::draw::{Drawing, TILE};
use super::splat::{Cloud, Picture, alpha, alpha_of, check_all, sprites};
use super::sprite::{Eye, Form, Look, Sprite};
use crate::base::error::{Cancel, Error, collected, pushed, zeroed};
use crate::base::normal::{Normal, least, most};
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::dispatch;

/// A footprint of a smaller radius (px) is not shifted: between pixels its shape would suffer.
const LEAST_RADIUS: f64 = 8.0;

/// Operations for each pixel of a slab, where drawing a pixel of a particle is 1: measured.
const SLAB_COST: f64 = 9.0;

/// Pixels on either side that shifts by parts of a pixel look at.
const TAPS: f64 = 2.0;

/// What was done about the second eye.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Done {
    /// Slabs that were shifted; 0 if drawing for either eye was cheaper.
    pub slabs: usize,
    /// Particles in them.
    pub shifted: usize,
}

/// What the eyes have in common.
struct Both<'a, 'c> {
    cloud: &'a Cloud<'c>,
    eyes: [&'a Eye; 2],
    look: &'a Look,
    shape: (usize, usize),
    /// Depth of the nearest thing that stands in one of the pictures.
    nearest: f64,
}

impl Both<'_, '_> {
    /// How far to the right the second eye sees what is at `depth`, px.
    fn disparity(&self, depth: f64) -> f64 {
        let [left, right] = self.eyes;
        let apart = right.offset[0] - left.offset[0];
        right.center[0] - left.center[0] - left.focal * apart / depth
    }

    /// The slab, of twice `slab` px, that holds this depth.
    fn number(&self, depth: f64, slab: f64) -> i64 {
        (self.disparity(depth) / (2.0 * slab)).round() as i64
    }

    /// Whether a particle is a product of two sampled Gaussians and nothing cuts it off.
    fn plain<P: Normal>(&self, sprite: &Sprite) -> bool {
        let [_, _, depth] = sprite.place;
        let clear = depth + P::SATURATED * sprite.sigma < self.nearest;
        let clear = clear && depth > self.look.near.max(3.0 * sprite.sigma);
        sprite.form == Form::Point && !sprite.model.by_ray() && clear
    }
}

/// The particles that fit into slabs, and those that do not.
struct Slabs {
    /// The first eye, with the columns that only the second one sees.
    wide: Eye,
    shape: (usize, usize),
    pad: usize,
    all: Vec<Sprite>,
    /// Places of those that fit, by slab.
    order: Vec<u32>,
    /// Parts of `order`, and the disparity in the middle of each.
    slabs: Vec<(Range<usize>, f64)>,
    rest: Vec<bool>,
}

impl Slabs {
    /// Sorts particles into slabs of at most twice `slab` px; None if the eyes see too far apart.
    fn of<P: Normal>(
        both: &Both<'_, '_>,
        slab: f64,
        cancel: &Cancel,
    ) -> Result<Option<Self>, Error> {
        let Both { cloud, eyes: [left, _], look, shape, .. } = *both;
        let reach = (0..cloud.centers.nrows())
            .map(|index| cloud.get(index))
            .map(|particle| (particle.center[2] - left.offset[2], particle.radius))
            .filter(|&(depth, radius)| depth > look.near.max(radius))
            .map(|(depth, _)| both.disparity(depth).abs())
            .fold(0.0, f64::max);
        let pad = (reach + TAPS).ceil() as usize;
        if pad > shape.1 / 4 {
            return Ok(None);
        }
        let center = [left.center[0] + pad as f64, left.center[1]];
        let wide = Eye { center, margin: pad, ..*left };
        let wider = (shape.0, shape.1 + 2 * pad);
        let all = sprites(cloud, &wide, look, wider, cancel)?;
        let fits = |sprite: &Sprite| both.plain::<P>(sprite) && sprite.radius >= LEAST_RADIUS;
        let number =
            |k: u32| (both.disparity(all[k as usize].place[2]) / (2.0 * slab)).round() as i64;
        let mut order: Vec<u32> = collected(0..all.len() as u32)?;
        order.retain(|&k| fits(&all[k as usize]));
        order.sort_by_key(|&k| number(k));
        let mut slabs = Vec::new();
        let mut start = 0;
        for end in 1..=order.len() {
            if end == order.len() || number(order[end]) != number(order[start]) {
                slabs.push((start..end, 2.0 * slab * number(order[start]) as f64));
                start = end;
            }
        }
        let rest = collected((0..all.len()).map(|k| !fits(&all[k])))?;
        Ok(Some(Self { wide, shape: wider, pad, all, order, slabs, rest }))
    }
}

/// Operations that slabs add for the second eye, which sees these particles.
fn slab_work<P: Normal>(both: &Both<'_, '_>, seen: &[Sprite], slab: f64) -> Result<f64, Error> {
    let fits = |s: &Sprite| both.plain::<P>(s) && s.radius >= LEAST_RADIUS;
    let mut numbers =
        collected(seen.iter().map(|s| fits(s).then(|| both.number(s.place[2], slab))))?;
    numbers.sort_unstable();
    numbers.dedup();
    let slabs = numbers.iter().flatten().count() as f64;
    let rest: f64 = seen.iter().filter(|s| !fits(s)).map(area_of).sum();
    Ok(slabs * SLAB_COST * (both.shape.0 * both.shape.1) as f64 + rest)
}

/// Draws the alphas that two eyes see, (H, W) each. The eyes differ in x alone.
pub fn pair<P: Normal, M: Real>(
    mut outs: [ArrayViewMut2<'_, P>; 2],
    cloud: &Cloud<'_>,
    eyes: [&Eye; 2],
    look: &Look,
    depths: [Option<ArrayView2<'_, M>>; 2],
    slab: f64,
    cancel: &Cancel,
) -> Result<Done, Error> {
    let shape = outs[0].dim();
    for (eye, depth) in eyes.iter().zip(&depths) {
        check_all(shape, cloud, eye, look, depth.as_ref())?;
    }
    let [left, right] = eyes;
    let aligned = left.focal == right.focal
        && left.offset[1..] == right.offset[1..]
        && left.center[1] == right.center[1];
    if outs[1].dim() != shape || !aligned {
        return Err(Error::invalid("cameras", "must be two eyes side by side"));
    }
    if !(slab > 0.0 && slab.is_finite()) {
        return Err(Error::invalid("slab", format!("must be positive, got {slab}")));
    }
    let nearest = depths.iter().flatten().flatten().fold(f64::INFINITY, |a, v| a.min(v.wide()));
    let both = Both { cloud, eyes, look, shape, nearest };
    let pixels = (shape.0 * shape.1) as f64;
    let seen = sprites(cloud, right, look, shape, cancel)?;
    let large = |s: &Sprite| both.plain::<P>(s) && s.radius >= coarse::LEAST_RADIUS;
    let whole = seen.iter().map(area_of).sum::<f64>();
    let quarter = seen.iter().filter(|s| large(s)).map(area_of).sum::<f64>();
    let halved = coarse::COST * pixels + 0.25 * quarter + (whole - quarter);
    let pays = slab_work::<P>(&both, &seen, slab)? < whole.min(halved);
    if let Some(slabs) = if pays { Slabs::of::<P>(&both, slab, cancel)? } else { None } {
        let [depth_left, depth_right] = depths;
        for ((out, eye), depth) in outs.iter_mut().zip(eyes).zip([depth_left, depth_right]) {
            some(out.view_mut(), cloud, eye, look, depth, &slabs.rest, cancel)?;
        }
        return shifted_slabs(outs, &slabs, look, cancel);
    }
    let [out_left, mut out_right] = outs;
    let [depth_left, depth_right] = depths;
    alpha(out_left, cloud, left, look, depth_left, cancel)?;
    if halved < whole {
        let (large, small): (Vec<Sprite>, Vec<Sprite>) = seen.into_iter().partition(large);
        let fresh = small.iter().all(|sprite| sprite.rows[0] >= sprite.rows[1]);
        if !fresh {
            alpha_of(out_right.view_mut(), &small, right, look, depth_right, cancel)?;
        }
        coarse::over(out_right, &large, right, look, fresh, cancel)?;
    } else {
        alpha_of(out_right, &seen, right, look, depth_right, cancel)?;
    }
    Ok(Done { slabs: 0, shifted: 0 })
}

/// Draws each slab once over both pictures.
fn shifted_slabs<P: Normal>(
    outs: [ArrayViewMut2<'_, P>; 2],
    slabs: &Slabs,
    look: &Look,
    cancel: &Cancel,
) -> Result<Done, Error> {
    let Slabs { wide, shape: wider, pad, all, order, .. } = slabs;
    let (wider, pad) = (*wider, *pad);
    let none: Option<ArrayView2<'_, P>> = None;
    let mut drawings = Vec::new();
    for (range, middle) in &slabs.slabs {
        let mut members = collected(order[range.clone()].iter().copied())?;
        members.sort_unstable();
        drawings.push((*middle, Bands::of(all, &members, wider.0)?));
    }
    let [out_left, out_right] = outs;
    let items =
        out_left.into_iter_bands()?.into_iter().zip(out_right.into_iter_bands()?).enumerate();
    pool::for_each(items, |(band, (mut a, mut b))| {
        let mut plane: Vec<P> = zeroed(TILE * wider.1)?;
        for (middle, bands) in &drawings {
            cancel.check()?;
            let list = bands.band(band);
            let Some(touched) = columns(list, wider.1) else { continue };
            let picture = Picture::<P, P> {
                shape: wider,
                eye: wide,
                drawing: Drawing { sprites: all, colours: &[[0.0; 3]], look },
                bands,
                coloured: false,
                by_ray: false,
                depth: none,
                pixel: std::marker::PhantomData,
            };
            plane.fill(P::one());
            let mut scratch = picture.scratch()?;
            for left in (touched.start / TILE * TILE..touched.end).step_by(TILE) {
                let done = picture.tile([left, band * TILE], &mut scratch, cancel)?;
                let end = (left + TILE).min(wider.1);
                for (row, through) in done.through.0.iter().enumerate() {
                    plane[row * wider.1 + left..row * wider.1 + end]
                        .copy_from_slice(&through[..end - left]);
                }
            }
            for (row, (mut a, mut b)) in a.rows_mut().into_iter().zip(b.rows_mut()).enumerate() {
                let source = &plane[row * wider.1..(row + 1) * wider.1];
                let (a, b) = (a.as_slice_mut(), b.as_slice_mut());
                let (Some(a), Some(b)) = (a, b) else {
                    return Err(Error::Internal("an output that is not contiguous".into()));
                };
                hide(a, &source[pad..]);
                shifted(b, source, pad as f64 - middle);
            }
        }
        Ok(())
    })?;
    Ok(Done { slabs: slabs.slabs.len(), shifted: order.len() })
}

/// The operations that a particle takes: its pixels.
fn area_of(sprite: &Sprite) -> f64 {
    let length = |[low, high]: [u32; 2]| f64::from(high - low);
    length(sprite.rows) * length(sprite.columns)
}

/// Draws the particles that are named in `which`.
fn some<P: Normal, M: Real>(
    out: ArrayViewMut2<'_, P>,
    cloud: &Cloud<'_>,
    eye: &Eye,
    look: &Look,
    depth: Option<ArrayView2<'_, M>>,
    which: &[bool],
    cancel: &Cancel,
) -> Result<(), Error> {
    let kept = which.iter().enumerate().filter(|&(_, &kept)| kept).map(|(k, _)| k);
    let kept: Vec<usize> = kept.collect();
    let centers = cloud.centers.select(Axis(0), &kept);
    let one = |values: ndarray::ArrayView1<'_, f64>| {
        if values.len() == 1 { values.to_owned() } else { values.select(Axis(0), &kept) }
    };
    let (radius, density) = (one(cloud.radius), one(cloud.density));
    let part = Cloud {
        centers: centers.view(),
        radius: radius.view(),
        density: density.view(),
        colours: &[[0.0; 3]],
    };
    let seen = sprites(&part, eye, look, out.dim(), cancel)?;
    if seen.iter().all(|sprite| sprite.rows[0] >= sprite.rows[1]) {
        let mut out = out;
        out.fill(P::zero());
        return Ok(());
    }
    alpha(out, &part, eye, look, depth, cancel)
}

/// The columns that a list touches.
fn columns(list: &[Entry], width: usize) -> Option<Range<usize>> {
    let left = list.iter().map(|entry| entry.left as usize).min()?;
    let right = list.iter().map(|entry| entry.right as usize).max()?;
    Some(left..right.min(width))
}

dispatch! {
    /// alpha := 1 - (1 - alpha) through.
    fn hide<P: Normal>(alpha: &mut [P], through: &[P]) = hide_with
}

#[inline(always)]
fn hide_with<P: Normal, const LEVEL: u8>(alpha: &mut [P], through: &[P]) {
    for (alpha, through) in alpha.iter_mut().zip(through) {
        *alpha = P::one() - (P::one() - *alpha) * *through;
    }
}

dispatch! {
    /// The same with what lies `offset` px to the right in `source`; between pixels by a cubic
    /// through the four around.
    fn shifted<P: Normal>(alpha: &mut [P], source: &[P], offset: f64) = shifted_with
}

#[inline(always)]
fn shifted_with<P: Normal, const LEVEL: u8>(alpha: &mut [P], source: &[P], offset: f64) {
    let whole = offset.floor();
    let t = offset - whole;
    let start = whole as usize;
    if t < 1e-9 {
        hide_with::<P, LEVEL>(alpha, &source[start..]);
        return;
    }
    // Lagrange's weights.
    let w = [
        -t * (t - 1.0) * (t - 2.0) / 6.0,
        (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
        -(t + 1.0) * t * (t - 2.0) / 2.0,
        (t + 1.0) * t * (t - 1.0) / 6.0,
    ]
    .map(P::of);
    let count = alpha.len();
    // Subslices of one length, with no closure: so the loop vectorises.
    let a = &source[start - 1..start - 1 + count];
    let b = &source[start..start + count];
    let c = &source[start + 1..start + 1 + count];
    let d = &source[start + 2..start + 2 + count];
    for k in 0..count {
        let through = (a[k] * w[0] + b[k] * w[1]) + (c[k] * w[2] + d[k] * w[3]);
        // A cubic overshoots by less than it errs.
        let through = least(most(through, P::zero()), P::one());
        alpha[k] = P::one() - (P::one() - alpha[k]) * through;
    }
}

/// A picture in bands of rows.
trait InBands<'a, P> {
    fn into_iter_bands(self) -> Result<Vec<ArrayViewMut2<'a, P>>, Error>;
}

impl<'a, P> InBands<'a, P> for ArrayViewMut2<'a, P> {
    fn into_iter_bands(self) -> Result<Vec<ArrayViewMut2<'a, P>>, Error> {
        let mut bands = Vec::new();
        let mut rest = self;
        while rest.nrows() > 0 {
            let height = TILE.min(rest.nrows());
            let (band, below) = rest.split_at(Axis(0), height);
            pushed(&mut bands, band)?;
            rest = below;
        }
        Ok(bands)
    }
}
