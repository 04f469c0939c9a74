//! Flakes: positions, fades, the image.

use numpy::ndarray::{ArrayView2, ArrayViewMut2};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2};
use pyo3::prelude::*;

use super::gate::{self, Plane, PlaneMut};
use crate::error::Error;
use crate::particles::flurry::{Flurry, Looks, Placed};
use crate::particles::ids;
use crate::particles::profile::Profile;
use crate::particles::splat::{self, Flakes, Source};
use crate::particles::sprite::Lens;
use crate::particles::torus::{self, Carried, Sway, Torus};
use crate::real::Real;

fn swaying(sway: Option<(f64, f64)>) -> Option<Sway> {
    sway.map(|(amplitude, angular_frequency)| Sway { amplitude, angular_frequency })
}

/// Fills `out` (n, 3) with the positions of flakes 0..n at `time`.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the Python layer passes plain values")]
pub fn particle_positions(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f64>,
    sides: [f64; 3],
    center: [f64; 3],
    seed: i64,
    velocity: PyReadonlyArray2<'_, f64>,
    time: f64,
    sway: Option<(f64, f64)>,
) -> PyResult<()> {
    let (out, velocity) = (out.as_array_mut(), velocity.as_array());
    gate::run(py, 60.0 * out.nrows() as f64, |cancel| {
        let torus = Torus::new(sides, center)?;
        torus::positions(out, &torus, seed, velocity, time, swaying(sway), cancel)
    })
}

/// Fills `out` (n, 3) with what the sway adds to the positions of flakes 0..n at `time`.
#[pyfunction]
pub fn particle_sway_offsets(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f64>,
    seed: i64,
    time: f64,
    sway: (f64, f64),
) -> PyResult<()> {
    let out = out.as_array_mut();
    let sway = Sway { amplitude: sway.0, angular_frequency: sway.1 };
    gate::run(py, 60.0 * out.nrows() as f64, |cancel| {
        torus::sway_offsets(out, seed, time, sway, cancel)
    })
}

/// Fills `out` (n,) with how much of each point is shown: less near the walls of the box.
#[pyfunction]
pub fn particle_edge_fade(
    py: Python<'_>,
    mut out: PyReadwriteArray1<'_, f64>,
    points: PyReadonlyArray2<'_, f64>,
    sides: [f64; 3],
    center: [f64; 3],
) -> PyResult<()> {
    let (out, points) = (out.as_array_mut(), points.as_array());
    gate::run(py, 10.0 * out.len() as f64, |cancel| {
        torus::edge_fade(out, points, &Torus::new(sides, center)?, cancel)
    })
}

/// Draws the alpha of the flakes into `out` (H, W). `lens` is (focal, cx, cy, offset, near).
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the Python layer passes plain values")]
pub fn particle_splat(
    py: Python<'_>,
    out: PlaneMut<'_>,
    points: PyReadonlyArray2<'_, f64>,
    radius: PyReadonlyArray1<'_, f64>,
    opacity: PyReadonlyArray1<'_, f64>,
    velocity: PyReadonlyArray2<'_, f64>,
    shutter: f64,
    lens: (f64, f64, f64, [f64; 3], f64),
    depth: Option<Plane<'_>>,
) -> PyResult<()> {
    let lens = lens_of(lens);
    let flakes = Flakes {
        points: points.as_array(),
        radius: radius.as_array(),
        opacity: opacity.as_array(),
        velocity: velocity.as_array(),
        shutter,
    };
    gate::each_precision!(out, view => match &depth {
        None => drawn(py, view, &flakes, &lens, None::<ArrayView2<f32>>),
        Some(Plane::Single(map)) => drawn(py, view, &flakes, &lens, Some(map.as_array())),
        Some(Plane::Double(map)) => drawn(py, view, &flakes, &lens, Some(map.as_array())),
    })
}

fn drawn<P: Profile, M: Real>(
    py: Python<'_>,
    out: ArrayViewMut2<P>,
    flakes: &impl Source,
    lens: &Lens,
    depth: Option<ArrayView2<M>>,
) -> PyResult<()> {
    let nanoseconds = splat::estimate(out.dim(), flakes, lens);
    gate::run(py, nanoseconds, |cancel| splat::splat(out, flakes, lens, depth, cancel))
}

/// Writes the index of the flake that each pixel shows into `out` (H, W), -1 where there is none.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the Python layer passes plain values")]
pub fn particle_ids(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, i32>,
    points: PyReadonlyArray2<'_, f64>,
    radius: PyReadonlyArray1<'_, f64>,
    opacity: PyReadonlyArray1<'_, f64>,
    velocity: PyReadonlyArray2<'_, f64>,
    shutter: f64,
    lens: (f64, f64, f64, [f64; 3], f64),
    depth: Option<Plane<'_>>,
) -> PyResult<()> {
    let lens = lens_of(lens);
    let flakes = Flakes {
        points: points.as_array(),
        radius: radius.as_array(),
        opacity: opacity.as_array(),
        velocity: velocity.as_array(),
        shutter,
    };
    let out = out.as_array_mut();
    match &depth {
        None => shown(py, out, &flakes, &lens, None::<ArrayView2<f32>>),
        Some(Plane::Single(map)) => shown(py, out, &flakes, &lens, Some(map.as_array())),
        Some(Plane::Double(map)) => shown(py, out, &flakes, &lens, Some(map.as_array())),
    }
}

