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

    /// The sides of the opening in units of the circle's radius: how far they are, and where they face.
    fn sides(&self) -> (f64, Vec<[f64; 2]>) {
        // A polygon of the circle's area.
        let step = std::f64::consts::TAU / self.blades as f64;
        let radius = libm::sqrt(std::f64::consts::TAU / (self.blades as f64 * libm::sin(step)));
        let facing = (0..self.blades).map(|blade| {
            let angle = self.turn + step * blade as f64;
            [libm::cos(angle), libm::sin(angle)]
        });
        (radius * libm::cos(0.5 * step), facing.collect())
    }

    /// The opening of a circle of `diameter` texels: rows of (x, y, weight) that sum to 1.
    pub fn taps(&self, diameter: f64) -> Vec<(isize, isize, f32)> {
        let radius = 0.5 * diameter;
        let reach = libm::ceil(1.5 * radius + 1.0) as isize;
        let (away, sides) = if self.blades < 3 { (1.0, Vec::new()) } else { self.sides() };
        let soft = (1.0 / radius).min(2.0);
        let mut taps = Vec::new();
        let mut sum = 0.0;
        for y in -reach..=reach {
            for x in -reach..=reach {
                let (u, v) = (x as f64 / radius, y as f64 / radius);
                let far = if sides.is_empty() {
                    libm::sqrt(u * u + v * v)
                } else {
                    let along = |side: &[f64; 2]| u * side[0] + v * side[1];
                    sides.iter().map(along).fold(f64::NEG_INFINITY, f64::max)
                };
                // An edge of one texel.
                let weight = ((away - far) / soft + 0.5).clamp(0.0, 1.0);
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
