//! Populations of flakes: placed, sorted for drawing, listed, drawn exactly.

use numpy::PyArray1;
use numpy::ndarray::ArrayViewMut2;
use pyo3::prelude::*;

use super::gate::{self, Plane, PlaneMut};
use super::particles::{CloseupRequest, LensValues, Listed, SortedFlakes, lens_of, swaying};
use crate::base::error::{Error, pushed};
use crate::base::real::Real;
use crate::particles::closeup::near::Closeup;
use crate::particles::crowd::{Class, Crowd, Heights, Law};
use crate::particles::exact;
use crate::particles::flurry::Placed;
use crate::particles::splat::{self, Source};
use crate::particles::sprite::Lens;
use crate::particles::torus::{Carried, Torus};
use crate::particles::view::View;

/// One class of size: the attributes of `flurries.particles.crowd.Box`.
#[derive(FromPyObject)]
struct BoxRequest {
    number: usize,
    sides: [f64; 3],
    center: [f64; 3],
    seed: i64,
    way: [f64; 3],
    order: [usize; 3],
    sway: (f64, f64),
    travel: [f64; 3],
    sizes: (f64, f64),
    slope: f64,
    shown: [f64; 4],
    amounts: Vec<f64>,
}

/// All classes before one lens: the attributes of `flurries.particles.crowd.Crowd`.
#[derive(FromPyObject)]
pub struct CrowdRequest {
    boxes: Vec<BoxRequest>,
    opacity: f64,
    turn: [[f64; 3]; 3],
    spread: [[f64; 3]; 3],
    down: [f64; 3],
    heights: (f64, f64),
    room: f64,
    lens: LensValues,
    window: [usize; 4],
    closeup: Option<CloseupRequest>,
}

impl CrowdRequest {
    fn closeup(&self) -> Result<Option<Closeup>, Error> {
        self.closeup.as_ref().map(CloseupRequest::closeup).transpose()
    }

    fn lens(&self) -> Lens {
        lens_of(self.lens)
    }

    fn crowd(&self, aside: Option<&Lens>) -> Result<Crowd, Error> {
        let classes: Result<Vec<Class>, Error> = self.boxes.iter().map(BoxRequest::class).collect();
        let classes = classes?;
        let room = Crowd::room(&classes, self.room);
        Crowd {
            view: View::new(&self.lens(), self.window, room),
            aside: aside.map(|lens| View::new(lens, self.window, room)),
            classes,
            opacity: self.opacity,
            turn: self.turn,
            spread: self.spread,
            heights: Heights { down: self.down, range: self.heights },
        }
        .checked()
    }
}

impl BoxRequest {
    fn class(&self) -> Result<Class, Error> {
        let torus = Torus::new(self.sides, self.center)?;
        let carried = Carried::new(torus, self.seed, self.way, 1.0, swaying(Some(self.sway)))?;
        Ok(Class {
            count: self.number,
            carried: carried.renewed(self.order)?,
            seed: self.seed,
            law: Law::new(self.sizes, self.slope),
            travel: self.travel,
            shown: self.shown,
            amounts: self.amounts.clone(),
        })
    }
}

/// Sorts the flakes of a population, each placed as it is needed, for frames of `shape` (H, W).
#[pyfunction]
pub fn crowd_sort(
    py: Python<'_>,
    shape: (usize, usize),
    request: CrowdRequest,
) -> PyResult<SortedFlakes> {
    let closeup = request.closeup()?;
    SortedFlakes::of(py, shape, &request.crowd(None)?, &request.lens(), closeup.as_ref(), None)
}

/// Sorts the flakes that two eyes see, each flake placed once. `lens` is the second eye's.
#[pyfunction]
pub fn crowd_sort_pair(
    py: Python<'_>,
    shape: (usize, usize),
    request: CrowdRequest,
    lens: LensValues,
) -> PyResult<(SortedFlakes, SortedFlakes)> {
    let lenses = [request.lens(), lens_of(lens)];
    let both = request.crowd(Some(&lenses[1]))?;
    let nanoseconds = splat::estimate(shape, &both, &lenses[0]);
    let placed = gate::run(py, nanoseconds, |cancel| Placed::of(&both, cancel))?;
    let closeup = request.closeup()?;
    let [first, second] =
        lenses.map(|lens| SortedFlakes::of(py, shape, &placed, &lens, closeup.as_ref(), None));
    Ok((first?, second?))
}

/// Flakes that are listed between two looks at whether to stop.
const RUN: usize = 1 << 16;

/// Lists the flakes that may be seen, nine numbers each: place, radius, opacity, way during the
/// exposure, number.
#[pyfunction]
pub fn crowd_list<'py>(
    py: Python<'py>,
    request: CrowdRequest,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let crowd = request.crowd(None)?;
    let rows = gate::run(py, 100.0 * crowd.len() as f64, |cancel| {
        let mut rows: Vec<f64> = Vec::new();
        let count = crowd.len();
        for start in (0..count).step_by(RUN) {
            cancel.check()?;
            crowd.each(start..(start + RUN).min(count), &mut |index, flake| {
                let [x, y, z] = flake.point;
                let [a, b, c] = flake.travel;
                for value in [x, y, z, flake.radius, flake.opacity, a, b, c, index as f64] {
                    pushed(&mut rows, value)?;
                }
                Ok(())
            })?;
        }
        Ok(rows)
    })?;
    Ok(PyArray1::from_vec(py, rows))
}

/// Draws the alpha of a population's flakes into `out`, the request's window (h, w), each with its exact
/// image. `depth` is of the window, too.
#[pyfunction]
#[pyo3(signature = (out, request, depth=None))]
pub fn crowd_exact(
    py: Python<'_>,
    out: PlaneMut<'_>,
    request: CrowdRequest,
    depth: Option<Plane<'_>>,
) -> PyResult<()> {
    let (crowd, lens) = (request.crowd(None)?, request.lens());
    let [top, _, left, _] = request.window;
    gate::each_precision!(out, view => exactly(py, (view, (top, left)), &crowd, &lens, &depth))
}

/// Draws the alpha of listed flakes into `out` (h, w), the pixels of a frame from the row and the column
/// `origin` on, each with its exact image. `depth` is of the same pixels.
#[pyfunction]
#[pyo3(signature = (out, flakes, lens, origin, depth=None))]
pub fn particle_exact(
    py: Python<'_>,
    out: PlaneMut<'_>,
    flakes: Listed<'_>,
    lens: LensValues,
    origin: (usize, usize),
    depth: Option<Plane<'_>>,
) -> PyResult<()> {
    let (flakes, lens) = (flakes.flakes(), lens_of(lens));
    gate::each_precision!(out, view => exactly(py, (view, origin), &flakes, &lens, &depth))
}

/// The pixels to draw, and the row and the column of the first.
type Part<'a, P> = (ArrayViewMut2<'a, P>, (usize, usize));

fn exactly<P: Real>(
    py: Python<'_>,
    (out, origin): Part<'_, P>,
    flakes: &impl Source,
    lens: &Lens,
    depth: &Option<Plane<'_>>,
) -> PyResult<()> {
    let nanoseconds = 10.0 * splat::estimate(out.dim(), flakes, lens);
    gate::each_map!(depth, map => {
        gate::run(py, nanoseconds, |cancel| exact::draw(out, origin, flakes, lens, map, cancel))
    })
}
