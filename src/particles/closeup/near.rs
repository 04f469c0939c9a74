//! Which flakes are near or out of focus, and their pictures over a frame.

use std::ops::Range;
use std::sync::Mutex;

use ndarray::{ArrayView2, ArrayViewMut2, Axis};

use super::aperture::Blur;
use super::patch::{Kind, Line, Look, Patch, Tumble};
use crate::base::error::{Cancel, Error, collected};
use crate::base::pool;
use crate::base::simd::dispatch;
use crate::base::smooth::smoothstep;
use crate::particles::sorted::Part;
use crate::particles::splat::Source;
use crate::particles::sprite::{Flake, Lens};

/// How flakes are looked at from near.
#[derive(Debug, Clone, Copy)]
pub struct Closeup {
    /// What near ones look like; None where sprites are all.
    pub kind: Option<Kind>,
    /// Sigma in px between which a sprite gives way to a shape.
    pub switch: (f64, f64),
    /// The lens, if it has an opening.
    pub blur: Option<Blur>,
    /// How they tumble.
    pub tumble: Tumble,
}

/// Circles of confusion in px between which a blurred sprite gives way to a disc.
pub const DISC: (f64, f64) = (6.0, 9.0);

/// Of a disc of diameter c the variance along an axis is c^2 / 16.
pub const VARIANCE_OF_DISC: f64 = 1.0 / 16.0;

/// A source of flakes that keeps back those which are drawn as pictures.
pub struct Split<'a, S> {
    source: &'a S,
    lens: &'a Lens,
    closeup: &'a Closeup,
    numbers: Option<&'a [i64]>,
    kept: Mutex<Vec<Kept>>,
}

/// A flake that is kept back, and how much of it is a shape or a disc: the rest is a sprite's image.
struct Kept {
    index: usize,
    flake: Flake,
    share: f64,
}

impl<'a, S: Source> Split<'a, S> {
    /// Splits the flakes of a source before a lens; `numbers`, where given, are what they are known by.
    pub fn new(
        source: &'a S,
        lens: &'a Lens,
        closeup: &'a Closeup,
        numbers: Option<&'a [i64]>,
    ) -> Self {
        Self { source, lens, closeup, numbers, kept: Mutex::new(Vec::new()) }
    }

    /// The pictures of those that were kept back, in the order of the flakes.
    pub fn patches(self, shape: (usize, usize), cancel: &Cancel) -> Result<Vec<Patch>, Error> {
        let mut kept =
            self.kept.into_inner().map_err(|_| Error::Internal("a list is poisoned".into()))?;
        kept.sort_unstable_by_key(|flake| flake.index);
        let (lens, closeup) = (self.lens, self.closeup);
        let known = |index: usize| self.numbers.and_then(|all| all.get(index)).copied();
        let number = |index: usize| known(index).unwrap_or(index as i64);
        let mut patches = collected((0..kept.len()).map(|_| None))?;
        let tasks: Vec<_> = patches.chunks_mut(8).zip(kept.chunks(8)).collect();
        pool::for_each(tasks, |(patches, flakes): (&mut [Option<Patch>], &[Kept])| {
            cancel.check()?;
            for (patch, Kept { index, flake, share }) in patches.iter_mut().zip(flakes) {
                let depth = (flake.point[2] - lens.offset[2]).max(lens.near);
                let sigma = lens.focal * flake.radius / (3.0 * depth);
                let shaped = closeup.kind.filter(|_| sigma > closeup.switch.0);
                let look = Look {
                    kind: shaped.unwrap_or(Kind::Dot),
                    share: *share,
                    blur: closeup.blur,
                    tumble: closeup.tumble,
                };
                *patch = Patch::of(number(*index), flake, lens, &look, shape)
                    .map(|patch| Patch { index: *index as i32, ..patch });
            }
            Ok(())
        })?;
        Ok(patches.into_iter().flatten().collect())
    }
}

impl<S: Source> Source for Split<'_, S> {
    fn len(&self) -> usize {
        self.source.len()
    }

    fn check(&self) -> Result<(), Error> {
        self.source.check()
    }

    #[inline(always)]
    fn get(&self, index: usize) -> Option<Flake> {
        self.rest(index, self.source.get(index)?)
    }

    #[inline(always)]
    fn each(
        &self,
        range: Range<usize>,
        see: &mut impl FnMut(usize, Flake) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.source.each(range, &mut |index, flake| match self.rest(index, flake) {
            Some(rest) => see(index, rest),
            None => Ok(()),
        })
    }
}

