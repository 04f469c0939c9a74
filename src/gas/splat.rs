//! The image of many particles: projection, bands, tiles.
//!
//! If all have one color, `over` commutes: what is let through is a product, and no order matters.
//! Else they are sorted once, front to back. Every pixel has one owner and its particles come in an
//! order that follows from the arguments alone, so bits do not depend on the thread count.

use super::sprite::{Cloud, Eye, Form, Look, Sprite};
use crate::base::error::{Cancel, Error, collected};
use crate::base::pool;

/// Particles that are projected together.
const RUN: usize = 1024;

/// The images of all particles; those that are not seen touch no row.
pub fn sprites(
    cloud: &Cloud<'_>,
    eye: &Eye,
    look: &Look,
    shape: (usize, usize),
    cancel: &Cancel,
) -> Result<Vec<Sprite>, Error> {
    let count = cloud.centers.nrows();
    let mut sprites = collected((0..count).map(|_| Sprite::default()))?;
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
            let cost = if sprite.form == Form::Ray { 1.0 } else { 0.2 };
            length(sprite.rows) * length(sprite.columns) * cost
        })
        .sum();
    4.0 * pixels + count as f64 * 100.0 + area * stride as f64
}
