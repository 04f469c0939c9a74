//! Particles that change slowly over the picture, drawn on a lattice of few samples.
//!
//! A tile has 13 intervals of the lattice along each side, with a sample beyond its first border and two
//! beyond its last, so that 16 x 16 samples stand for 64 x 64 pixels. Pixels follow by Lagrange's cubic
//! through the four samples around them on each axis. All tiles have the same lattice, so no seam is seen
//! between them. With h = 64/13 px between samples, a footprint exp(-q^2/2) of sigma s px errs by at most
//! 3 * 9/384 (h/s)^4 = 41 / s^4 of its middle, and at the taper's end, where its slope jumps by
//! .034 / s, by at most .033 / s: at s = 24 by .0015 (`tests/test_gas_lattice.py`).
//!
//! What stands in the picture is taken from the lattice, too, where it goes on smoothly across the tile:
//! where the cubic through its samples is its depth to a thousandth of the particle's sigma, and neighbouring
//! samples are within .6 sigma, so that the normal law that cuts the particle off errs by .0017 at most.

use std::sync::LazyLock;

use super::batch::{Plane, TILE};
use super::cut::{Cut, Ground, Wall};
use super::footprint::{Scale, point};
use super::ray::{Canvas, Source, finished};
use super::rays::{Rays, Sheet};
use super::sprite::{Eye, Form, Look, Sprite};
use crate::base::normal::{Normal, least, most};
use crate::base::simd::multiply_add;

pub const SIDE: usize = 16;

/// Intervals of the lattice to a tile.
const INTERVALS: usize = 13;

/// Pixels between samples.
const SPACING: f64 = TILE as f64 / INTERVALS as f64;

/// How far, in sigma, what stands in the picture may be from the cubic, and from sample to sample.
const ROUGH: f64 = 1e-3;
const STEEP: f64 = 0.6;

/// For each pixel of a row the first of its four samples and their weights.
static WEIGHTS: LazyLock<[(usize, [f64; 4]); TILE]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let place = (k as f64 + 0.5) / SPACING;
        let (first, t) = (place.floor() as usize, place.fract());
        let [a, b, c, d] = [t + 1.0, t, t - 1.0, t - 2.0];
        (first, [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0])
    })
});

/// The lattice of one tile while it is drawn.
pub struct Lattice<P> {
    through: [[P; SIDE]; SIDE],
    light: [[[P; SIDE]; SIDE]; 3],
    rays: Rays<P, SIDE>,
    sheet: Sheet,
    corner: [f64; 2],
    /// Weights of samples (rows) for pixels (columns).
    weights: [[P; TILE]; SIDE],
    depth: [[P; SIDE]; SIDE],
    /// The smallest sigma for which that is smooth, world units.
    finest: f64,
    drawn: bool,
}

impl<P: Normal> Lattice<P> {
    pub fn none() -> Self {
        let plane = [[P::zero(); SIDE]; SIDE];
        let sheet = Sheet { first: [0.0; 2], step: 0.0, range: [1.0; 2] };
        let mut weights = [[P::zero(); TILE]; SIDE];
        for (pixel, (first, four)) in WEIGHTS.iter().enumerate() {
            for (sample, weight) in four.iter().enumerate() {
                weights[first + sample][pixel] = P::of(*weight);
            }
        }
        Self {
            through: plane,
            light: [plane; 3],
            rays: Rays::none(),
            sheet,
            corner: [0.0; 2],
            weights,
            depth: plane,
            finest: f64::INFINITY,
            drawn: false,
        }
    }

    /// Begins the tile whose corner is at `origin` (x, y), px.
    pub fn begin(&mut self, eye: &Eye, origin: [usize; 2]) {
        self.corner = origin.map(|place| place as f64 - SPACING);
        self.sheet = Sheet::of(eye, self.corner, SPACING, SIDE);
        self.drawn = false;
    }

    #[inline(always)]
    pub fn stand<const LEVEL: u8>(&mut self, ground: &Ground<'_, P, TILE>) {
        self.finest = f64::INFINITY;
        if !(ground.range[1] - ground.range[0]).is_finite() {
            return;
        }
        let mut rows = [[P::zero(); TILE]; SIDE];
        for (sample, row) in rows.iter_mut().enumerate() {
            let (first, t) = between_pixels(sample);
            let (above, below) = (&ground.depth[first], &ground.depth[first + 1]);
            for k in 0..TILE {
                row[k] = above[k] + (below[k] - above[k]) * P::of(t);
            }
        }
        for (samples, row) in self.depth.iter_mut().zip(&rows) {
            for (sample, value) in samples.iter_mut().enumerate() {
                let (first, t) = between_pixels(sample);
                *value = row[first] + (row[first + 1] - row[first]) * P::of(t);
            }
        }
        let mut rough = [P::zero(); TILE];
        self.plane::<LEVEL>(&self.depth, |row, values| {
            for k in 0..TILE {
                rough[k] = most((values[k] - ground.depth[row][k]).abs(), rough[k]);
            }
        });
        let mut steep = P::zero();
        for row in 0..SIDE {
            for k in 1..SIDE {
                let across = (self.depth[row][k] - self.depth[row][k - 1]).abs();
                let down = (self.depth[k][row] - self.depth[k - 1][row]).abs();
                steep = most(most(across, down), steep);
            }
        }
        let rough = rough.iter().fold(P::zero(), |a, &b| most(a, b));
        self.finest = (rough.wide() / ROUGH).max(steep.wide() / STEEP);
    }

