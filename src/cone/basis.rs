//! Two directions across the cone's axis, carried along by the smallest rotation that brings the
//! default axis (straight down) to the wanted one.
//!
//! A look-at frame with `up` would be singular for the default axis itself, which is the usual one.

use crate::base::error::Error;
use crate::base::pixel::dot;

/// A vector in axes x right, y down, z forward.
pub type Vector = [f64; 3];

/// Where the cone points when nothing moves: down.
pub const DOWN: Vector = [0.0, 1.0, 0.0];

/// The axis and two directions across it, all of length 1 and square to each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Basis {
    /// The cone's axis: where the drops go, seen from the camera.
    pub axis: Vector,
    /// Azimuth 0.
    pub first: Vector,
    /// Azimuth a quarter of a turn.
    pub second: Vector,
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl Basis {
    /// The basis of an axis of any length but 0.
    pub fn of(axis: Vector) -> Result<Self, Error> {
        // Scaled before squaring, so that 1e-200 and 1e200 have a direction too.
        let largest = axis.iter().fold(0.0_f64, |most, part| most.max(part.abs()));
        if !(largest > 0.0 && axis.iter().all(|part| part.is_finite())) {
            let message = format!("must be finite and not zero, got {axis:?}");
            return Err(Error::invalid("axis", message));
        }
        let scaled = axis.map(|part| part / largest);
        let length = dot(scaled, scaled).sqrt();
        let axis = scaled.map(|part| part / length);
        let sum: Vector = [0, 1, 2].map(|i| DOWN[i] + axis[i]);
        // 1 + cos of the angle, without the cancellation of that sum near straight up.
        let one_plus_cos = 0.5 * dot(sum, sum);
        if one_plus_cos < 1e-24 {
            // Straight up, to 1e-12 rad: half a turn about x.
            let axis = [0.0, -1.0, 0.0];
            return Ok(Self { axis, first: [1.0, 0.0, 0.0], second: [0.0, 0.0, -1.0] });
        }
        let v = cross(DOWN, axis);
        let rotated = |x: Vector| {
            let (across, along) = (cross(v, x), dot(v, x) / one_plus_cos);
            [0, 1, 2].map(|i| x[i] * (one_plus_cos - 1.0) + across[i] + v[i] * along)
        };
        Ok(Self { axis, first: rotated([1.0, 0.0, 0.0]), second: rotated([0.0, 0.0, 1.0]) })
    }

    /// The basis seen by a camera; `rotation` is row-major and turns camera axes into the house's.
    pub fn in_camera(&self, rotation: &[f64; 9]) -> Self {
        let turned = |v: Vector| {
            [0, 1, 2].map(|column| (0..3).map(|row| rotation[3 * row + column] * v[row]).sum())
        };
        Self { axis: turned(self.axis), first: turned(self.first), second: turned(self.second) }
    }
}
