//! The flakes of a list as images: sprites of balls, and pictures of those that are near or out of focus.

use std::sync::Arc;

use super::air::{Air, CLOSE, NOW, OPEN};
use super::law::ramp;
use super::list::{Flake, List};
use crate::base::ball::middle_depth;
use crate::base::error::{Cancel, Error, collected, pushed};
use crate::base::pool;
use crate::particles::balls::{Balls, Outline};
use crate::particles::closeup::aperture::VARIANCE_OF_DISC;
use crate::particles::closeup::near::{Closeup, DISC};
use crate::particles::closeup::patch::Patch;
use crate::particles::closeup::shape::{Kind, Look, Near, Tumble};
use crate::particles::sorted::Sorted;
use crate::particles::sprite::{Lens, Sprite};

/// A way whose middle is so far off its chord, px, is cut into pieces, and one on which the depth changes by
/// this logarithm.
const BEND: f64 = 0.25;
const NEARER: f64 = 0.2;

const MOST_PIECES: f64 = 8.0;

pub struct Images {
    /// Sprites, numbered by the flakes' places in the list.
    pub sorted: Sorted,
    /// Pictures of those that are near or out of focus.
    pub patches: Vec<Patch>,
    /// Of flakes that glint before lamps.
    pub tumble: Option<Tumble>,
}

/// The images of balls of an opacity.
pub fn balls_of(opacity: f64) -> Result<Balls, Error> {
    Balls::new(middle_depth(opacity)?)
}

impl Images {
    pub fn of(
        air: &Air,
        list: &List,
        balls: &Arc<Balls>,
        closeup: Option<&Closeup>,
        cancel: &Cancel,
    ) -> Result<Self, Error> {
        if i32::try_from(list.flakes.len()).is_err() {
            return Err(Error::invalid("density", "asks for more flakes than can be numbered"));
        }
        let mut sprites: Vec<(Sprite, i32)> = Vec::new();
        let mut kept: Vec<(&Flake, i32, f64)> = Vec::new();
        let (focal, mut outlines) = (air.eyes[NOW].focal[0], Vec::new());
        for (flake, number) in list.flakes.iter().zip(0..) {
            let depth = flake.depths[NOW];
            let (mut grown, mut outline) = (1.0, Outline::ROUND);
            if let Some(closeup) = closeup {
                let diameter = focal * flake.diameter / depth;
                let sigma = diameter / 8.0_f64.sqrt();
                outline = closeup.outline(flake.id as i64, diameter);
                pushed(&mut outlines, outline)?;
                let (near, switch) = (closeup.kind.is_some(), closeup.switch);
                let mut share = if near { ramp(switch.0, switch.1, sigma) } else { 0.0 };
                let circle = closeup.blur.as_ref().map_or(0.0, |blur| blur.circle(depth));
                share = share.max(ramp(DISC.0, DISC.1, circle));
                if share > 0.0 {
                    pushed(&mut kept, (flake, number, share))?;
                    continue;
                }
                grown = (1.0 + circle * circle * VARIANCE_OF_DISC / (sigma * sigma)).sqrt();
            }
            let see = &mut |sprite| pushed(&mut sprites, (sprite, number));
            pieces(flake, focal, grown, &outline, see)?;
        }
        let some = |range, images: &mut Vec<_>| images.extend_from_slice(&sprites[range]);
        let balls = Some(Arc::clone(balls));
        let mut sorted = Sorted::new(sprites.len(), some, balls, air.shape, cancel)?;
        sorted.outlines = outlines;
        let mut patches = collected(kept.iter().map(|_| None))?;
        if let Some(closeup) = closeup {
            let tasks: Vec<_> = patches.chunks_mut(8).zip(kept.chunks(8)).collect();
            pool::for_each(tasks, |(patches, kept): (&mut [Option<Patch>], &[_])| {
                cancel.check()?;
                for (patch, &(flake, number, share)) in patches.iter_mut().zip(kept) {
                    *patch = picture(air, closeup, flake, number, share);
                }
                Ok(())
            })?;
        }
        let crystals = closeup.filter(|closeup| closeup.kind == Some(Kind::Aggregate));
        let tumble = crystals.map(|closeup| closeup.tumble);
        Ok(Self { sorted, patches: patches.into_iter().flatten().collect(), tumble })
    }
}

