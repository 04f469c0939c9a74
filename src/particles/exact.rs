//! Flakes drawn one by one with their exact images: what `method="simulated"` shows, and the judge of
//! everything that is faster.
//!
//! The image of a flake is a Gaussian of sigma d / sqrt(8), not under 0.3 px, integrated over each
//! pixel's square; one that moves is the mean of that over the exposure. Energy is kept wherever the
//! flake lies, and opacities join as those of independent flakes: alpha = 1 - prod(1 - alpha_i).

use ndarray::{ArrayView2, ArrayViewMut2, Axis};

use super::splat::{Source, check_lens};
use super::sprite::{Lens, RIM_SHARE, Sprite};
use crate::base::error::{Cancel, Error, pushed};
use crate::base::pool;
use crate::base::real::Real;
use crate::base::sampling::LEAST_SIGMA;

/// Rows of one item of work.
const BAND: usize = 16;

/// The image ends here, in sigma; beyond lie 4e-8 of its energy.
const REACH: f64 = 5.5;

/// A motion is summed by panels of this many sigma, with the nodes and weights of Gauss and Legendre.
const PANEL: f64 = 2.0;
const NODES: [(f64, f64); 6] = [
    (-0.932_469_514_203_152, 0.171_324_492_379_170_4),
    (-0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (-0.238_619_186_083_196_9, 0.467_913_934_572_691),
    (0.238_619_186_083_196_9, 0.467_913_934_572_691),
    (0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (0.932_469_514_203_152, 0.171_324_492_379_170_4),
];

/// A flake's image.
struct Image {
    start: [f64; 2],
    way: [f64; 2],
    sigma: f64,
    // The integral of its opacity, px2.
    energy: f64,
    depth: f64,
}

impl Image {
    /// The image of a flake of a radius; `sprite` has its place, its motion and its energy.
    fn of(sprite: &Sprite, radius: f64, focal: f64) -> Self {
        let [x, y] = sprite.along;
        let raw = focal * radius / (3.0 * sprite.depth);
        let variance = sprite.sigma * sprite.sigma;
        let energy = std::f64::consts::TAU * sprite.amplitude * variance;
        Self {
            start: sprite.start,
            way: [x * sprite.length, y * sprite.length],
            sigma: raw.max(LEAST_SIGMA),
            energy: energy / (1.0 + RIM_SHARE / variance),
            depth: sprite.depth,
        }
    }

    /// First and last pixel along an axis, the last one left out, of a picture so long.
    fn pixels(&self, axis: usize, length: usize) -> (usize, usize) {
        let end = self.start[axis] + self.way[axis];
        let room = REACH * self.sigma + 0.5;
        let low = (self.start[axis].min(end) - room).floor().clamp(0.0, length as f64);
        let high = (self.start[axis].max(end) + room).ceil().clamp(0.0, length as f64);
        (low as usize, high as usize)
    }
}

/// Draws the alpha of flakes into `out`, (H, W); where `depth` is nearer than a flake it is hidden.
pub fn draw<P: Real, M: Real>(
    mut out: ArrayViewMut2<'_, P>,
    flakes: &impl Source,
    lens: &Lens,
    depth: Option<ArrayView2<'_, M>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    flakes.check()?;
    check_lens(lens)?;
    let (height, width) = out.dim();
    if depth.as_ref().is_some_and(|map| map.dim() != (height, width)) {
        return Err(Error::invalid("depth", format!("must have shape {:?}", (height, width))));
    }
    let mut images = Vec::new();
    let mut bands: Vec<Vec<u32>> = vec![Vec::new(); height.div_ceil(BAND)];
    for index in 0..flakes.len() {
        if index % 65_536 == 0 {
            cancel.check()?;
        }
        let Some(flake) = flakes.get(index) else { continue };
        let Some(sprite) = Sprite::of(&flake, lens) else { continue };
        let image = Image::of(&sprite, flake.radius, lens.focal);
        let (left, right) = image.pixels(0, width);
        let (top, bottom) = image.pixels(1, height);
        if left >= right || top >= bottom {
            continue;
        }
        let number = u32::try_from(images.len())
            .map_err(|_| Error::invalid("density", "makes more than 2^32 flakes in view"))?;
        pushed(&mut images, image)?;
        for band in &mut bands[top / BAND..bottom.div_ceil(BAND)] {
            pushed(band, number)?;
        }
    }
    let (images, bands) = (&images, &bands);
    let rows = out.axis_chunks_iter_mut(Axis(0), BAND).enumerate();
    pool::for_each(rows, |(number, mut band)| {
        let first = number * BAND;
        let mut left = vec![1.0_f64; band.len()];
        let mut image = Footprint::default();
        for (count, &flake) in bands[number].iter().enumerate() {
            if count % 4096 == 0 {
                cancel.check()?;
            }
            let flake = &images[flake as usize];
            image.of(flake, first, band.nrows(), width);
            image.dim(&mut left, first, width, |row, column| {
                depth.as_ref().is_some_and(|map| map[[row, column]].wide() < flake.depth)
            });
        }
        for (pixel, left) in band.iter_mut().zip(&left) {
            *pixel = P::of(1.0 - left);
        }
        Ok(())
    })
}

/// The opacities of one flake over the pixels of a band.
#[derive(Default)]
struct Footprint {
    across: Vec<f64>,
    alpha: Vec<f64>,
    columns: (usize, usize),
    rows: (usize, usize),
}

impl Footprint {
    fn of(&mut self, image: &Image, first: usize, height: usize, width: usize) {
        self.columns = image.pixels(0, width);
        let (top, bottom) = image.pixels(1, first + height);
        self.rows = (top.max(first), bottom.max(top.max(first)));
        let wide = self.columns.1 - self.columns.0;
        self.alpha.clear();
        self.alpha.resize(wide * (self.rows.1 - self.rows.0), 0.0);
        let length = (image.way[0] * image.way[0] + image.way[1] * image.way[1]).sqrt();
        if length == 0.0 {
            self.add(image, image.start, 1.0);
            return;
        }
        let panels = (length / (PANEL * image.sigma)).ceil().max(1.0);
        for panel in 0..panels as usize {
            for (node, weight) in NODES {
                let part = (panel as f64 + 0.5 * (1.0 + node)) / panels;
                let place = [0, 1].map(|axis| image.start[axis] + part * image.way[axis]);
                self.add(image, place, 0.5 * weight / panels);
            }
        }
    }

    /// Adds the image of a flake that stands at a place for a part of the exposure.
    fn add(&mut self, image: &Image, [x, y]: [f64; 2], part: f64) {
        let room = REACH * image.sigma + 0.5;
        let (left, right) = self.columns;
        let from = ((x - room).floor().max(left as f64) as usize).min(right);
        let to = ((x + room).ceil().max(left as f64) as usize).min(right);
        self.across.clear();
        self.across.extend((from..to).map(|column| within(column, x, image.sigma)));
        let wide = right - left;
        for row in self.rows.0..self.rows.1 {
            if (row as f64 + 0.5 - y).abs() > room + 0.5 {
                continue;
            }
            let down = part * image.energy * within(row, y, image.sigma);
            let line = (row - self.rows.0) * wide + from - left;
            for (alpha, across) in self.alpha[line..].iter_mut().zip(&self.across) {
                *alpha += down * across;
            }
        }
    }

    fn dim(
        &self,
        left: &mut [f64],
        first: usize,
        width: usize,
        hidden: impl Fn(usize, usize) -> bool,
    ) {
        let (start, end) = self.columns;
        let wide = end - start;
        for row in self.rows.0..self.rows.1 {
            let line = (row - first) * width;
            let alphas = &self.alpha[(row - self.rows.0) * wide..][..wide];
            for (column, alpha) in (start..end).zip(alphas) {
                if !hidden(row, column) {
                    left[line + column] *= 1.0 - alpha.min(1.0);
                }
            }
        }
    }
}

/// The share of a Gaussian at `place` that lies within a pixel, along one axis.
fn within(pixel: usize, place: f64, sigma: f64) -> f64 {
    let scale = std::f64::consts::FRAC_1_SQRT_2 / sigma;
    let (low, high) = ((pixel as f64 - place) * scale, (pixel as f64 + 1.0 - place) * scale);
    // In the tails by the difference of what is beyond, which keeps its digits.
    if low > 0.0 {
        0.5 * (libm::erfc(low) - libm::erfc(high))
    } else if high < 0.0 {
        0.5 * (libm::erfc(-high) - libm::erfc(-low))
    } else {
        0.5 * (libm::erf(high) - libm::erf(low))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::splat::Flakes;
    use ndarray::{Array2, array};

    const LENS: Lens = Lens { focal: 300.0, center: [20.0, 16.0], offset: [0.0; 3], near: 0.1 };

    fn drawn(point: [f64; 3], radius: f64, travel: [f64; 3]) -> Array2<f64> {
        let mut out = Array2::from_elem((32, 40), f64::NAN);
        let (points, velocity) = (array![point], array![travel]);
        let (radius, opacity) = (array![radius], array![0.5]);
        let flakes = Flakes {
            points: points.view(),
            radius: radius.view(),
            opacity: opacity.view(),
            velocity: velocity.view(),
            shutter: 1.0,
        };
        draw(out.view_mut(), &flakes, &LENS, None::<ArrayView2<f32>>, &Cancel::new()).unwrap();
        out
    }

    #[test]
    fn energy_is_kept_at_every_place_size_and_motion() {
        for radius in [0.001, 0.01, 0.05, 0.15] {
            for travel in [[0.0; 3], [0.1, 0.0, 0.0], [0.2, -0.3, 0.0]] {
                for k in 0..7 {
                    let shift = f64::from(k) * 0.0013;
                    let sum = drawn([shift, -0.7 * shift, 10.0], radius, travel).sum();
                    let raw = 300.0 * radius / 30.0;
                    let wanted = 0.5 * std::f64::consts::TAU * raw * raw;
                    assert!(
                        (sum / wanted - 1.0).abs() < 1e-6,
                        "{radius} {travel:?} {sum} {wanted}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_motion_is_the_mean_of_its_moments() {
        let travel = [0.12, 0.2, 0.0];
        let moved = drawn([0.1, 0.0, 10.0], 0.03, travel);
        let steps = 400;
        let mut mean = Array2::<f64>::zeros((32, 40));
        for k in 0..steps {
            let part = (f64::from(k) + 0.5) / f64::from(steps) - 0.5;
            let place = [0.1 + part * travel[0], part * travel[1], 10.0];
            mean += &drawn(place, 0.03, [0.0; 3]);
        }
        mean /= f64::from(steps);
        let most = (&moved - &mean).iter().fold(0.0_f64, |most, d| most.max(d.abs()));
        assert!(most < 2e-6, "{most}");
    }
}
