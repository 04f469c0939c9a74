//! The image of many flakes of one color: alpha = 1 - prod(1 - alpha_i), whatever their order.

use std::ops::Range;

use ndarray::{ArrayView1, ArrayView2, ArrayViewMut2};

use super::profile::Profile;
use super::sorted::Sorted;
use super::sprite::{Flake, Lens, Sprite};
use crate::base::error::{Cancel, Error, finite};
use crate::base::real::Real;
use crate::base::scan;

/// Flakes as arrays: points (n, 3) in camera axes; the others have n rows, or one for all.
#[derive(Debug, Clone, Copy)]
pub struct Flakes<'a> {
    /// At mid-exposure, world units.
    pub points: ArrayView2<'a, f64>,
    /// World units.
    pub radius: ArrayView1<'a, f64>,
    /// 0 to 1.
    pub opacity: ArrayView1<'a, f64>,
    /// Flake minus camera, world units per frame.
    pub velocity: ArrayView2<'a, f64>,
    /// Frames.
    pub shutter: f64,
}

/// Where flakes come from.
pub trait Source: Sync {
    /// How many there are.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A flake, or None if it is known not to be seen.
    fn get(&self, index: usize) -> Option<Flake>;

    /// Hands on those of a range that may be seen, in their order.
    #[inline(always)]
    fn each(
        &self,
        range: Range<usize>,
        see: &mut impl FnMut(usize, Flake) -> Result<(), Error>,
    ) -> Result<(), Error> {
        for index in range {
            if let Some(flake) = self.get(index) {
                see(index, flake)?;
            }
        }
        Ok(())
    }

    /// Refuses what cannot be drawn.
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }
}

impl Source for Flakes<'_> {
    fn len(&self) -> usize {
        self.points.nrows()
    }

    fn check(&self) -> Result<(), Error> {
        let count = self.points.nrows();
        if self.points.ncols() != 3 {
            return Err(Error::invalid("points", "must be (n, 3)"));
        }
        let rows = |length: usize| [1, count].contains(&length);
        if !rows(self.radius.len()) {
            return Err(Error::invalid("radius", "must be one number, or one for each point"));
        }
        if !rows(self.opacity.len()) {
            return Err(Error::invalid("opacity", "must be one number, or one for each point"));
        }
        if self.velocity.ncols() != 3 || !rows(self.velocity.nrows()) {
            return Err(Error::invalid("velocity", "must be (3,), or one row for each point"));
        }
        let all_finite = |argument, ok: bool| {
            if ok { Ok(()) } else { Err(Error::invalid(argument, "must be finite")) }
        };
        let finite = |values: &ArrayView2<'_, f64>| match values.as_slice() {
            Some(values) => scan::all_finite(values),
            None => Ok(values.iter().all(|value| value.is_finite())),
        };
        all_finite("points", finite(&self.points)?)?;
        all_finite("velocity", finite(&self.velocity)?)?;
        let within = |values: &ArrayView1<'_, f64>, most: f64| match values.as_slice() {
            Some(values) => scan::all_within(values, 0.0, most),
            None => Ok(values.iter().all(|value| (0.0..=most).contains(value))),
        };
        let bad = |values: &ArrayView1<'_, f64>, most: f64| {
            if within(values, most)? {
                return Ok(None);
            }
            Ok(values.iter().copied().find(|value| !(0.0..=most).contains(value)))
        };
        if let Some(bad) = bad(&self.radius, f64::MAX)? {
            return Err(Error::invalid(
                "radius",
                format!("must be finite and not negative, got {bad}"),
            ));
        }
        if let Some(bad) = bad(&self.opacity, 1.0)? {
            return Err(Error::invalid("opacity", format!("must be from 0 to 1, got {bad}")));
        }
        if !(self.shutter >= 0.0 && self.shutter.is_finite()) {
            return Err(Error::invalid(
                "shutter",
                format!("must be finite and not negative, got {}", self.shutter),
            ));
        }
        Ok(())
    }

    #[inline(always)]
    fn get(&self, index: usize) -> Option<Flake> {
        let row = |length: usize| if length == 1 { 0 } else { index };
        let velocity = row(self.velocity.nrows());
        Some(Flake {
            point: [0, 1, 2].map(|axis| self.points[[index, axis]]),
            radius: self.radius[row(self.radius.len())],
            opacity: self.opacity[row(self.opacity.len())],
            travel: [0, 1, 2].map(|axis| self.shutter * self.velocity[[velocity, axis]]),
        })
    }
}

