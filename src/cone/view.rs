//! Where a pixel's ray meets the double cone: azimuth and height, how fast they change from pixel to
//! pixel, and how much of the texture is shown.
//!
//! The cone |across| = R (1 - slope |w|), w = height / R, surrounds the camera, so every ray meets it
//! once. With s the ray along the axis and c across it, `w = s / (c + slope |s|)`: no length of the ray
//! is needed. `slope = 0` is a cylinder, whose images move exactly as those of points in space.

use std::f64::consts::TAU;

use super::basis::{Basis, Vector};
use crate::base::pixel::{dot, smoothstep};

/// Denominators are at least this share of the ray's length: a ray along the axis stays finite.
const FLOOR: f64 = 1e-6;

/// Of the fade's own cone, so that a cylinder fades, too.
pub const FADE_SLOPE: f64 = 0.2;

/// The fade begins and ends where `FADE_SLOPE |s| / (c + FADE_SLOPE |s|)` has these values: 82.4 and
/// 89.4 degrees from the equator.
pub const FADE: [f64; 2] = [0.6, 0.95];

/// A camera inside a double cone.
#[derive(Debug, Clone, Copy)]
pub struct View {
    pub basis: Basis,
    pub focal: f64,
    pub center: [f64; 2],
    /// Radius over height of the cone; 0 is a cylinder.
    pub slope: f64,
    /// The eye's place in camera axes over the cone's radius.
    pub eye: Vector,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Turns, in [0, 1).
    pub azimuth: f64,
    /// Over the radius.
    pub height: f64,
    /// Turns per pixel: the length of the azimuth's gradient in the picture.
    pub azimuth_step: f64,
    /// Per pixel: the length of the height's gradient in the picture.
    pub height_step: f64,
    /// 1 away from the cone's ends, 0 at them.
    pub fade: f64,
}

impl View {
    /// The ray of a pixel position, times the focal length; an eye off the axis sees the cone's point
    /// that its ray meets, as a ray from the middle.
    fn ray(&self, x: f64, y: f64) -> (Vector, f64) {
        let ray = [x - self.center[0], y - self.center[1], self.focal];
        if self.eye == [0.0; 3] {
            return (ray, self.reach(ray));
        }
        // The ray from the middle is ray + eye * reach(itself): it shrinks by |eye| in each round.
        let mut seen = ray;
        for _ in 0..24 {
            let reach = self.reach(seen);
            let next: Vector = [0, 1, 2].map(|i| ray[i] + self.eye[i] * reach);
            if next == seen {
                break;
            }
            seen = next;
        }
        (seen, self.reach(seen))
    }

    /// Radii in the length of a ray's way to the cone, inverted.
    #[inline]
    fn reach(&self, ray: Vector) -> f64 {
        let (p, q) = (dot(ray, self.basis.first), dot(ray, self.basis.second));
        libm::hypot(p, q) + self.slope * dot(ray, self.basis.axis).abs()
    }

    /// Depth (z) of the cone behind a pixel over its radius; not positive behind the camera.
    #[inline]
    pub fn depth(&self, x: f64, y: f64) -> f64 {
        let (ray, reach) = self.ray(x, y);
        ray[2] / reach.max(FLOOR * self.focal) - self.eye[2]
    }

    /// What the position (x, y) in the picture sees, pixels.
    pub fn point(&self, x: f64, y: f64) -> Point {
        let Basis { axis, first, second } = self.basis;
        let (ray, reach) = self.ray(x, y);
        let floor = FLOOR * dot(ray, ray).sqrt();
        let (p, q, s) = (dot(ray, first), dot(ray, second), dot(ray, axis));
        let across = libm::hypot(p, q);
        let (wide, reach) = (across.max(floor), reach.max(floor));
        let turn = libm::atan2(q, p) / TAU;
        let azimuth = if turn < 0.0 { turn + 1.0 } else { turn };
        // Both differ along the rows and columns: the gradient's length is what a box over the pixel
        // has to span, whatever the angle between them.
        let mut steps = [0.0; 2];
        for i in 0..2 {
            let turning = (p * second[i] - q * first[i]) / (wide * wide);
            let widening = (p * first[i] + q * second[i]) / wide;
            let rising = (axis[i] * across - s * widening) / (reach * reach);
            steps[0] += turning * turning;
            steps[1] += rising * rising;
        }
        Point {
            // -1e-20 + 1 is 1, which is 0 again.
            azimuth: if azimuth >= 1.0 { 0.0 } else { azimuth },
            height: s / reach,
            azimuth_step: steps[0].sqrt() / TAU,
            height_step: steps[1].sqrt(),
            fade: fade(across, s),
        }
    }
}

/// How much is shown of a ray with these parts across and along the axis.
#[inline]
pub fn fade(across: f64, along: f64) -> f64 {
    let bent = FADE_SLOPE * along.abs();
    let t = (bent / (across + bent).max(f64::MIN_POSITIVE) - FADE[0]) / (FADE[1] - FADE[0]);
    1.0 - smoothstep(t)
}
