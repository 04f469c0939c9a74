//! Flakes drawn one by one with their exact images: what `method="simulated"` shows, and the judge of
//! everything that is faster.
//!
//! The image of a flake is a Gaussian of sigma d / sqrt(8), not under 0.3 px, integrated over each
//! pixel's square; one that moves is the mean of that over the exposure. Energy is kept wherever the
//! flake lies, and opacities join as those of independent flakes: alpha = 1 - prod(1 - alpha_i).

use ndarray::{ArrayView2, ArrayViewMut2, Axis, s};

use super::integrals::{Normal, RULES, Tables};
use super::splat::{Source, check_lens};
use super::sprite::{Lens, RIM_SHARE, Sprite};
use crate::base::error::{Cancel, Error, pushed};
use crate::base::pool;
use crate::base::real::Real;
use crate::base::sampling::LEAST_SIGMA;
use crate::base::simd::{dispatch, multiply_add};

/// Rows of one item of work.
const BAND: usize = 64;

/// Flakes that are placed between two looks at whether to stop.
const RUN: usize = 1 << 16;

/// The image ends here, in sigma; beyond lie 4e-8 of its energy.
const REACH: f64 = 5.5;

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

    /// First and last pixel along an axis, the last one left out, of those from `first` to `end`.
    fn pixels(&self, axis: usize, (first, end): (usize, usize)) -> (usize, usize) {
        let last = self.start[axis] + self.way[axis];
        let room = REACH * self.sigma + 0.5;
        let low = (self.start[axis].min(last) - room).floor().clamp(first as f64, end as f64);
        let high = (self.start[axis].max(last) + room).ceil().clamp(first as f64, end as f64);
        (low as usize, high as usize)
    }
}

/// Draws the alpha of flakes into `out`, the rows and columns of a frame from `origin` on; where `depth`,
/// of the same pixels, is nearer than a flake it is hidden.
pub fn draw<P: Real, M: Real>(
    mut out: ArrayViewMut2<'_, P>,
    origin: (usize, usize),
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
    let (rows, columns) = ((origin.0, origin.0 + height), (origin.1, origin.1 + width));
    let tables = Tables::new();
    let mut images = Vec::new();
    let mut bands: Vec<Vec<u32>> = vec![Vec::new(); height.div_ceil(BAND)];
    let count = flakes.len();
    for start in (0..count).step_by(RUN) {
        cancel.check()?;
        flakes.each(start..(start + RUN).min(count), &mut |_, flake| {
            let Some(sprite) = Sprite::of(&flake, lens) else { return Ok(()) };
            let image = Image::of(&sprite, flake.radius, lens.focal);
            let (left, right) = image.pixels(0, columns);
            let (top, bottom) = image.pixels(1, rows);
            if left >= right || top >= bottom {
                return Ok(());
            }
            let (top, bottom) = (top - origin.0, bottom - origin.0);
            let number = u32::try_from(images.len())
                .map_err(|_| Error::invalid("density", "makes more than 2^32 flakes in view"))?;
            pushed(&mut images, image)?;
            for band in &mut bands[top / BAND..bottom.div_ceil(BAND)] {
                pushed(band, number)?;
            }
            Ok(())
        })?;
    }
    let (images, bands, tables) = (&images, &bands, &tables);
    let items = out.axis_chunks_iter_mut(Axis(0), BAND).enumerate();
    pool::for_each(items, |(number, mut band)| {
        let (first, rows) = (number * BAND, band.nrows());
        let hides: Vec<f64> = depth
            .iter()
            .flat_map(|map| map.slice(s![first..first + rows, ..]).into_iter().map(|z| z.wide()))
            .collect();
        let first = origin.0 + first;
        let mut left = vec![1.0_f64; band.len()];
        let mut image = Footprint::new((first, first + rows), columns);
        for flakes in bands[number].chunks(4096) {
            cancel.check()?;
            dim(&mut left, &hides, &mut image, flakes, images, tables);
        }
        for (pixel, left) in band.iter_mut().zip(&left) {
            *pixel = P::of(1.0 - left);
        }
        Ok(())
    })
}

dispatch! {
    /// Dims what is left of the light of a band's pixels by some flakes; where `hides` is nearer, or
    /// empty, nothing hides them.
    fn dim(
        left: &mut [f64],
        hides: &[f64],
        image: &mut Footprint,
        flakes: &[u32],
        images: &[Image],
        tables: &Tables,
    ) = dim_with
}

