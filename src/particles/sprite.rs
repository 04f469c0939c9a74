//! One flake's image: where it falls, how large, how opaque (Langer 2004, section 6).
//!
//! A flake of radius r at depth D is a Gaussian with sigma = f r / (3 D) px: size goes as 1/D, like
//! the speed. It is drawn wider, with the sigma_e of [`crate::base::pixel`], and its amplitude is
//! lowered by sigma^2 / sigma_e^2: the sum over pixels stays 2 pi sigma^2, and a far flake fades where
//! it would otherwise flicker.
//!
//! The footprint ends at 4 sigma, which costs up to 0.29 % of a small flake's energy, more than the
//! 0.22 % that sampling alone costs. A factor 1 + 4.8e-4 / sigma_e^2 on the amplitude (0.13 % for the
//! smallest flakes, nothing for large ones, never above the opacity) keeps it within 0.18 % for every
//! size and position.

use crate::base::pixel::sampled;

/// Gives back what the end of the footprint takes from small flakes, px^2.
pub const RIM_SHARE: f64 = 4.8e-4;

/// The footprint ends here, in sigma_e, on each side.
pub const REACH: f64 = 4.0;

/// A motion shorter than this (px) is none. Both precisions turn here, so that they agree.
const LEAST_LENGTH: f64 = 1e-6;

/// Images farther out or wider than this (px) are dropped: their squares still fit any arithmetic.
const MOST_PIXELS: f64 = 1e30;

/// An opacity that leaves 1 - alpha at 1, even in float64.
const LEAST_AMPLITUDE: f64 = 1e-17;

/// A pinhole camera as plain numbers: x right, y down, z forward.
#[derive(Debug, Clone, Copy)]
pub struct Lens {
    /// f, px.
    pub focal: f64,
    /// The principal point, px.
    pub center: [f64; 2],
    /// The eye, in camera axes.
    pub offset: [f64; 3],
    /// Nothing nearer than this is drawn, world units.
    pub near: f64,
}

#[derive(Debug, Clone, Copy)]
pub struct Flake {
    /// In camera axes, at mid-exposure.
    pub point: [f64; 3],
    /// World units.
    pub radius: f64,
    /// Of its centre, when it rests, 0 to 1.
    pub opacity: f64,
    /// How far it moves during the exposure, flake minus camera, world units.
    pub travel: [f64; 3],
}

/// A flake in the picture: a Gaussian swept along a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sprite {
    pub start: [f64; 2],
    /// The unit vector along it; (1, 0) for a flake that does not move.
    pub along: [f64; 2],
    /// Its length, px; 0 for a flake that does not move.
    pub length: f64,
    /// sigma_e, px.
    pub sigma: f64,
    /// Opacity of the resting flake's centre, times the share of the exposure that is seen.
    pub amplitude: f64,
    /// Depth at the middle of the segment, world units.
    pub depth: f64,
}

impl Sprite {
    pub const NONE: Self = Self {
        start: [0.0; 2],
        along: [1.0, 0.0],
        length: 0.0,
        sigma: 1.0,
        amplitude: 0.0,
        depth: 1.0,
    };

    /// The image of a flake, or None if nothing of it can be seen.
    #[inline(always)]
    pub fn of(flake: &Flake, lens: &Lens) -> Option<Self> {
        let middle: [f64; 3] = std::array::from_fn(|axis| flake.point[axis] - lens.offset[axis]);
        let (from, to) = kept(middle[2], flake.travel[2], lens.near)?;
        // The segment's middle in units of the travel: 0 unless it is clipped.
        let shift = 0.5 * (from + to);
        let depth = (middle[2] + shift * flake.travel[2]).max(lens.near);
        let raw = lens.focal * flake.radius / (3.0 * depth);
        // sigma_e^2, px^2, and the middle's opacity over the flake's own.
        let variance = sampled(raw * raw);
        let share = raw * raw / variance * (1.0 + RIM_SHARE / variance);
        let amplitude = flake.opacity * (to - from) * share;
        let place = |share: f64| {
            let at: [f64; 3] =
                std::array::from_fn(|axis| middle[axis] + share * flake.travel[axis]);
            // A clipped end lies on the near plane; rounding must not put it behind the eye.
            let scale = lens.focal / at[2].max(lens.near);
            [lens.center[0] + scale * at[0], lens.center[1] + scale * at[1]]
        };
        let start = place(from);
        let sigma = variance.sqrt();
        let mut sprite = Self { start, along: [1.0, 0.0], length: 0.0, sigma, amplitude, depth };
        if flake.travel != [0.0; 3] {
            let end = place(to);
            let (dx, dy) = (end[0] - start[0], end[1] - start[1]);
            sprite.sweep([dx, dy], (dx * dx + dy * dy).sqrt());
        }
        sprite.within().then_some(sprite)
    }

