//! One particle's image: where it falls, how large, how opaque, which pixels it can touch.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use ndarray::{ArrayView1, ArrayView2};

use super::footprint::{Edge, POINT_FROM, patch};
use crate::base::error::Error;
use crate::base::pixel::{pixels, smoothstep};

/// Slopes beyond this many times the picture's are held when a footprint is widened off the axis.
const SLOPES: f64 = 1.3;

/// With [`NearMode::Exact`], what is nearer than this many radii is drawn by its line integral. There
/// the models still agree to a hundredth of the density, so that none is seen to change.
const CLOSE: f64 = 4.0;

/// Images smaller than this (px) have no opacity left.
const LEAST_RADIUS: f64 = 1e-9;

/// How a particle's footprint on a pixel is found.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum Footprint {
    /// A billboard that faces the viewplane, as the paper draws it.
    #[default]
    Viewplane,
    /// The same, widened by (1 + |s|^2)^(1/4), so that its area and so the mean density are right.
    ViewplaneC,
    /// A billboard that faces the eye.
    Viewpoint,
    /// The line integral along the pixel's ray.
    Volume,
    /// Eq. 2: a table laid over whole pixels.
    Table,
}

impl Footprint {
    /// Whether the pixel's ray is looked at, not only the place in the picture.
    pub fn by_ray(self) -> bool {
        matches!(self, Self::Viewpoint | Self::Volume)
    }
}

/// The eye: a pinhole, x right, y down, z forward.
#[derive(Debug, Clone, Copy)]
pub struct Eye {
    /// f, px.
    pub focal: f64,
    /// The principal point, px.
    pub center: [f64; 2],
    /// Its place in camera axes.
    pub offset: [f64; 3],
}

/// What becomes of particles at the near plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NearMode {
    /// They come in over a third of their radius behind it.
    Fade,
    /// They are drawn whole once their middle is not before it, as the paper does.
    Cull,
    /// Close ones are drawn by their line integral, which begins at it.
    Exact,
}

#[derive(Debug, Clone, Copy)]
pub struct Look {
    pub footprint: Footprint,
    pub edge: Edge,
    /// Depth before which nothing is drawn, world units, more than 0.
    pub near: f64,
    /// What becomes of particles at the near plane.
    pub near_mode: NearMode,
    /// Whether what stands in the picture hides a whole particle, or cuts into it.
    pub hard: bool,
    /// A pixel that lets through less than this is finished.
    pub error: f64,
}

#[derive(Debug, Clone, Copy)]
pub struct Particle {
    /// In camera axes.
    pub center: [f64; 3],
    /// Three sigma, world units.
    pub radius: f64,
    /// Opacity of its middle, 0 to 1.
    pub density: f64,
}

/// Particles as arrays: centers (n, 3) in camera axes; the others have n rows, or one for all.
#[derive(Debug, Clone, Copy)]
pub struct Cloud<'a> {
    /// World units.
    pub centers: ArrayView2<'a, f64>,
    /// Three sigma, world units.
    pub radius: ArrayView1<'a, f64>,
    /// Opacity of the middle, 0 to 1.
    pub density: ArrayView1<'a, f64>,
    /// Linear RGB, (1 or n, 3).
    pub colors: &'a [[f64; 3]],
}

impl Cloud<'_> {
    /// Refuses arrays that do not fit each other; the Python layer has looked at their numbers.
    pub fn check(&self) -> Result<(), Error> {
        let (count, columns) = self.centers.dim();
        let fits = [self.radius.len(), self.density.len(), self.colors.len()]
            .into_iter()
            .all(|length| length == 1 || length == count);
        if columns != 3 || !fits || self.colors.is_empty() || u32::try_from(count).is_err() {
            return Err(Error::Internal("arrays of a gas do not fit each other".into()));
        }
        Ok(())
    }

    pub fn get(&self, index: usize) -> Particle {
        let row = |length: usize| if length == 1 { 0 } else { index };
        Particle {
            center: [0, 1, 2].map(|axis| self.centers[[index, axis]]),
            radius: self.radius[row(self.radius.len())],
            density: self.density[row(self.density.len())],
        }
    }
}

/// What the footprint on the picture is.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// A product of two Gaussians, sampled.
    #[default]
    Point,
    /// The same, integrated over pixels.
    Box,
    /// The same, looked up.
    Table,
    /// Computed from each pixel's ray.
    Ray,
}

#[derive(Debug, Default, Clone, Copy)]
pub struct Sprite {
    pub form: Form,
    /// The model that it is drawn by.
    pub model: Footprint,
    /// Rows that it can touch; none if it is not seen.
    pub rows: [u32; 2],
    /// Columns that it can touch.
    pub columns: [u32; 2],
    /// Its middle, px; only where it is not of the form [`Form::Ray`].
    pub middle: [f64; 2],
    /// Three sigma, px; likewise.
    pub radius: f64,
    /// From the eye, world units.
    pub place: [f64; 3],
    pub away: f64,
    /// World units.
    pub sigma: f64,
    /// Of its middle, near fade included.
    pub opacity: f64,
    /// What it is sorted by, front to back.
    pub key: f64,
    pub index: u32,
}

