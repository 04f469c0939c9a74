//! The flakes of a box seen by a camera: each is placed, and dropped at once if it is out of view.
//!
//! The box holds several times as many flakes as the picture shows. Doing step after step for all of
//! them, through arrays, costs more than drawing those that are seen.

use std::ops::Range;

use super::block::{Eye, each_seen};
use super::looks::{Looks, presence, sigma, size_fade};
use super::splat::Source;
use super::sprite::{Flake, Lens};
use super::torus::Carried;
use super::view::View;
use crate::base::error::{Cancel, Error, collected};
use crate::base::pool;
use crate::base::random::Hash;

/// Flakes of a box, as [`super::splat::splat`] draws them.
pub struct Flurry {
    count: usize,
    carried: Carried,
    looks: Looks,
    sizes: Hash,
    focal: f64,
    travel: [f64; 3],
    view: View,
    /// Another eye, that sees the same flakes from aside.
    aside: Option<View>,
}

impl Flurry {
    /// Flakes 0 .. `count`, which all move by `travel` during the exposure, before a lens.
    ///
    /// Those that are not seen in the window, pixels (top, bottom, left, right), are dropped.
    pub fn new(
        count: usize,
        carried: Carried,
        seed: i64,
        looks: Looks,
        lens: &Lens,
        window: [usize; 4],
        travel: [f64; 3],
    ) -> Result<Self, Error> {
        if !looks.sound() || !travel.iter().all(|v| v.is_finite()) {
            return Err(Error::Internal(format!("no flakes look like {looks:?}, {travel:?}")));
        }
        let length = travel.iter().map(|v| v * v).sum::<f64>().sqrt();
        let room = carried.reach() + length + 2.0 * looks.radius.1;
        Ok(Self {
            count,
            carried,
            looks,
            sizes: Hash::seeded(seed).word(looks.sizes),
            focal: lens.focal,
            travel,
            view: View::new(lens, window, room),
            aside: None,
        })
    }

    /// The same flakes, dropped only where neither the lens nor another one of its focal length sees
    /// them.
    pub fn seen_from(mut self, lens: &Lens, window: [usize; 4]) -> Result<Self, Error> {
        if lens.focal != self.focal {
            return Err(Error::invalid("cameras", "must have one focal length"));
        }
        self.aside = Some(View::new(lens, window, self.view.room));
        Ok(self)
    }

    /// A flake at its place before the sway, unless it does not show.
    #[inline(always)]
    fn flake(&self, index: usize, [x, y, z]: [f64; 3]) -> Option<Flake> {
        let Looks { radius, opacity, amount, fade_in, largest, .. } = self.looks;
        let there = presence(index, self.count, amount, fade_in);
        if there == 0.0 {
            return None;
        }
        let [aside, ahead] = self.carried.swing(self.carried.flake(index));
        let point = [x + aside, y, z + ahead];
        let size = self.sizes.word(index as i64).unit();
        let radius = radius.0 + size * (radius.1 - radius.0);
        let sharp = size_fade(sigma(self.focal, radius, point[2]), largest);
        let weight = there * self.carried.shown(point) * sharp;
        (weight > 0.0).then_some(Flake {
            point,
            radius,
            opacity: weight * opacity,
            travel: self.travel,
        })
    }
}

impl Eye for Flurry {
    #[inline(always)]
    fn sees(&self, place: [f64; 3]) -> bool {
        self.view.sees(place) | self.aside.as_ref().is_some_and(|view| view.sees(place))
    }
}

/// Flakes that have been placed, by their numbers: for several pictures of them.
pub struct Placed(Vec<Option<Flake>>);

/// Flakes that are placed together.
const RUN: usize = 1 << 13;