impl<S: Source> Split<'_, S> {
    /// What of a flake is a sprite, if anything; else it is kept back.
    #[inline(always)]
    fn rest(&self, index: usize, flake: Flake) -> Option<Flake> {
        let depth = (flake.point[2] - self.lens.offset[2]).max(self.lens.near);
        let sigma = self.lens.focal * flake.radius / (3.0 * depth);
        let closeup = self.closeup;
        let ramp = |(low, high): (f64, f64), x: f64| smoothstep((x - low) / (high - low));
        let mut share = if closeup.kind.is_some() { ramp(closeup.switch, sigma) } else { 0.0 };
        let circle = closeup.blur.as_ref().map_or(0.0, |blur| blur.circle(depth));
        if circle > DISC.0 {
            share = share.max(ramp(DISC, circle));
        }
        if share > 0.0 {
            if let Ok(mut kept) = self.kept.lock() {
                kept.push(Kept { index, flake, share });
            }
            return None;
        }
        let mut rest = flake;
        if circle > 0.0 && sigma > 0.0 {
            let wide = sigma * sigma + circle * circle * VARIANCE_OF_DISC;
            let grown = (wide / (sigma * sigma)).sqrt();
            rest.radius *= grown;
            rest.opacity /= grown * grown;
        }
        Some(rest)
    }
}

/// Rows of one item of work.
const BAND: usize = 32;

/// Joins the pictures with the opacity in a part of the frame; `depth`, of the whole frame, hides.
pub fn draw(
    mut out: ArrayViewMut2<'_, f32>,
    patches: &[Patch],
    part: Part,
    depth: Option<ArrayView2<'_, f32>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    if patches.is_empty() {
        return Ok(());
    }
    let [top, _, left, right] = part;
    let bands: Vec<_> = out.axis_chunks_iter_mut(Axis(0), BAND).enumerate().collect();
    pool::for_each(bands, |(number, mut band)| {
        cancel.check()?;
        let first = top + number * BAND;
        let end = first + band.nrows();
        let mut room = Line::default();
        for patch in patches {
            let (upper, lower) = patch.bounds(1, usize::MAX >> 1);
            for y in upper.max(first)..lower.min(end) {
                let mut line = band.row_mut(y - first);
                let line = line
                    .as_slice_mut()
                    .ok_or_else(|| Error::Internal("rows are not contiguous".into()))?;
                let (x, alphas) = patch.row(y, left..right, &mut room);
                let line = &mut line[x - left..][..alphas.len()];
                let Some(map) = depth else {
                    join(line, alphas);
                    continue;
                };
                let map = map.index_axis_move(Axis(0), y);
                for ((out, alpha), &ground) in line.iter_mut().zip(alphas).zip(map.iter().skip(x)) {
                    // NaN hides nothing.
                    let hidden = ground < patch.depth as f32;
                    *out += if hidden { 0.0 } else { alpha * (1.0 - *out) };
                }
            }
        }
        Ok(())
    })
}

/// Writes the flake of each picture into `numbers` where its alpha is above the greatest so far, `most`, or as
/// great and it comes first; both are of a part of the frame.
pub fn number(
    mut numbers: ArrayViewMut2<'_, i32>,
    mut most: ArrayViewMut2<'_, f32>,
    patches: &[Patch],
    part: Part,
    depth: Option<ArrayView2<'_, f32>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let [top, bottom, left, right] = part;
    let mut room = Line::default();
    for patch in patches {
        cancel.check()?;
        let (upper, lower) = patch.bounds(1, usize::MAX >> 1);
        for y in upper.max(top)..lower.min(bottom) {
            let (x, alphas) = patch.row(y, left..right, &mut room);
            for (x, &alpha) in (x..).zip(alphas) {
                let at = [y - top, x - left];
                let first = alpha == most[at] && patch.index < numbers[at];
                let hidden = depth.is_some_and(|map| map[[y, x]] < patch.depth as f32);
                if (alpha > most[at] || first) && alpha > 0.0 && !hidden {
                    (most[at], numbers[at]) = (alpha, patch.index);
                }
            }
        }
    }
    Ok(())
}

#[inline(always)]
fn join_with<const LEVEL: u8>(out: &mut [f32], alphas: &[f32]) {
    for (out, alpha) in out.iter_mut().zip(alphas) {
        *out += alpha * (1.0 - *out);
    }
}

dispatch! {
    /// Joins opacities with those that are there.
    fn join(out: &mut [f32], alphas: &[f32]) = join_with
}
