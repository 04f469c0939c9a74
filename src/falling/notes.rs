//! What an artist says of some flakes: where they show, which are hidden, what they give way to.

use ndarray::Array2;

use super::air::Vector;
use super::law::ramp;

/// Shares of the flakes that are there, over the picture and between depths.
#[derive(Debug, Clone)]
pub struct Mask {
    /// Of each pixel, 0 to 1.
    pub shares: Array2<f32>,
    /// Depths between which it begins to count, and between which it ends again, metres.
    pub depths: [f64; 4],
}

impl Mask {
    /// The share at a place in the picture, px: linear between the middles of pixels, beyond the edge as there.
    fn at(&self, px: [f64; 2]) -> f64 {
        let (rows, cols) = self.shares.dim();
        let axis = |v: f64, count: usize| {
            let v = (v - 0.5).clamp(0.0, (count - 1) as f64);
            (v as usize, (v as usize + 1).min(count - 1), v.fract())
        };
        let ((left, right, across), (top, bottom, down)) = (axis(px[0], cols), axis(px[1], rows));
        let line = |row: usize| {
            let [a, b] = [left, right].map(|col| f64::from(self.shares[(row, col)]));
            a + across * (b - a)
        };
        line(top) + down * (line(bottom) - line(top))
    }
}

/// A body, around which flakes go.
#[derive(Debug, Clone)]
pub struct Body {
    /// Its middle relative to the camera at each time, house axes, metres.
    pub at: Vec<Vector>,
    /// Half its sides along the house's axes, metres; of a ball the radius, three times.
    pub half: Vector,
    pub round: bool,
}

impl Body {
    /// A place as the body leaves it. Each direction's r becomes (r^3 + R^3)^(1/3) with the body's own R: so all the
    /// air is outside, and no volume of it changes.
    #[inline]
    fn passed(&self, time: usize, place: Vector) -> Vector {
        let middle = self.at[time];
        let from: Vector = std::array::from_fn(|a| place[a] - middle[a]);
        let part = if self.round {
            self.half[0] / from.iter().map(|v| v * v).sum::<f64>().sqrt()
        } else {
            (0..3).fold(f64::INFINITY, |least, a| least.min(self.half[a] / from[a].abs()))
        };
        if !part.is_finite() {
            return place;
        }
        let scale = libm::cbrt(1.0 + part * part * part);
        std::array::from_fn(|a| middle[a] + scale * from[a])
    }

    fn reach(&self) -> f64 {
        let [x, y, z] = self.half;
        if self.round { x } else { (x * x + y * y + z * z).sqrt() }
    }
}

#[derive(Debug, Clone)]
pub struct Notes {
    /// Depths between which flakes show, metres.
    pub between: (f64, f64),
    /// Identities of flakes that don't, in order.
    pub hidden: Vec<u64>,
    pub mask: Option<Mask>,
    pub bodies: Vec<Body>,
}

impl Notes {
    pub fn sound(&self, times: usize) -> bool {
        let body = |one: &Body| {
            let numbers = one.at.iter().flatten().chain(&one.half);
            one.at.len() == times && numbers.copied().all(f64::is_finite)
        };
        self.mask.as_ref().is_none_or(|mask| !mask.shares.is_empty())
            && self.bodies.iter().all(body)
    }

    /// The share of flakes like one that are there: seen at a place, px, at a depth.
    pub fn share(&self, id: u64, px: [f64; 2], depth: f64) -> f64 {
        let (near, far) = self.between;
        if !(near <= depth && depth < far) || self.hidden.binary_search(&id).is_ok() {
            return 0.0;
        }
        self.mask.as_ref().map_or(1.0, |mask| {
            let [near, whole, from, far] = mask.depths;
            let counts = ramp(near, whole, depth) * (1.0 - ramp(from, far, depth));
            1.0 - counts * (1.0 - mask.at(px))
        })
    }

    /// A place relative to the camera, house axes, as all bodies leave it.
    pub fn passed(&self, time: usize, place: Vector) -> Vector {
        self.bodies.iter().fold(place, |place, body| body.passed(time, place))
    }

    /// How far bodies move a flake at most, metres.
    pub fn reach(&self) -> f64 {
        self.bodies.iter().map(Body::reach).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_keep_the_volume_of_the_air_and_are_left_by_it() {
        let half = [0.4, 0.7, 1.1];
        for round in [true, false] {
            let body = Body { at: vec![[0.3, -0.2, 2.0]], half, round };
            let inside = |place: Vector| {
                let from: Vector = std::array::from_fn(|a| (place[a] - body.at[0][a]).abs());
                if round {
                    from.iter().map(|v| v * v).sum::<f64>() < 0.15999
                } else {
                    (0..3).all(|a| from[a] < 0.9999 * half[a])
                }
            };
            for n in 0..400 {
                let unit = |k: i32| (f64::from(n) * [0.618, 0.755, 0.57][k as usize]).fract();
                let place: Vector = std::array::from_fn(|a| 4.0 * unit(a as i32) - 1.9);
                let own = body.passed(0, place);
                assert!(!inside(own), "{place:?} {own:?}");
                // The determinant of what it does to a small cube.
                let step = 1e-5;
                let [x, y, z] = [0, 1, 2].map(|axis| {
                    let [low, high] = [-step, step].map(|way| {
                        let mut at = place;
                        at[axis] += way;
                        body.passed(0, at)
                    });
                    [0, 1, 2].map(|a| (high[a] - low[a]) / (2.0 * step))
                });
                let grown = x[0] * (y[1] * z[2] - y[2] * z[1]) - x[1] * (y[0] * z[2] - y[2] * z[0])
                    + x[2] * (y[0] * z[1] - y[1] * z[0]);
                assert!((grown - 1.0).abs() < 1e-4, "{place:?} {grown}");
            }
        }
    }
}
