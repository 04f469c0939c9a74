//! Flakes sorted for a frame and drawn.

use numpy::ndarray::Array2;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2, PyReadwriteArray3};
use pyo3::prelude::*;

use super::frame::{Shade, lit as laid};
use super::gate::{self, Plane, PlaneMut, attribute, each_map, from_attributes};
use crate::base::error::{Error, collected};
use crate::base::lamps::Lamps;
use crate::falling::list::List;
use crate::frame::shade::Behind;
use crate::particles::closeup::aperture::Blur;
use crate::particles::closeup::lit;
use crate::particles::closeup::near::{self, Closeup};
use crate::particles::closeup::patch::Patch;
use crate::particles::closeup::shape::{Kind, Tumble};
use crate::particles::sorted::Sorted;
use crate::particles::splat::{self, Flakes};
use crate::particles::sprite::Lens;

/// Flakes of which arrays are given: points, radius, opacity, velocity, shutter.
#[derive(FromPyObject)]
pub struct Listed<'py>(
    PyReadonlyArray2<'py, f64>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray2<'py, f64>,
    f64,
);

impl Listed<'_> {
    pub fn flakes(&self) -> Flakes<'_> {
        let Self(points, radius, opacity, velocity, shutter) = self;
        Flakes {
            points: points.as_array(),
            radius: radius.as_array(),
            opacity: opacity.as_array(),
            velocity: velocity.as_array(),
            shutter: *shutter,
        }
    }
}

/// (focal, cx, cy, offset, near)
pub type LensValues = (f64, f64, f64, [f64; 3], f64);

/// Draws the alpha of the flakes into `out` (H, W).
#[pyfunction]
pub fn particle_splat(
    py: Python<'_>,
    out: PlaneMut<'_>,
    flakes: Listed<'_>,
    lens: LensValues,
    depth: Option<Plane<'_>>,
) -> PyResult<()> {
    let (flakes, lens) = (flakes.flakes(), lens_of(lens));
    gate::each_precision!(out, view => {
        let nanoseconds = splat::estimate(view.dim(), &flakes);
        each_map!(&depth, map => gate::run(py, nanoseconds, |cancel| {
            let (height, width) = view.dim();
            let sorted = splat::sorted(&flakes, &lens, (height, width), cancel)?;
            sorted.draw(view, [0, height, 0, width], map, cancel)
        }))
    })
}

/// Writes the index of the flake that each pixel shows into `out` (H, W), -1 where there is none.
#[pyfunction]
pub fn particle_ids(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, i32>,
    flakes: Listed<'_>,
    lens: LensValues,
    depth: Option<Plane<'_>>,
) -> PyResult<()> {
    let (flakes, lens) = (flakes.flakes(), lens_of(lens));
    let out = out.as_array_mut();
    let nanoseconds = 2.0 * splat::estimate(out.dim(), &flakes);
    if i32::try_from(flakes.points.nrows()).is_err() {
        return Err(Error::invalid("points", "must be fewer than 2^31").into());
    }
    each_map!(&depth, map => gate::run(py, nanoseconds, |cancel| {
        let (height, width) = out.dim();
        let sorted = splat::sorted(&flakes, &lens, (height, width), cancel)?;
        let mut alpha = filled((height, width), 0.0_f64)?;
        sorted.draw_numbered(alpha.view_mut(), out, None, [0, height, 0, width], map, cancel)
    }))
}

pub fn lens_of((focal, x, y, offset, near): LensValues) -> Lens {
    Lens { focal, center: [x, y], offset, near }
}

/// The flakes of a frame, projected and sorted: to be drawn in any part of it, any number of times.
#[pyclass(frozen, module = "flurries._core")]
pub struct SortedFlakes {
    pub sorted: Sorted,
    /// What is near or out of focus.
    pub patches: Vec<Patch>,
    /// See `Images`.
    pub tumble: Option<Tumble>,
    pub lens: Lens,
    /// A rough estimate of drawing all of them.
    pub nanoseconds: f64,
    pub list: List,
}

