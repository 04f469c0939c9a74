//! The kernel's image along one axis (Johnson 2005, Eqs 1-4).
//!
//! A Gaussian's line integral is separable: whatever the quadrature, the scaled footprint is
//! exp(-(x^2 + y^2)/2) on [-3, 3]^2, the product of two short vectors. It ends in one of two ways.
//! `Square` cuts at |x|, |y| = 3 as the paper does and leaves a step of exp(-4.5) at mid-edge;
//! `Taper` subtracts that value, so that the footprint reaches zero at the distance 3. Of both, the
//! kernels compute max(0, gain * g(x) g(y) - floor).
//!
//! A footprint under two pixels wide is integrated over each pixel: sampled at pixel centres it would
//! hold from 0.002 to 5.8 times its energy, and flicker.

use std::sync::LazyLock;

use libm::erf;

use crate::base::normal::{Normal, most};

/// exp(-9/2): the footprint at three sigma.
pub const RIM: f64 = 0.011_108_996_538_242_306;

/// Plane integral of the tapered footprint over that of the square one: 5.965557 / 6.249304. The box
/// integrates the square kernel, so without this factor energy would jump where models meet.
const TAPER_SHARE: f64 = 0.954_595_400_699_188_3;

/// Footprints with a smaller radius than this (px) are integrated over pixels.
pub const POINT_FROM: f64 = 2.0;

/// Width of the table of the reference mode. Odd, so that one entry lies at the origin.
pub const TABLE: usize = 65;

/// One axis of the table: it is the product of two.
static ENTRIES: LazyLock<[f64; TABLE]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let x = -3.0 + 6.0 * i as f64 / (TABLE - 1) as f64;
        libm::exp(-0.5 * x * x)
    })
});

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edge {
    /// Reaches zero at three sigma.
    Taper,
    /// Cut at three sigma on each axis (for models that know only a distance: at that distance).
    Square,
}

/// What turns a Gaussian into an opacity: max(0, gain * g - floor).
#[derive(Debug, Clone, Copy)]
pub struct Scale<P> {
    pub gain: P,
    pub floor: P,
}

impl<P: Normal> Scale<P> {
    /// The scale for an opacity of the middle.
    ///
    /// The floor is the rounded gain minus the rounded opacity, which is exact: the middle of an
    /// opaque particle is opaque, with no last bit missing or too many.
    #[inline]
    pub fn of(opacity: f64, edge: Edge) -> Self {
        let gain = match edge {
            Edge::Taper => P::of(opacity / (1.0 - RIM)),
            Edge::Square => P::of(opacity),
        };
        Self { gain, floor: gain - P::of(opacity) }
    }

    /// The scale of a footprint that is integrated over pixels.
    #[inline]
    pub fn of_box(opacity: f64, edge: Edge) -> Self {
        let share = match edge {
            Edge::Taper => TAPER_SHARE,
            Edge::Square => 1.0,
        };
        Self { gain: P::of(opacity * share), floor: P::zero() }
    }
}

/// exp(-u^2/2), held where it would leave the range of the exponential.
#[inline(always)]
pub fn gauss<P: Normal, const LEVEL: u8>(u: P) -> P {
    P::exp_at::<LEVEL>(most(P::of(-0.5) * u * u, P::of(-80.0)))
}

/// A place in a row as a number. Counting up in floats, or from 64 bits, would not vectorise.
#[inline(always)]
pub fn lane<P: Normal>(k: usize) -> P {
    P::of(f64::from(k as i32))
}

/// Fills `values` with the Gaussian at u = start + k step for k = first, first + 1, ...; with `square`
/// it is cut at 3.
#[inline(always)]
pub fn point<P: Normal, const N: usize, const LEVEL: u8>(
    values: &mut [P; N],
    first: usize,
    start: f64,
    step: f64,
    square: bool,
) {
    let (start, step, three) = (P::of(start), P::of(step), P::of(3.0));
    for (k, value) in values.iter_mut().enumerate() {
        let u = start + lane::<P>(first + k) * step;
        let g = gauss::<P, LEVEL>(u);
        *value = if square && u.abs() > three { P::zero() } else { g };
    }
}

/// Fills `values` with means over the pixels first, first + 1, ... of a Gaussian of `radius` px
/// around `middle`, cut at its radius.
pub fn pixel_box<P: Normal>(values: &mut [P], first: f64, middle: f64, radius: f64) {
    let factor = (0.5 * std::f64::consts::PI).sqrt() * radius / 3.0;
    let edge = |x: f64| {
        let u = (3.0 * (x - middle) / radius).clamp(-3.0, 3.0);
        erf(u * std::f64::consts::FRAC_1_SQRT_2)
    };
    let mut left = edge(first);
    for (k, value) in values.iter_mut().enumerate() {
        let right = edge(first + (k + 1) as f64);
        *value = P::of(factor * (right - left));
        left = right;
    }
}

/// The pixels of a patch of Eq. 2: its left border and width, whole pixels.
#[inline]
pub fn patch(middle: f64, radius: f64) -> (f64, f64) {
    let width = (2.0 * radius + 0.5).floor().max(1.0);
    ((middle - 0.5 * width + 0.5).floor(), width)
}

/// Fills `values` with the table's entries that Eq. 2 maps to the pixels first, first + 1, ...,
/// rounded to the nearest.
pub fn looked_up<P: Normal>(values: &mut [P], first: f64, middle: f64, radius: f64) {
    let (left, width) = patch(middle, radius);
    let last = (TABLE - 1) as f64;
    let entries = &*ENTRIES;
    for (k, value) in values.iter_mut().enumerate() {
        let i = first + k as f64 - left;
        *value = if i < 0.0 || i > width - 1.0 {
            P::zero()
        } else {
            // A patch of one pixel is 0/0 in Eq. 2: the middle.
            let place = if width > 1.0 { (i * last / (width - 1.0) + 0.5).floor() } else { 32.0 };
            P::of(entries[place as usize])
        };
    }
}