/// The lens that pictures of flakes are drawn with: everything is as much higher as pixels are.
pub fn lens_of(air: &Air) -> Lens {
    let eye = &air.eyes[NOW];
    let [x, y, z] = eye.offset;
    let aspect = eye.focal[1] / eye.focal[0];
    Lens { focal: eye.focal[0], center: eye.center, offset: [x, aspect * y, z], near: air.near }
}

/// A flake's way through the picture as sprites: one where it is straight and even.
#[inline]
fn pieces(
    flake: &Flake,
    focal: f64,
    grown: f64,
    outline: &Outline,
    see: &mut impl FnMut(Sprite) -> Result<(), Error>,
) -> Result<(), Error> {
    let [now, open, close] = [NOW, OPEN, CLOSE].map(|time| flake.seen[time]);
    let bent: [f64; 2] = std::array::from_fn(|a| 0.5 * (open[a] + close[a]) - now[a]);
    let bend = bent[0].abs().max(bent[1].abs());
    let ratio = flake.depths[CLOSE] / flake.depths[OPEN];
    // Below `NEARER` a logarithm makes no pieces.
    let nearer = if (0.82..1.22).contains(&ratio) { 0.0 } else { libm::log(ratio).abs() };
    let count = (bend / BEND).sqrt().max(nearer / NEARER).ceil().clamp(1.0, MOST_PIECES);
    let amplitude = flake.share / (grown * grown);
    let place = |s: f64| -> [f64; 2] {
        std::array::from_fn(|a| now[a] + s * (0.5 * (close[a] - open[a]) + s * bent[a]))
    };
    if count == 1.0 {
        let radius = 0.5 * grown * focal * flake.diameter / flake.depths[NOW];
        let way = std::array::from_fn(|a| close[a] - open[a]);
        let depth = flake.depths[NOW];
        let sprite = Balls::sprite(open, way, radius, amplitude, depth, outline);
        return sprite.map_or(Ok(()), see);
    }
    let [at, before, after] = [NOW, OPEN, CLOSE].map(|time| 1.0 / flake.depths[time]);
    for piece in 0..count as usize {
        let [from, to] = [piece, piece + 1].map(|i| 2.0 * i as f64 / count - 1.0);
        let middle = 0.5 * (from + to);
        // One over the depth, as the places of the picture: by a parabola.
        let near = at + middle * (0.5 * (after - before) + middle * (0.5 * (after + before) - at));
        let radius = 0.5 * grown * focal * flake.diameter * near;
        let (start, end) = (place(from), place(to));
        let way = std::array::from_fn(|a| end[a] - start[a]);
        let sprite = Balls::sprite(start, way, radius, amplitude / count, 1.0 / near, outline);
        sprite.map_or(Ok(()), &mut *see)?;
    }
    Ok(())
}

/// The picture of a flake that is near or out of focus, `share` of it with its shape.
fn picture(air: &Air, closeup: &Closeup, flake: &Flake, number: i32, share: f64) -> Option<Patch> {
    let eye = &air.eyes[NOW];
    let ([x, y, z], depth) = (flake.point, flake.depths[NOW]);
    let diameter = eye.focal[0] * flake.diameter / depth;
    let opacity = flake.share * air.opacity;
    let near = Near {
        index: number,
        number: flake.id as i64,
        point: [x, y * eye.focal[1] / eye.focal[0], z],
        depth,
        own: flake.diameter,
        diameter,
        energy: std::f64::consts::FRAC_PI_4 * opacity * diameter * diameter,
        seen: flake.seen,
    };
    let shaped = diameter > closeup.switch.0 * 8.0_f64.sqrt();
    let kind = closeup.kind.filter(|_| shaped).unwrap_or(Kind::Dot);
    Patch::of(&near, &Look { kind, share, closeup }, air.shape)
}
