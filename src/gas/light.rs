//! How much light of a direction reaches each particle, with forward scattering (after Harris 2001).
//!
//! Particles are visited along the light's way. Each one takes its share of the light from those
//! behind it, by its footprint at their distance across the light, and passes `forward` of what it
//! took on to them. No picture is made, and no order matters but that of the light.

use ndarray::ArrayViewMut1;

use super::ray::tapered;
use super::sprite::Cloud;
use crate::base::error::{Cancel, Error, collected, zeroed};

/// Particles between two looks at the cancel flag.
const LOOK: usize = 64;

/// Fills `out` (n,) with the light that reaches each particle, 0 to 1.
///
/// `direction` is the way the light goes; `forward` the share of what a particle takes that goes on.
pub fn light(
    mut out: ArrayViewMut1<f64>,
    cloud: &Cloud<'_>,
    direction: [f64; 3],
    forward: f64,
    cancel: &Cancel,
) -> Result<(), Error> {
    cloud.check()?;
    let count = cloud.centers.nrows();
    if out.len() != count {
        return Err(Error::Internal("not a number for each particle".into()));
    }
    let length = libm::hypot(libm::hypot(direction[0], direction[1]), direction[2]);
    let [ux, uy, uz] = direction.map(|value| value / length);
    let along = |c: [f64; 3]| c[0] * ux + c[1] * uy + c[2] * uz;
    let mut order = collected(0..count)?;
    let keys = collected((0..count).map(|i| along(cloud.get(i).center)))?;
    order.sort_unstable_by(|&a, &b| keys[a].total_cmp(&keys[b]).then(a.cmp(&b)));
    let sorted = collected(order.iter().map(|&i| cloud.get(i)))?;
    let mut beam: Vec<f64> = zeroed(count)?;
    beam.fill(1.0);
    for k in 0..count {
        if k % LOOK == 0 {
            cancel.check()?;
        }
        let here = beam[k];
        out[order[k]] = here;
        let particle = sorted[k];
        let (reach, sigma) = (particle.radius * particle.radius, particle.radius / 3.0);
        let [x, y, z] = particle.center;
        for (later, beam) in sorted[k + 1..].iter().zip(&mut beam[k + 1..]) {
            let [dx, dy, dz] = [later.center[0] - x, later.center[1] - y, later.center[2] - z];
            let [a, b, c] = [dy * uz - dz * uy, dz * ux - dx * uz, dx * uy - dy * ux];
            let across = a * a + b * b + c * c;
            if across < reach {
                let share = particle.density * tapered(across.sqrt() / sigma);
                *beam = *beam * (1.0 - share) + share * forward * here;
            }
        }
    }
    Ok(())
}