fn shown<M: Real>(
    py: Python<'_>,
    out: ArrayViewMut2<i32>,
    flakes: &Flakes<'_>,
    lens: &Lens,
    depth: Option<ArrayView2<M>>,
) -> PyResult<()> {
    // One lane where the splat has many.
    let nanoseconds = 20.0 * splat::estimate(out.dim(), flakes, lens);
    gate::run(py, nanoseconds, |cancel| ids::ids(out, flakes, lens, depth, cancel))
}

/// A box of flakes that all move alike, as the effect has settled it; the attributes of its request.
#[derive(FromPyObject)]
pub struct FlurryRequest {
    #[pyo3(attribute)]
    number: usize,
    #[pyo3(attribute)]
    sides: [f64; 3],
    #[pyo3(attribute)]
    center: [f64; 3],
    #[pyo3(attribute)]
    seed: i64,
    #[pyo3(attribute)]
    way: [f64; 3],
    #[pyo3(attribute)]
    sway: (f64, f64),
    #[pyo3(attribute)]
    travel: [f64; 3],
    #[pyo3(attribute)]
    radius: (f64, f64),
    #[pyo3(attribute)]
    opacity: f64,
    #[pyo3(attribute)]
    amount: f64,
    #[pyo3(attribute)]
    fade_in: f64,
    #[pyo3(attribute)]
    largest: (f64, f64),
    #[pyo3(attribute)]
    sizes: i64,
    #[pyo3(attribute)]
    lens: (f64, f64, f64, [f64; 3], f64),
    #[pyo3(attribute)]
    window: [usize; 4],
}

impl FlurryRequest {
    fn lens(&self) -> Lens {
        lens_of(self.lens)
    }

    fn flurry(&self) -> Result<Flurry, Error> {
        let torus = Torus::new(self.sides, self.center)?;
        let carried = Carried::new(torus, self.seed, self.way, 1.0, swaying(Some(self.sway)))?;
        let looks = Looks {
            radius: self.radius,
            opacity: self.opacity,
            amount: self.amount,
            fade_in: self.fade_in,
            largest: self.largest,
            sizes: self.sizes,
        };
        Flurry::new(self.number, carried, self.seed, looks, &self.lens(), self.window, self.travel)
    }
}

fn lens_of((focal, x, y, offset, near): (f64, f64, f64, [f64; 3], f64)) -> Lens {
    Lens { focal, center: [x, y], offset, near }
}

/// Draws the alpha of a box of flakes into `out` (H, W), each flake placed as it is drawn.
#[pyfunction]
#[pyo3(signature = (out, request, depth=None))]
pub fn particle_flurry(
    py: Python<'_>,
    out: PlaneMut<'_>,
    request: FlurryRequest,
    depth: Option<Plane<'_>>,
) -> PyResult<()> {
    let lens = request.lens();
    gate::each_precision!(out, view => {
        let flurry = request.flurry()?;
        match &depth {
            None => drawn(py, view, &flurry, &lens, None::<ArrayView2<f32>>),
            Some(Plane::Single(map)) => drawn(py, view, &flurry, &lens, Some(map.as_array())),
            Some(Plane::Double(map)) => drawn(py, view, &flurry, &lens, Some(map.as_array())),
        }
    })
}

/// Draws the alphas (H, W) of a box of flakes that two eyes see, each flake placed once.
///
/// `lens` is the second eye's.
#[pyfunction]
#[pyo3(signature = (first, second, request, lens, depth=None))]
pub fn particle_flurry_pair(
    py: Python<'_>,
    mut first: PyReadwriteArray2<'_, f32>,
    mut second: PyReadwriteArray2<'_, f32>,
    request: FlurryRequest,
    lens: (f64, f64, f64, [f64; 3], f64),
    depth: Option<PyReadonlyArray2<'_, f32>>,
) -> PyResult<()> {
    let lenses = [request.lens(), lens_of(lens)];
    let (first, second) = (first.as_array_mut(), second.as_array_mut());
    let shape = first.dim();
    if second.dim() != shape {
        return Err(Error::invalid("second", "must have the shape of the first").into());
    }
    let both = request.flurry()?.seen_from(&lenses[1], request.window)?;
    let map = depth.as_ref().map(|map| map.as_array());
    let nanoseconds = 2.0 * splat::estimate(shape, &both, &lenses[0]);
    gate::run(py, nanoseconds, |cancel| {
        let placed = Placed::of(&both, cancel)?;
        splat::splat(first, &placed, &lenses[0], map, cancel)?;
        splat::splat(second, &placed, &lenses[1], map, cancel)
    })
}