#[inline(always)]
fn dim_with<const LEVEL: u8>(
    left: &mut [f64],
    hides: &[f64],
    image: &mut Footprint,
    flakes: &[u32],
    images: &[Image],
    tables: &Tables,
) {
    for &flake in flakes {
        let flake = &images[flake as usize];
        image.of::<LEVEL>(flake, tables);
        image.dim(left, hides, flake.depth);
    }
}

/// The opacities of one flake over the pixels of a band.
struct Footprint {
    // Pixels of the band, first and end.
    band: [(usize, usize); 2],
    // Of the flake.
    columns: (usize, usize),
    rows: (usize, usize),
    across: Vec<f64>,
    down: Vec<f64>,
    alpha: Vec<f64>,
}

impl Footprint {
    fn new(rows: (usize, usize), columns: (usize, usize)) -> Self {
        let [across, down, alpha] = [(); 3].map(|()| Vec::new());
        Self { band: [columns, rows], columns, rows, across, down, alpha }
    }

    #[inline(always)]
    fn of<const LEVEL: u8>(&mut self, image: &Image, tables: &Tables) {
        self.columns = image.pixels(0, self.band[0]);
        self.rows = image.pixels(1, self.band[1]);
        let wide = self.columns.1 - self.columns.0;
        self.alpha.clear();
        self.alpha.resize(wide * (self.rows.1 - self.rows.0), 0.0);
        let length = (image.way[0] * image.way[0] + image.way[1] * image.way[1]).sqrt();
        if length == 0.0 {
            self.add::<LEVEL>(image, image.start, 1.0, &tables.normal);
            return;
        }
        let panels = (length / (RULES[RULES.len() - 1].0 * image.sigma)).ceil().max(1.0);
        let way = length / (panels * image.sigma);
        let rule = RULES.iter().position(|(longest, _)| way <= *longest).unwrap_or(RULES.len() - 1);
        for panel in 0..panels as usize {
            for &(node, weight) in &tables.rules[rule] {
                let part = (panel as f64 + node) / panels;
                let x = image.start[0] + part * image.way[0];
                let y = image.start[1] + part * image.way[1];
                self.add::<LEVEL>(image, [x, y], weight / panels, &tables.normal);
            }
        }
    }

    /// Adds the image of a flake that stands at a place for a part of the exposure.
    #[inline(always)]
    fn add<const LEVEL: u8>(&mut self, image: &Image, place: [f64; 2], part: f64, normal: &Normal) {
        let room = REACH * image.sigma + 0.5;
        let among = |place: f64, (low, high): (usize, usize)| {
            let from = ((place - room).max(low as f64) as usize).min(high);
            (from, ((place + room).ceil().max(low as f64) as usize).min(high))
        };
        let (from, to) = among(place[0], self.columns);
        let (top, bottom) = among(place[1], self.rows);
        normal.shares::<LEVEL>(&mut self.across, place[0], image.sigma, (from, to));
        normal.shares::<LEVEL>(&mut self.down, place[1], image.sigma, (top, bottom));
        let wide = self.columns.1 - self.columns.0;
        for (row, share) in (top..bottom).zip(&self.down) {
            let down = part * image.energy * share;
            let line = (row - self.rows.0) * wide + from - self.columns.0;
            for (alpha, across) in self.alpha[line..].iter_mut().zip(&self.across) {
                *alpha = multiply_add::<f64, LEVEL>(down, *across, *alpha);
            }
        }
    }

    #[inline(always)]
    fn dim(&self, left: &mut [f64], hides: &[f64], depth: f64) {
        let ((start, end), (from, to)) = (self.columns, self.band[0]);
        let wide = end - start;
        for row in self.rows.0..self.rows.1 {
            let line = (row - self.band[1].0) * (to - from) + start - from;
            let alphas = &self.alpha[(row - self.rows.0) * wide..][..wide];
            let left = &mut left[line..][..wide];
            if hides.is_empty() {
                for (left, alpha) in left.iter_mut().zip(alphas) {
                    *left *= 1.0 - alpha.min(1.0);
                }
                continue;
            }
            for ((left, alpha), wall) in left.iter_mut().zip(alphas).zip(&hides[line..]) {
                if *wall >= depth {
                    *left *= 1.0 - alpha.min(1.0);
                }
            }
        }
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
        draw(out.view_mut(), (0, 0), &flakes, &LENS, None::<ArrayView2<f32>>, &Cancel::new())
            .unwrap();
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