    /// What cuts a particle off on the lattice that is cut off so on the tile: None if it is not to be
    /// drawn here, and nothing inside if all of it is hidden.
    pub fn cut(&self, sprite: &Sprite, look: &Look, tile: Cut) -> Option<Option<Cut>> {
        let wall = match tile.wall {
            Wall::None => Wall::None,
            Wall::Ray | Wall::Plane if sprite.sigma >= self.finest => tile.wall,
            _ => return None,
        };
        let near = super::cut::cut::<P>(sprite, look, &self.sheet, SIDE - 1, None);
        Some(near.map(|near| Cut { wall, ..near }))
    }

    #[inline(always)]
    pub fn draw<const LEVEL: u8>(
        &mut self,
        sprite: &Sprite,
        look: &Look,
        cut: Cut,
        color: Option<[P; 3]>,
    ) {
        if !self.drawn {
            self.drawn = true;
            self.rays.fill::<LEVEL>(&self.sheet);
            self.through = [[P::one(); SIDE]; SIDE];
            self.light = [[[P::zero(); SIDE]; SIDE]; 3];
        }
        let [red, green, blue] = &mut self.light;
        let ground = Ground { depth: &self.depth, range: [0.0, f64::INFINITY] };
        let mut canvas = Canvas {
            sheet: &self.sheet,
            ground: (cut.wall != Wall::None).then_some(&ground),
            through: &mut self.through,
            light: color.is_some().then_some([red, green, blue]),
        };
        let whole = [[0, SIDE]; 2];
        let color = color.unwrap_or([P::zero(); 3]);
        if sprite.form == Form::Ray {
            canvas.draw::<LEVEL>(&Source::Ray(&self.rays), sprite, look, whole, cut, color);
            return;
        }
        let mut vectors = [[P::zero(); SIDE]; 2];
        for axis in 0..2 {
            let step = 3.0 / sprite.radius;
            let start = (self.corner[axis] - sprite.middle[axis]) * step;
            point::<P, SIDE, LEVEL>(&mut vectors[axis], 0, start, step * SPACING, false);
        }
        let scale = Scale::of(sprite.opacity, look.edge);
        let [across, down] = &vectors;
        canvas.draw::<LEVEL>(
            &Source::Product(across, down, scale),
            sprite,
            look,
            whole,
            cut,
            color,
        );
    }

    /// Whether no sample lets through more than `error`.
    #[inline(always)]
    pub fn finished(&self, error: P) -> bool {
        self.drawn && finished(&self.through, error)
    }

    /// Multiplies what a fresh tile lets through by what the lattice does, and adds its light.
    #[inline(always)]
    pub fn spread<const LEVEL: u8>(
        &self,
        through: &mut Plane<P>,
        light: Option<&mut [Plane<P>; 3]>,
    ) {
        if !self.drawn {
            return;
        }
        self.plane::<LEVEL>(&self.through, |row, values| {
            for k in 0..TILE {
                // The cubic may pass what it goes through by a little.
                let value = least(most(values[k], P::zero()), P::one());
                through.0[row][k] *= value;
            }
        });
        for (plane, samples) in light.into_iter().flatten().zip(&self.light) {
            self.plane::<LEVEL>(samples, |row, values| {
                for k in 0..TILE {
                    plane.0[row][k] = most(values[k], P::zero());
                }
            });
        }
    }

    /// Hands on the rows of pixels that follow from a plane of samples.
    #[inline(always)]
    fn plane<const LEVEL: u8>(
        &self,
        samples: &[[P; SIDE]; SIDE],
        mut store: impl FnMut(usize, &[P; TILE]),
    ) {
        let mut wide = [[P::zero(); TILE]; SIDE];
        for (wide, samples) in wide.iter_mut().zip(samples) {
            for sample in 0..SIDE {
                let (value, weights) = (samples[sample], &self.weights[sample]);
                for k in 0..TILE {
                    wide[k] = multiply_add::<P, LEVEL>(value, weights[k], wide[k]);
                }
            }
        }
        for row in 0..TILE {
            let (first, four) = &WEIGHTS[row];
            let mut values = [P::zero(); TILE];
            for sample in 0..4 {
                let (weight, wide) = (P::of(four[sample]), &wide[first + sample]);
                for k in 0..TILE {
                    values[k] = multiply_add::<P, LEVEL>(weight, wide[k], values[k]);
                }
            }
            store(row, &values);
        }
    }
}

/// The pixel before a sample, or the first or the last but one of the tile, and the sample's place from
/// there.
fn between_pixels(sample: usize) -> (usize, f64) {
    let place = (sample as f64 - 1.0) * SPACING - 0.5;
    let first = place.floor().clamp(0.0, (TILE - 2) as f64);
    (first as usize, place - first)
}