impl Placed {
    /// Places the flakes of a source that are seen. All keep their numbers: runs are those of the
    /// source, so that pictures have its bits.
    pub fn of(source: &impl Source, cancel: &Cancel) -> Result<Self, Error> {
        source.check()?;
        let mut flakes = collected((0..source.len()).map(|_| None))?;
        pool::for_each(
            flakes.chunks_mut(RUN).enumerate(),
            |(run, flakes): (usize, &mut [Option<Flake>])| {
                cancel.check()?;
                let start = run * RUN;
                source.each(start..start + flakes.len(), &mut |index, flake| {
                    flakes[index - start] = Some(flake);
                    Ok(())
                })
            },
        )?;
        Ok(Self(flakes))
    }
}

impl Source for Placed {
    fn len(&self) -> usize {
        self.0.len()
    }

    #[inline(always)]
    fn get(&self, index: usize) -> Option<Flake> {
        self.0[index]
    }
}

impl Source for Flurry {
    fn len(&self) -> usize {
        self.count
    }

    #[inline(always)]
    fn get(&self, index: usize) -> Option<Flake> {
        let place = self.carried.place(index);
        self.sees(place).then(|| self.flake(index, place))?
    }

    #[inline(always)]
    fn each(
        &self,
        range: Range<usize>,
        see: &mut impl FnMut(usize, Flake) -> Result<(), Error>,
    ) -> Result<(), Error> {
        each_seen(&self.carried, self, range, |index, place| match self.flake(index, place) {
            Some(flake) => see(index, flake),
            None => Ok(()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::error::Cancel;
    use crate::particles::splat::{Flakes, splat};
    use crate::particles::torus::{Sway, Torus, edge_fade, positions};
    use ndarray::{Array1, Array2, ArrayView2, array, s};

    const LOOKS: Looks = Looks {
        radius: (0.02, 0.08),
        opacity: 0.9,
        amount: 0.7,
        fade_in: 0.1,
        largest: (3.5, 6.0),
        sizes: 101,
    };

    /// Step after step, through arrays: what the frame must be.
    fn stepwise(
        torus: &Torus,
        way: [f64; 3],
        sway: Sway,
        lens: &Lens,
        travel: [f64; 3],
    ) -> Array2<f64> {
        let (count, cancel) = (4000, Cancel::new());
        let mut points = Array2::zeros((count, 3));
        let way = Array2::from_shape_vec((1, 3), way.to_vec()).unwrap();
        positions(points.view_mut(), torus, (5, None), way.view(), 1.0, Some(sway), &cancel)
            .unwrap();
        let mut shown = Array1::zeros(count);
        edge_fade(shown.view_mut(), points.view(), torus, &cancel).unwrap();
        let mut sizes = vec![0.0; count];
        crate::base::random::uniform(&mut sizes, 5, LOOKS.sizes);
        let radius: Array1<f64> =
            sizes.iter().map(|u| LOOKS.radius.0 + u * (LOOKS.radius.1 - LOOKS.radius.0)).collect();
        let opacity = Array1::from_shape_fn(count, |i| {
            let rank = (i as f64 + 0.5) / count as f64;
            let there = ((0.7 - rank * 0.9) / 0.1).clamp(0.0, 1.0);
            let sigma = lens.focal * radius[i] / (3.0 * points[[i, 2]].max(1e-6));
            let t = ((sigma - 3.5) / 2.5).clamp(0.0, 1.0);
            0.9 * there * shown[i] * (1.0 - t * t * (3.0 - 2.0 * t))
        });
        let velocity = array![[travel[0], travel[1], travel[2]]];
        let flakes = Flakes {
            points: points.view(),
            radius: radius.view(),
            opacity: opacity.view(),
            velocity: velocity.view(),
            shutter: 1.0,
        };
        let mut out = Array2::zeros((96, 160));
        splat(out.view_mut(), &flakes, lens, None::<ArrayView2<f32>>, &cancel).unwrap();
        out
    }

    #[test]
    fn nothing_that_is_seen_is_dropped() {
        for (offset, center, travel) in [
            ([0.0; 3], [80.0, 48.0], [0.0; 3]),
            ([0.3, -0.1, 0.0], [20.0, 90.0], [0.02, 0.3, 0.0]),
            // A middle far outside the picture, and flakes that come at the eye.
            ([0.0, 0.0, 0.4], [-150.0, 48.0], [0.0, 0.05, -1.0]),
        ] {
            let lens = Lens { focal: 150.0, center, offset, near: 0.1 };
            let torus = Torus::new([9.0, 6.0, 8.0], [0.0, 0.0, 4.0]).unwrap();
            let sway = Sway { amplitude: 0.05, angular_frequency: 2.0 };
            let way = [3.0, 14.0, -2.5];
            let wanted = stepwise(&torus, way, sway, &lens, travel);
            let carried = Carried::new(torus, 5, way, 1.0, Some(sway)).unwrap();
            let whole = [0, 96, 0, 160];
            let flurry = Flurry::new(4000, carried, 5, LOOKS, &lens, whole, travel).unwrap();
            let kept = (0..4000).filter(|&i| flurry.get(i).is_some()).count();
            assert!(kept < 2500, "{kept}");
            let mut got = Array2::from_elem((96, 160), f64::NAN);
            splat(got.view_mut(), &flurry, &lens, None::<ArrayView2<f32>>, &Cancel::new()).unwrap();
            let most = wanted.iter().fold(0.0, |most: f64, &a| most.max(a));
            assert!(most > 0.02, "{most}");
            for (got, want) in got.iter().zip(&wanted) {
                assert!((got - want).abs() < 1e-14, "{got} {want}");
            }
            // A window has the whole's bits, and asks for fewer flakes.
            let window = [40, 60, 100, 140];
            let part = Flurry::new(4000, carried, 5, LOOKS, &lens, window, travel).unwrap();
            let fewer = (0..4000).filter(|&i| part.get(i).is_some()).count();
            assert!(fewer < kept / 2, "{fewer} of {kept}");
            let mut some = Array2::from_elem((96, 160), f64::NAN);
            splat(some.view_mut(), &part, &lens, None::<ArrayView2<f32>>, &Cancel::new()).unwrap();
            assert_eq!(some.slice(s![40..60, 100..140]), got.slice(s![40..60, 100..140]));
        }
    }

    #[test]
    fn placed_once_for_two_eyes_they_are_the_flakes_of_each() {
        let (shape, window) = ((96, 160), [0, 96, 0, 160]);
        let torus = Torus::new([9.0, 6.0, 8.0], [0.0, 0.0, 4.0]).unwrap();
        let sway = Sway { amplitude: 0.05, angular_frequency: 2.0 };
        let carried = || Carried::new(torus, 5, [3.0, 14.0, -2.5], 1.0, Some(sway)).unwrap();
        let lens = |x: f64| Lens {
            focal: 150.0,
            center: [80.0 + 10.0 * x, 48.0],
            offset: [x, 0.0, 0.0],
            near: 0.1,
        };
        let lenses = [lens(-0.4), lens(0.4)];
        let travel = [0.02, 0.3, 0.0];
        let alone =
            |lens: &Lens| Flurry::new(4000, carried(), 5, LOOKS, lens, window, travel).unwrap();
        let drawn = |source: &dyn Fn(&mut Array2<f32>)| {
            let mut out = Array2::from_elem(shape, f32::NAN);
            source(&mut out);
            out
        };
        let cancel = Cancel::new();
        let none = None::<ArrayView2<f32>>;
        let both = alone(&lenses[0]).seen_from(&lenses[1], window).unwrap();
        let placed = Placed::of(&both, &cancel).unwrap();
        // Neither sees all of them.
        let kept = |flurry: &Flurry| (0..4000).filter(|&i| flurry.get(i).is_some()).count();
        let all = placed.0.iter().flatten().count();
        assert!(lenses.iter().all(|lens| kept(&alone(lens)) < all));
        for lens in &lenses {
            let want = drawn(&|out| {
                splat(out.view_mut(), &alone(lens), lens, none, &cancel).unwrap();
            });
            let got = drawn(&|out| splat(out.view_mut(), &placed, lens, none, &cancel).unwrap());
            assert_eq!(got, want);
        }
        let other = Lens { focal: 151.0, ..lenses[1] };
        assert!(alone(&lenses[0]).seen_from(&other, window).is_err());
    }
}