impl Sprite {
    /// The image in a picture (H, W), or None where it cannot be seen.
    pub fn of(
        particle: &Particle,
        index: u32,
        eye: &Eye,
        look: &Look,
        shape: (usize, usize),
    ) -> Option<Self> {
        let place = [0, 1, 2].map(|axis| particle.center[axis] - eye.offset[axis]);
        let [x, y, depth] = place;
        let radius = particle.radius;
        let close = look.near_mode == NearMode::Exact && depth < CLOSE * radius;
        let model = if close { Footprint::Volume } else { look.footprint };
        let opacity = particle.density * Self::near(look, model, depth, radius)?;
        if opacity == 0.0 {
            return None;
        }
        let away = (x * x + y * y + depth * depth).sqrt();
        let mut sprite = Self {
            place,
            away,
            sigma: radius / 3.0,
            opacity,
            key: if look.footprint.by_ray() { away } else { depth },
            model,
            index,
            ..Self::default()
        };
        let (size, middle) = if depth > 0.0 {
            projected(place, radius, eye, model, shape)
        } else {
            (f64::INFINITY, [0.0; 2])
        };
        let bounds = if model.by_ray() && !(size < POINT_FROM && depth > radius) {
            sprite.form = Form::Ray;
            let reach = match model {
                Footprint::Viewpoint => radius * away / libm::hypot(radius, away),
                _ => radius,
            };
            let close = model == Footprint::Volume && depth <= radius;
            if close && away < 3.0 * radius {
                // Rays that meet it behind the eye also meet what of its kernel lies in front.
                [f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY]
            } else {
                let (left, right) = slopes(x, depth, reach)?;
                let (top, bottom) = slopes(y, depth, reach)?;
                let [cx, cy] = eye.center;
                let f = eye.focal;
                [cx + f * left, cx + f * right, cy + f * top, cy + f * bottom]
            }
        } else {
            if size < LEAST_RADIUS {
                return None;
            }
            sprite.middle = middle;
            sprite.radius = size;
            let [mx, my] = middle;
            if model == Footprint::Table {
                sprite.form = Form::Table;
                let [(left, width), (top, height)] = middle.map(|m| patch(m, size));
                [left, left + width, top, top + height]
            } else if size < POINT_FROM {
                sprite.form = Form::Box;
                let reach = size + 0.5;
                [mx - reach, mx + reach, my - reach, my + reach]
            } else {
                [mx - size, mx + size, my - size, my + size]
            }
        };
        let range = |range: Range<usize>| [range.start as u32, range.end as u32];
        sprite.columns = range(pixels(bounds[0], bounds[1], shape.1)?);
        sprite.rows = range(pixels(bounds[2], bounds[3], shape.0)?);
        Some(sprite)
    }

    /// What the near plane leaves of the opacity; None behind it.
    fn near(look: &Look, model: Footprint, depth: f64, radius: f64) -> Option<f64> {
        if model == Footprint::Volume {
            // The line integral begins at the near plane.
            return Some(1.0);
        }
        match look.near_mode {
            NearMode::Cull => return (depth >= look.near).then_some(1.0),
            // Not close, so not cut; the near plane may lie farther away.
            NearMode::Exact if depth - look.near >= radius => return Some(1.0),
            NearMode::Exact | NearMode::Fade => {}
        }
        let t = (depth - look.near) / (radius / 3.0);
        (t > 0.0).then(|| smoothstep(t))
    }
}

/// Three sigma in px, widened as the model wants, and the middle.
fn projected(
    [x, y, depth]: [f64; 3],
    radius: f64,
    eye: &Eye,
    footprint: Footprint,
    shape: (usize, usize),
) -> (f64, [f64; 2]) {
    let slopes = [x / depth, y / depth];
    let middle = [0, 1].map(|axis| eye.center[axis] + eye.focal * slopes[axis]);
    let size = eye.focal * (radius / depth);
    if matches!(footprint, Footprint::Viewplane | Footprint::Table) {
        return (size, middle);
    }
    let held = |axis: usize, length: usize| {
        let center = eye.center[axis];
        let limit = SLOPES * center.abs().max((length as f64 - center).abs()) / eye.focal;
        slopes[axis].clamp(-limit, limit)
    };
    let (sx, sy) = (held(0, shape.1), held(1, shape.0));
    (size * (1.0 + sx * sx + sy * sy).sqrt().sqrt(), middle)
}

/// The slopes of the rays that meet a circle of `reach` around (x, depth); None if all point
/// backwards.
fn slopes(x: f64, depth: f64, reach: f64) -> Option<(f64, f64)> {
    let away = libm::hypot(x, depth);
    if away <= reach {
        return Some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let (middle, half) = (libm::atan2(x, depth), libm::asin(reach / away));
    let (low, high) = (middle - half, middle + half);
    if low >= FRAC_PI_2 || high <= -FRAC_PI_2 {
        return None;
    }
    let low = if low <= -FRAC_PI_2 { f64::NEG_INFINITY } else { libm::tan(low) };
    let high = if high >= FRAC_PI_2 { f64::INFINITY } else { libm::tan(high) };
    Some((low, high))
}