    /// Makes a resting flake's image one that moves by `way`, of the given length, from its place on.
    #[inline(always)]
    pub fn sweep(&mut self, [dx, dy]: [f64; 2], length: f64) {
        if length > LEAST_LENGTH {
            self.along = [dx / length, dy / length];
            self.length = length;
        } else {
            self.start = [self.start[0] + 0.5 * dx, self.start[1] + 0.5 * dy];
            self.length = if length.is_finite() { 0.0 } else { f64::NAN };
        }
    }

    /// Whether it can be drawn and seen. Each comparison is false for NaN, so that an overflow on the
    /// way here ends here.
    #[inline(always)]
    pub fn within(&self) -> bool {
        (self.start[0].abs() <= MOST_PIXELS)
            & (self.start[1].abs() <= MOST_PIXELS)
            & (self.length <= MOST_PIXELS)
            & (self.sigma <= MOST_PIXELS)
            & (self.amplitude >= LEAST_AMPLITUDE)
    }

    /// The smallest box of pixel coordinates that holds the footprint: (low, high) as (x, y).
    #[inline(always)]
    pub fn bounds(&self) -> ([f64; 2], [f64; 2]) {
        let tilt = if self.square() { 1.0 } else { self.along[0].abs() + self.along[1].abs() };
        let spread = REACH * self.sigma * tilt;
        let end: [f64; 2] =
            std::array::from_fn(|axis| self.start[axis] + self.length * self.along[axis]);
        (
            std::array::from_fn(|axis| self.start[axis].min(end[axis]) - spread),
            std::array::from_fn(|axis| self.start[axis].max(end[axis]) + spread),
        )
    }

    /// Whether the footprint ends along the pixel axes (at 4 times the deviation that the motion leaves
    /// on each), not along the motion. A motion shorter than sigma hardly has a direction; a tilted
    /// rim would meet the lattice of pixels at an angle where up to 0.31 % of the energy is lost, and
    /// would not become the resting flake's as the motion shortens.
    #[inline(always)]
    pub fn square(&self) -> bool {
        self.length < self.sigma
    }

    /// Whether the footprint can touch a square of the given centre and half side; never a wrong no.
    #[inline(always)]
    pub fn touches(&self, center: [f64; 2], half: f64) -> bool {
        if self.square() {
            let (low, high) = self.bounds();
            let axes = [0, 1];
            return axes.iter().all(|&axis| {
                low[axis] <= center[axis] + half && center[axis] - half <= high[axis]
            });
        }
        let [x, y] = [center[0] - self.start[0], center[1] - self.start[1]];
        let [ux, uy] = self.along;
        let reach = REACH * self.sigma + half * (ux.abs() + uy.abs());
        let (along, across) = (x * ux + y * uy, y * ux - x * uy);
        across.abs() <= reach && -reach <= along && along <= self.length + reach
    }
}

/// The part of the motion in front of the near plane, in units of the travel, within [-1/2, 1/2].
#[inline(always)]
fn kept(depth: f64, travel: f64, near: f64) -> Option<(f64, f64)> {
    let crossing = ((near - depth) / travel).clamp(-0.5, 0.5);
    match (depth - 0.5 * travel >= near, depth + 0.5 * travel >= near) {
        (true, true) => Some((-0.5, 0.5)),
        (true, false) => Some((-0.5, crossing)),
        (false, true) => Some((crossing, 0.5)),
        (false, false) => None,
    }
}