pub(super) fn check_lens(lens: &Lens) -> Result<(), Error> {
    let plain = lens.center.iter().chain(&lens.offset);
    for &value in plain {
        finite("camera", value)?;
    }
    if !(lens.focal > 0.0 && lens.focal.is_finite()) {
        return Err(Error::invalid(
            "camera",
            format!("focal must be positive, got {}", lens.focal),
        ));
    }
    if !(lens.near > 0.0 && lens.near.is_finite()) {
        return Err(Error::invalid("near", format!("must be positive, got {}", lens.near)));
    }
    Ok(())
}

/// Draws the flakes' alpha into `out`, (H, W), in [0, 1]; see [`Sorted::draw`].
pub fn splat<P: Profile, M: Real>(
    out: ArrayViewMut2<P>,
    flakes: &impl Source,
    lens: &Lens,
    depth: Option<ArrayView2<M>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let shape = out.dim();
    let whole = [0, shape.0, 0, shape.1];
    Sorted::of(flakes, lens, shape, cancel)?.draw(out, whole, depth, cancel)
}

/// A rough estimate of the work in nanoseconds, from a sample of the flakes.
pub fn estimate(shape: (usize, usize), flakes: &impl Source, lens: &Lens) -> f64 {
    let pixels = shape.0 as f64 * shape.1 as f64;
    let count = flakes.len();
    if flakes.check().is_err() {
        return 0.0;
    }
    let stride = count.div_ceil(256).max(1);
    let area: f64 = (0..count)
        .step_by(stride)
        .filter_map(|index| Sprite::of(&flakes.get(index)?, lens))
        .map(|sprite| {
            let (low, high) = sprite.bounds();
            let side = |axis: usize, limit: usize| {
                (high[axis].min(limit as f64) - low[axis].max(0.0)).max(0.0)
            };
            side(0, shape.1) * side(1, shape.0)
        })
        .sum();
    pixels + count as f64 * 100.0 + 2.0 * area * stride as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::Hash;
    use ndarray::{Array1, Array2, array};

    const LENS: Lens = Lens { focal: 100.0, center: [70.0, 45.0], offset: [0.0; 3], near: 0.1 };

    struct Owned {
        points: Array2<f64>,
        radius: Array1<f64>,
        velocity: Array2<f64>,
        shutter: f64,
    }

    fn drawn<P: Profile>(owned: &Owned, shape: (usize, usize), opacity: f64) -> Array2<P> {
        // Dirty, so that a pixel that is not written shows.
        let mut out = Array2::from_elem(shape, P::nan());
        let opacity = array![opacity];
        let flakes = Flakes {
            points: owned.points.view(),
            radius: owned.radius.view(),
            opacity: opacity.view(),
            velocity: owned.velocity.view(),
            shutter: owned.shutter,
        };
        splat(out.view_mut(), &flakes, &LENS, None::<ArrayView2<f32>>, &Cancel::new()).unwrap();
        out
    }

    fn cloud(count: usize, shutter: f64) -> Owned {
        let unit = |i: usize, word: i64| Hash::seeded(3).word(i as i64).word(word).unit();
        Owned {
            points: Array2::from_shape_fn((count, 3), |(i, axis)| {
                [2.0 * unit(i, 0) - 1.0, 1.5 * unit(i, 1) - 0.7, 0.5 + 2.0 * unit(i, 2)][axis]
            }),
            radius: Array1::from_shape_fn(count, |i| 0.02 + 0.1 * unit(i, 3).powi(8)),
            velocity: Array2::from_shape_fn((count, 3), |(i, axis)| unit(i, 4 + axis as i64) - 0.5),
            shutter,
        }
    }

    /// The definition, pixel by pixel in float64, from the sprites.
    fn slow(owned: &Owned, shape: (usize, usize), opacity: f64) -> Array2<f64> {
        let mut through = Array2::from_elem(shape, 1.0);
        for i in 0..owned.points.nrows() {
            let flake = Flake {
                point: [0, 1, 2].map(|axis| owned.points[[i, axis]]),
                radius: owned.radius[i],
                opacity,
                travel: [0, 1, 2].map(|axis| owned.velocity[[i, axis]] * owned.shutter),
            };
            let Some(s) = Sprite::of(&flake, &LENS) else { continue };
            for ((row, column), through) in through.indexed_iter_mut() {
                let x = (column as f64 + 0.5 - s.start[0]) / s.sigma;
                let y = (row as f64 + 0.5 - s.start[1]) / s.sigma;
                let (along, across) =
                    (x * s.along[0] + y * s.along[1], y * s.along[0] - x * s.along[1]);
                let length = s.length / s.sigma;
                let rim = |u: f64| crate::particles::profile::rim(u);
                let gauss = (-0.5 * across * across).exp();
                let swept = if length == 0.0 {
                    (-0.5 * along * along).exp()
                } else {
                    let erf = |u: f64| libm::erf(u * std::f64::consts::FRAC_1_SQRT_2);
                    (erf(along) + erf(length - along)) * (0.5 * std::f64::consts::PI).sqrt()
                        / length
                };
                let rims = if length < 1.0 {
                    let [ux, uy] = s.along.map(|u| length * u);
                    let wide = |u: f64| (1.0 + u * u / 12.0).sqrt();
                    rim((x - 0.5 * ux).abs() / wide(ux)) * rim((y - 0.5 * uy).abs() / wide(uy))
                } else {
                    rim(across.abs()) * rim((-along).max(along - length))
                };
                *through *= 1.0 - s.amplitude * gauss * swept * rims;
            }
        }
        through.mapv(|through| 1.0 - through)
    }

    #[test]
    fn the_tiles_are_the_definition() {
        for shutter in [0.0, 0.05, 0.3, 3.0] {
            let owned = cloud(200, shutter);
            let shape = (97, 131);
            let wanted = slow(&owned, shape, 0.8);
            let wide = drawn::<f64>(&owned, shape, 0.8);
            let narrow = drawn::<f32>(&owned, shape, 0.8);
            for ((want, wide), narrow) in wanted.iter().zip(&wide).zip(&narrow) {
                assert!((want - wide).abs() < 2e-13, "{shutter}: {want} {wide}");
                assert!((want - f64::from(*narrow)).abs() < 4e-6, "{shutter}: {want} {narrow}");
            }
        }
    }

    #[test]
    fn a_hundred_thousand_layers_let_through_what_they_should() {
        let count = 100_000;
        let owned = Owned {
            points: Array2::from_shape_fn((count, 3), |(_, axis)| [0.0, 0.0, 1.0][axis]),
            radius: array![1.0],
            velocity: array![[0.0, 0.0, 0.0]],
            shutter: 0.0,
        };
        let alpha = drawn::<f32>(&owned, (90, 140), 1e-5);
        let raw = 100.0_f64 / 3.0;
        let variance = raw * raw + 1.0 / 12.0;
        let layer =
            1e-5 * raw * raw / variance * (1.0 + 4.8e-4 / variance) * (-0.25 / variance).exp();
        let want = 1.0 - (count as f64 * (-layer).ln_1p()).exp();
        assert!((f64::from(alpha[[45, 70]]) - want).abs() < 1e-6, "{} {want}", alpha[[45, 70]]);
    }

    #[test]
    fn refusals_name_the_argument() {
        let mut out = Array2::<f32>::zeros((4, 4));
        let good = cloud(3, 0.0);
        let (one, zero) = (array![1.0], array![[0.0, 0.0, 0.0]]);
        let flakes = Flakes {
            points: good.points.view(),
            radius: one.view(),
            opacity: one.view(),
            velocity: zero.view(),
            shutter: 0.0,
        };
        let bad_points = array![[0.0, f64::NAN, 1.0]];
        let bad = array![-1.0];
        for (name, flakes) in [
            ("points", Flakes { points: bad_points.view(), ..flakes }),
            ("radius", Flakes { radius: bad.view(), ..flakes }),
            ("opacity", Flakes { opacity: bad.view(), ..flakes }),
            ("velocity", Flakes { velocity: bad_points.view(), ..flakes }),
            ("shutter", Flakes { shutter: -1.0, ..flakes }),
        ] {
            let error =
                splat(out.view_mut(), &flakes, &LENS, None::<ArrayView2<f32>>, &Cancel::new())
                    .unwrap_err();
            assert!(error.to_string().starts_with(name), "{error}");
        }
    }

    #[test]
    fn a_raised_flag_ends_the_work() {
        let cancel = Cancel::new();
        cancel.raise();
        let owned = cloud(3, 0.0);
        let one = array![1.0];
        let flakes = Flakes {
            points: owned.points.view(),
            radius: one.view(),
            opacity: one.view(),
            velocity: owned.velocity.view(),
            shutter: 0.0,
        };
        let mut out = Array2::<f32>::zeros((4, 4));
        assert_eq!(
            splat(out.view_mut(), &flakes, &LENS, None::<ArrayView2<f32>>, &cancel),
            Err(Error::Cancelled)
        );
    }
}
