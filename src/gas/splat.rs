//! The image of many particles: projection, bands, tiles.
//!
//! If all have one color, `over` commutes: what is let through is a product, and no order matters.
//! Else they are sorted once, front to back. Every pixel has one owner and its particles come in an
//! order that follows from the arguments alone, so bits do not depend on the thread count.

use ndarray::{ArrayView2, ArrayViewMut2, ArrayViewMut3};

use super::cloud::Cloud;
use super::draw::Drawing;
use super::picture::{Picture, Touched};
use super::sprite::{Eye, Form, Look, Sprite};
use crate::base::error::{Cancel, Error, collected, finite};
use crate::base::normal::Normal;
use crate::base::pool;
use crate::base::real::Real;

/// Particles that are projected together.
const RUN: usize = 1024;

fn check(eye: &Eye, look: &Look) -> Result<(), Error> {
    for &value in eye.center.iter().chain(&eye.offset) {
        finite("camera", value)?;
    }
    if !(eye.focal > 0.0 && eye.focal.is_finite()) {
        return Err(Error::invalid("camera", format!("focal must be positive, got {}", eye.focal)));
    }
    if !(look.near > 0.0 && look.near.is_finite()) {
        return Err(Error::invalid("near", format!("must be positive, got {}", look.near)));
    }
    if !(0.0..1.0).contains(&look.error) {
        return Err(Error::invalid("error", format!("must be from 0 to 1, got {}", look.error)));
    }
    if look.smooth.is_nan() || look.smooth <= 0.0 {
        return Err(Error::invalid("smooth", format!("must be positive, got {}", look.smooth)));
    }
    Ok(())
}

/// The images of all particles; those that are not seen touch no row.
pub fn sprites(
    cloud: &Cloud<'_>,
    eye: &Eye,
    look: &Look,
    shape: (usize, usize),
    cancel: &Cancel,
) -> Result<Vec<Sprite>, Error> {
    let count = cloud.centers.nrows();
    let mut sprites = collected((0..count).map(|_| Sprite::NONE))?;
    pool::for_each(sprites.chunks_mut(RUN).enumerate(), |(run, sprites)| {
        cancel.check()?;
        for (i, sprite) in sprites.iter_mut().enumerate() {
            let index = run * RUN + i;
            if let Some(seen) = Sprite::of(&cloud.get(index), index as u32, eye, look, shape) {
                *sprite = seen;
            }
        }
        Ok(())
    })?;
    Ok(sprites)
}

/// Refuses what cannot be drawn.
pub fn check_all<M>(
    shape: (usize, usize),
    cloud: &Cloud<'_>,
    eye: &Eye,
    look: &Look,
    depth: Option<&ArrayView2<'_, M>>,
) -> Result<(), Error> {
    cloud.check()?;
    check(eye, look)?;
    match depth {
        Some(depth) if depth.dim() != shape => {
            Err(Error::invalid("depth", format!("must have shape {shape:?}")))
        }
        _ => Ok(()),
    }
}

/// Draws the alpha of particles of one color, or of any, into `out` (H, W).
pub fn alpha<P: Normal, M: Real>(
    out: ArrayViewMut2<P>,
    cloud: &Cloud<'_>,
    eye: &Eye,
    look: &Look,
    depth: Option<ArrayView2<M>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let shape = out.dim();
    let cloud = Cloud { colors: &[[0.0; 3]], ..*cloud };
    let draw = |picture: &Picture<'_, M>| picture.alpha(out, [0, shape.0, 0, shape.1], cancel);
    drawn(shape, &cloud, eye, look, depth, cancel, draw)
}

/// Draws premultiplied linear RGBA into `out` (H, W, 4).
pub fn splat<P: Normal, M: Real>(
    out: ArrayViewMut3<P>,
    cloud: &Cloud<'_>,
    eye: &Eye,
    look: &Look,
    depth: Option<ArrayView2<M>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let shape = (out.dim().0, out.dim().1);
    let draw = |picture: &Picture<'_, M>| picture.light(out, [0, shape.0, 0, shape.1], cancel);
    drawn(shape, cloud, eye, look, depth, cancel, draw)
}

fn drawn<M: Real>(
    shape: (usize, usize),
    cloud: &Cloud<'_>,
    eye: &Eye,
    look: &Look,
    depth: Option<ArrayView2<M>>,
    cancel: &Cancel,
    draw: impl FnOnce(&Picture<'_, M>) -> Result<(), Error>,
) -> Result<(), Error> {
    check_all(shape, cloud, eye, look, depth.as_ref())?;
    let sprites = &sprites(cloud, eye, look, shape, cancel)?;
    let touched = &Touched::of(sprites, cloud.colors, shape.0)?;
    let drawing = Drawing { sprites, colors: cloud.colors, look };
    draw(&Picture { shape, eye, drawing, touched, depth })
}

/// A rough estimate of the work in nanoseconds, from a sample of the particles.
pub fn estimate(shape: (usize, usize), cloud: &Cloud<'_>, eye: &Eye, look: &Look) -> f64 {
    let pixels = shape.0 as f64 * shape.1 as f64;
    let count = cloud.centers.nrows();
    let stride = count.div_ceil(256).max(1);
    let area: f64 = (0..count)
        .step_by(stride)
        .filter_map(|index| Sprite::of(&cloud.get(index), 0, eye, look, shape))
        .map(|sprite| {
            let length = |[low, high]: [u32; 2]| f64::from(high - low);
            let cost = match sprite.form {
                _ if sprite.smooth => 0.1,
                Form::Ray => 1.0,
                _ => 0.2,
            };
            length(sprite.rows) * length(sprite.columns) * cost
        })
        .sum();
    4.0 * pixels + count as f64 * 100.0 + area * stride as f64
}
