//! Which flake a pixel shows: the one whose own opacity there is the greatest.

use std::ops::Range;

use ndarray::{ArrayView2, ArrayViewMut2, Axis};

use super::profile::{self, bare};
use super::splat::{Flakes, Source, check_lens};
use super::sprite::{Lens, REACH, Sprite};
use crate::base::cover::pixels;
use crate::base::error::{Cancel, Error};
use crate::base::normal::most;
use crate::base::pool;
use crate::base::real::Real;
use crate::base::simd::{PORTABLE, dispatch};

/// Rows of one item of work.
const BAND: usize = 16;

/// Pixels of a row that are worked on together.
const LANES: usize = 8;

/// What is the greatest value but for rounding.
const SURELY: f64 = 1.01;

/// Where no flake is.
pub const NONE: i32 = -1;

/// Writes the index of the flake with the greatest opacity of its own into each pixel of `out`, (H, W), or
/// [`NONE`]. Of equals it is the first.
///
/// Flakes are those of [`super::splat::splat`], pixel by pixel in float64; `depth` hides as there.
pub fn ids<M: Real>(
    mut out: ArrayViewMut2<i32>,
    flakes: &Flakes<'_>,
    lens: &Lens,
    depth: Option<ArrayView2<M>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    flakes.check()?;
    check_lens(lens)?;
    if depth.as_ref().is_some_and(|map| map.dim() != out.dim()) {
        return Err(Error::invalid("depth", format!("must have shape {:?}", out.dim())));
    }
    let count = flakes.points.nrows();
    if i32::try_from(count).is_err() {
        return Err(Error::invalid("points", "must be fewer than 2^31"));
    }
    let mut shown: Vec<Shown> = Vec::new();
    shown
        .try_reserve_exact(count)
        .map_err(|_| Error::Memory { bytes: count * size_of::<Shown>() })?;
    for index in 0..count {
        if index % 65_536 == 0 {
            cancel.check()?;
        }
        let flake = flakes.get(index);
        if let Some(sprite) = flake.and_then(|flake| Sprite::of(&flake, lens)) {
            let half = 0.5 * sprite.length;
            let middle = [0, 1].map(|axis| sprite.start[axis] + half * sprite.along[axis]);
            let most = SURELY * alpha_at(&sprite, middle);
            shown.push(Shown { sprite, most, index: index as i32 });
        }
    }
    // The strongest first: most others need not be looked at where one of these is.
    shown.sort_by(|one, other| other.most.total_cmp(&one.most));
    let (height, width) = out.dim();
    let mut of_bands: Vec<Vec<u32>> = vec![Vec::new(); height.div_ceil(BAND)];
    for (place, one) in shown.iter().enumerate() {
        let (low, high) = one.sprite.bounds();
        if let Some(rows) = pixels(low[1], high[1], height) {
            for band in &mut of_bands[rows.start / BAND..rows.end.div_ceil(BAND)] {
                band.push(place as u32);
            }
        }
    }
    let bands = out.axis_chunks_iter_mut(Axis(0), BAND).zip(of_bands).enumerate();
    pool::for_each(bands, |(number, (mut band, places))| {
        cancel.check()?;
        band.fill(NONE);
        let top = number * BAND;
        let (mut best, mut alphas) = (vec![0.0_f64; band.len()], vec![0.0_f64; width + LANES]);
        for place in places {
            let Shown { sprite, most, index } = &shown[place as usize];
            let (low, high) = sprite.bounds();
            let shift = top as f64;
            let Some(rows) = pixels(low[1] - shift, high[1] - shift, band.nrows()) else {
                continue;
            };
            for row in rows {
                let y = (top + row) as f64 + 0.5;
                let Some(columns) = columns(sprite, [low[0], high[0]], y, width) else { continue };
                let best = &mut best[row * width..][columns.clone()];
                if best.iter().all(|best| most < best) {
                    continue;
                }
                let alphas = &mut alphas[..columns.len().next_multiple_of(LANES)];
                alphas_of(sprite, (columns.start as f64 + 0.5, y), alphas);
                for ((column, &alpha), best) in columns.zip(&*alphas).zip(best) {
                    let shown = &mut band[[row, column]];
                    let more = alpha > *best || (alpha == *best && alpha > 0.0 && *index < *shown);
                    // As the pixels are drawn: in float32.
                    let hidden = || match &depth {
                        Some(map) => (map[[top + row, column]].wide() as f32) < sprite.depth as f32,
                        None => false,
                    };
                    if more && !hidden() {
                        *best = alpha;
                        *shown = *index;
                    }
                }
            }
        }
        Ok(())
    })
}

/// A flake in the picture.
struct Shown {
    sprite: Sprite,
    /// Its image is nowhere more opaque: it is most so in its middle.
    most: f64,
    index: i32,
}

/// The pixels of a row at `y` that a sprite with given ends along x can cover.
fn columns(sprite: &Sprite, [low, high]: [f64; 2], y: f64, width: usize) -> Option<Range<usize>> {
    let [ux, uy] = sprite.along;
    if sprite.length == 0.0 || sprite.square() || uy.abs() < 1e-3 {
        return pixels(low, high, width);
    }
    // A slanted streak fills a small part of its box: no more than 4 sigma beside its line.
    let on_line = sprite.start[0] + (y - sprite.start[1]) * ux / uy;
    let beside = SURELY * REACH * sprite.sigma / uy.abs();
    pixels(low.max(on_line - beside), high.min(on_line + beside), width)
}