/// Draws the alpha of flakes into `out` (h, w), the part `window` (top, bottom, left, right) of their
/// frame; `depth` is the whole frame's. `numbers` (h, w), where given, gets the number of the flake whose own
/// alpha is the greatest, -1 where there is none.
#[pyfunction]
#[pyo3(signature = (out, flakes, window, depth=None, numbers=None))]
pub fn particle_draw(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f32>,
    flakes: &SortedFlakes,
    window: [usize; 4],
    depth: Option<PyReadonlyArray2<'_, f32>>,
    mut numbers: Option<PyReadwriteArray2<'_, i32>>,
) -> PyResult<()> {
    let out = out.as_array_mut();
    let depth = depth.as_ref().map(|map| map.as_array());
    let numbers = numbers.as_mut().map(|numbers| numbers.as_array_mut());
    let (height, width) = flakes.sorted.shape();
    let share = out.len() as f64 / (height as f64 * width as f64).max(1.0);
    gate::run(py, flakes.nanoseconds * share, |cancel| {
        let (mut out, patches, sorted) = (out, &flakes.patches[..], &flakes.sorted);
        match numbers {
            None => sorted.draw(out.view_mut(), window, depth, cancel)?,
            Some(numbers) if patches.is_empty() => {
                sorted.draw_numbered(out.view_mut(), numbers, None, window, depth, cancel)?;
            }
            Some(mut numbers) => {
                let mut most = filled(numbers.dim(), 0.0_f32)?;
                let (own, greatest) = (numbers.view_mut(), Some(most.view_mut()));
                sorted.draw_numbered(out.view_mut(), own, greatest, window, depth, cancel)?;
                near::number(numbers, most.view_mut(), patches, window, depth, cancel)?;
            }
        }
        near::draw(out, patches, window, depth, cancel)
    })
}

/// A plane of one value, or an error where there is no memory for it.
fn filled<A: Copy>(shape: (usize, usize), value: A) -> Result<Array2<A>, Error> {
    let values = collected(std::iter::repeat_n(value, shape.0 * shape.1))?;
    Array2::from_shape_vec(shape, values).map_err(|error| Error::Internal(error.to_string()))
}

/// Draws opacity and premultiplied light of flakes under lamps into `out` (h, w) and `glow` (h, w, 3), and
/// adds the light of a layer behind them: its opacity and colors.
#[pyfunction]
#[pyo3(signature = (out, glow, flakes, window, lamps, optics, depth=None, behind=None))]
pub fn particle_draw_lit(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f32>,
    mut glow: PyReadwriteArray3<'_, f32>,
    flakes: &SortedFlakes,
    window: [usize; 4],
    lamps: PyReadonlyArray2<'_, f64>,
    optics: (f64, f64),
    depth: Option<PyReadonlyArray2<'_, f32>>,
    behind: Option<(PyReadonlyArray2<'_, f32>, Shade<'_>)>,
) -> PyResult<()> {
    let (out, glow) = (out.as_array_mut(), glow.as_array_mut());
    let depth = depth.as_ref().map(|map| map.as_array());
    let lamps = Lamps::of(lamps.as_slice()?, optics.0, optics.1, flakes.lens.offset)?;
    let (height, width) = flakes.sorted.shape();
    let share = out.len() as f64 / (height as f64 * width as f64).max(1.0);
    let (sorted, patches) = (&flakes.sorted, &flakes.patches[..]);
    let glint = |number: i32| {
        let own = flakes.tumble.zip(flakes.list.flakes.get(number as usize));
        own.map_or(1.0, |(tumble, flake)| tumble.glint(flake.id as i64))
    };
    let lit = lit::Scene { sorted, patches, lens: flakes.lens, lamps: &lamps, glint: &glint };
    let behind = behind.as_ref().map(|(alpha, shade)| laid(alpha, shade, None));
    let behind = behind.as_ref().map(|behind| Behind::of(behind, out.dim())).transpose()?;
    gate::run(py, 3.0 * flakes.nanoseconds * share, |cancel| {
        lit.draw(out, glow, window, depth, cancel, |row, alpha, glow| match &behind {
            Some(behind) => behind.add(row, glow, Some(alpha)),
            None => Ok(()),
        })
    })
}

from_attributes!(Closeup {
    switch;
    kind: match attribute!(closeup, kind: String).as_str() {
        "aggregate" => Some(Kind::Aggregate),
        "drop" => Some(Kind::Drop),
        _ => None,
    },
    blur: attribute!(closeup, blur: Option<(f64, f64, usize, f64)>)
        .map(|(strength, focus, blades, turn)| Blur { strength, focus, blades, turn }),
    tumble: Tumble {
        seed: attribute!(closeup, seed),
        seconds: attribute!(closeup, seconds),
        exposure: attribute!(closeup, exposure),
    },
} of closeup);
