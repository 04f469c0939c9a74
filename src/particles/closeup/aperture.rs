//! A lens: the circle of confusion by depth, and its opening as a kernel of texels.

/// A lens with a finite opening.
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

    /// Whether a place in units of the circle's radius lies in the opening, with an edge of `soft` units.
    fn inside(&self, x: f64, y: f64, soft: f64) -> f64 {
        let edge = if self.blades < 3 {
            1.0 - libm::sqrt(x * x + y * y)
        } else {
            // The distance from the nearest side of a polygon of the same area.
            let step = std::f64::consts::TAU / self.blades as f64;
            let half = 0.5 * step;
            let radius = libm::sqrt(std::f64::consts::TAU / (self.blades as f64 * libm::sin(step)));
            let angle = libm::atan2(y, x) - self.turn;
            let within = angle - step * libm::round(angle / step);
            radius * libm::cos(half) - libm::sqrt(x * x + y * y) * libm::cos(within)
        };
        (edge / soft + 0.5).clamp(0.0, 1.0)
    }

    /// The opening of a circle of `diameter` texels: rows of (x, y, weight) that sum to 1.
    pub fn taps(&self, diameter: f64) -> Vec<(isize, isize, f32)> {
        let radius = 0.5 * diameter;
        let reach = libm::ceil(1.5 * radius + 1.0) as isize;
        let mut taps = Vec::new();
        let mut sum = 0.0;
        for y in -reach..=reach {
            for x in -reach..=reach {
                let weight =
                    self.inside(x as f64 / radius, y as f64 / radius, (1.0 / radius).min(2.0));
                if weight > 0.0 {
                    sum += weight;
                    taps.push((x, y, weight));
                }
            }
        }
        taps.into_iter().map(|(x, y, weight)| (x, y, (weight / sum) as f32)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn openings_have_the_area_of_their_circle() {
        for blades in [0, 5, 6, 9] {
            let lens = Blur { strength: 1.0, focus: 0.1, blades, turn: 0.2 };
            let taps = lens.taps(40.0);
            let most = taps.iter().map(|tap| tap.2).fold(0.0, f32::max);
            let area = 1.0 / f64::from(most);
            let wanted = std::f64::consts::PI * 400.0;
            assert!((area / wanted - 1.0).abs() < 0.02, "{blades} {area}");
            let sum: f64 = taps.iter().map(|tap| f64::from(tap.2)).sum();
            assert!((sum - 1.0).abs() < 1e-6);
        }
        assert!(Blur { strength: 8.0, focus: 0.5, blades: 0, turn: 0.0 }.circle(2.0).abs() < 1e-15);
    }
}