/// The opacities of one flake at points of a row, a pixel apart, as many as fill
/// vectors: the definition, without a table or a tile.
#[inline(always)]
fn alphas_with<const LEVEL: u8>(sprite: &Sprite, (first, y): (f64, f64), alphas: &mut [f64]) {
    let (sigma, amplitude, [ux, uy]) = (sprite.sigma, sprite.amplitude, sprite.along);
    let y = (y - sprite.start[1]) / sigma;
    let (length, square) = (sprite.length / sigma, sprite.square());
    let [wide_x, wide_y] = profile::widening([length * ux, length * uy]);
    let swept = amplitude * std::f64::consts::FRAC_PI_2.sqrt() / length;
    let down = profile::rim(((y - 0.5 * length * uy) / wide_y).abs());
    // Whole vectors: rows of small flakes are shorter than one. A closure would lose the instructions.
    for (block, alphas) in alphas.chunks_exact_mut(LANES).enumerate() {
        let (mut x, mut along, mut across) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for k in 0..LANES {
            x[k] = (first + (block * LANES + k) as f64 - sprite.start[0]) / sigma;
            along[k] = x[k] * ux + y * uy;
            across[k] = y * ux - x[k] * uy;
        }
        if length == 0.0 {
            for k in 0..LANES {
                alphas[k] = amplitude
                    * profile::gaussian::<_, PORTABLE>(along[k])
                    * profile::gaussian::<_, PORTABLE>(across[k]);
            }
            continue;
        }
        for k in 0..LANES {
            alphas[k] = swept
                * bare::<_, PORTABLE>(across[k])
                * profile::swept::<_, PORTABLE>(along[k], length - along[k]);
        }
        if square {
            for k in 0..LANES {
                alphas[k] *= profile::rim(((x[k] - 0.5 * length * ux) / wide_x).abs()) * down;
            }
        } else {
            for k in 0..LANES {
                let end = profile::rim(most(-along[k], along[k] - length));
                alphas[k] *= profile::rim(across[k].abs()) * end;
            }
        }
    }
}

dispatch! {
    fn alphas_of(sprite: &Sprite, first: (f64, f64), alphas: &mut [f64]) = alphas_with
}

/// The same at one point.
fn alpha_at(sprite: &Sprite, [x, y]: [f64; 2]) -> f64 {
    let mut alpha = [0.0; LANES];
    alphas_with::<PORTABLE>(sprite, (x, y), &mut alpha);
    alpha[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::splat::splat;
    use ndarray::{Array2, array};

    const LENS: Lens = Lens { focal: 50.0, center: [20.0, 15.0], offset: [0.0; 3], near: 0.1 };

    #[test]
    fn one_flake_alone_is_where_it_is_drawn() {
        for velocity in [[0.0, 0.0, 0.0], [0.001, 0.0, 0.0], [0.1, 0.2, 0.0], [-0.4, 0.3, 0.2]] {
            let (points, radius) = (array![[0.05, -0.02, 1.0]], array![0.08]);
            let (opacity, velocity) =
                (array![0.9], Array2::from_shape_fn((1, 3), |(_, i)| velocity[i]));
            let flakes = Flakes {
                points: points.view(),
                radius: radius.view(),
                opacity: opacity.view(),
                velocity: velocity.view(),
                shutter: 1.0,
            };
            let mut alpha = Array2::<f64>::zeros((31, 41));
            splat(alpha.view_mut(), &flakes, &LENS, None::<ArrayView2<f32>>, &Cancel::new())
                .unwrap();
            let mut found = Array2::<i32>::zeros((31, 41));
            ids(found.view_mut(), &flakes, &LENS, None::<ArrayView2<f32>>, &Cancel::new()).unwrap();
            let sprite = Sprite::of(&flakes.get(0).unwrap(), &LENS).unwrap();
            for ((row, column), &value) in alpha.indexed_iter() {
                let own = alpha_at(&sprite, [column as f64 + 0.5, row as f64 + 0.5]);
                assert!((own - value).abs() < 1e-12, "{own} {value}");
                assert_eq!(found[[row, column]] == 0, own > 0.0);
            }
        }
    }

    #[test]
    fn the_strongest_wins_and_of_equals_the_first() {
        let points = array![[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.02, 0.0, 1.0], [-9.0, 0.0, 1.0]];
        let flakes = |opacity| Flakes {
            points: points.view(),
            radius: ndarray::aview1(&[0.08]),
            opacity,
            velocity: ndarray::aview2(&[[0.0, 0.0, 0.0]]),
            shutter: 0.0,
        };
        let mut found = Array2::<i32>::zeros((31, 41));
        let opacity = array![0.5, 0.5, 0.5, 1.0];
        ids(
            found.view_mut(),
            &flakes(opacity.view()),
            &LENS,
            None::<ArrayView2<f32>>,
            &Cancel::new(),
        )
        .unwrap();
        assert_eq!((found[[15, 19]], found[[15, 21]], found[[0, 0]]), (0, 2, NONE));
        let near = Array2::<f32>::from_elem((31, 41), 0.5);
        ids(found.view_mut(), &flakes(opacity.view()), &LENS, Some(near.view()), &Cancel::new())
            .unwrap();
        assert!(found.iter().all(|&id| id == NONE));
    }
}
