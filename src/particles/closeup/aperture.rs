//! A lens: the circle of confusion by depth, and its opening as a kernel of texels.

use super::spread::Tap;

/// Of a disc of diameter c the variance along an axis is c^2 / 16.
pub const VARIANCE_OF_DISC: f64 = 1.0 / 16.0;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blur {
    /// The circle of confusion of a depth z is `strength * |1/focus - 1/z|` px wide; px times world units.
    pub strength: f64,
    /// One over the depth in focus; 0 at infinity.
    pub focus: f64,
    /// Blades of the opening; fewer than 3 for a round one.
    pub blades: usize,
    /// How far the opening is turned, radians.
    pub turn: f64,
}

impl Blur {
    /// Diameter of the circle of confusion at a depth, px: of the disc with the area of the opening.
    #[inline(always)]
    pub fn circle(&self, depth: f64) -> f64 {
        self.strength * (self.focus - 1.0 / depth).abs()
    }

    /// The opening of a circle of `diameter` texels as copies of a picture, whose weights sum to 1. One
    /// narrower than a texel counts in part.
    pub fn taps(&self, diameter: f64) -> Vec<Tap> {
        let part = diameter.min(1.0);
        let radius = 0.5 * diameter.max(1.0);
        let (away, sides) = self.sides();
        let reach = (self.corner() * radius + 1.0).ceil() as isize;
        let places: Vec<f32> = (-reach..=reach).map(|x| (x as f64 / radius) as f32).collect();
        let soft = (1.0 / radius).min(2.0);
        // The border is soft: one texel wide.
        let inside = |far: f32| ((away - f64::from(far)) / soft + 0.5).clamp(0.0, 1.0);
        let far = |u: f32, v: f32| match &sides[..] {
            [] => (u * u + v * v).sqrt(),
            sides => sides.iter().map(|[a, b]| u * a + v * b).fold(f32::NEG_INFINITY, f32::max),
        };
        let mut taps = Vec::with_capacity(places.len() * places.len());
        let mut sum = 0.0;
        for (y, &v) in (-reach..).zip(&places) {
            for (x, &u) in (-reach..).zip(&places) {
                let weight = inside(far(u, v));
                if weight > 0.0 {
                    sum += weight;
                    taps.push(Tap { x, y, weight: weight as f32 });
                }
            }
        }
        let factor = (part / sum) as f32;
        for tap in &mut taps {
            let whole = if (tap.x, tap.y) == (0, 0) { 1.0 - part as f32 } else { 0.0 };
            tap.weight = factor * tap.weight + whole;
        }
        taps
    }

    /// How far the corners of the opening are from its middle, in radii of the circle: that of a polygon with
    /// the circle's area.
    pub fn corner(&self) -> f64 {
        if self.blades < 3 {
            return 1.0;
        }
        let step = std::f64::consts::TAU / self.blades as f64;
        libm::sqrt(step / libm::sin(step))
    }

    /// How far the sides of the opening are, and where they face; none for a round one.
    fn sides(&self) -> (f64, Vec<[f32; 2]>) {
        if self.blades < 3 {
            return (1.0, Vec::new());
        }
        let step = std::f64::consts::TAU / self.blades as f64;
        let facing = (0..self.blades).map(|blade| {
            let angle = self.turn + step * blade as f64;
            [libm::cos(angle) as f32, libm::sin(angle) as f32]
        });
        (self.corner() * libm::cos(0.5 * step), facing.collect())
    }
}
