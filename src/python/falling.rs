//! Flakes that live in the world: a frame's request in, its flakes out, ready to be drawn or listed.

use std::sync::Arc;

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray2,
};
use pyo3::prelude::*;

use super::gate::{self, attribute, from_attributes};
use super::particles::SortedFlakes;
use crate::base::ball::middle_depth;
use crate::base::error::{collected, reserve};
use crate::falling::air::{Air, Class, Clumps, Eye};
use crate::falling::bent::{self, Group};
use crate::falling::draw::{Images, balls_of, lens_of};
use crate::falling::gains::Gains;
use crate::falling::law::{Sizes, Table};
use crate::falling::layers::{self, Layer, Others};
use crate::falling::list::List;
use crate::falling::notes::{Body, Mask, Notes};
use crate::falling::sheet::Sheet;
use crate::falling::stamp::Law;
use crate::particles::balls::Balls;
use crate::particles::closeup::near::Closeup;

/// The images of balls of one opacity, made once.
#[pyclass(frozen, module = "flurries._core")]
pub struct BallImages(Arc<Balls>);

#[pymethods]
impl BallImages {
    #[new]
    fn new(opacity: f64) -> PyResult<Self> {
        Ok(Self(Arc::new(balls_of(opacity)?)))
    }
}

from_attributes!(Eye { turn, focal, center, offset } of eye);

from_attributes!(Class {
    number, density, shown, by_size, ranks, at, swung, placed;
    sizes: Sizes::new(attribute!(class, sizes), attribute!(class, slope)),
    amount: Table { range: attribute!(class, heights), values: attribute!(class, amounts) },
    waves: waves(class)?,
    profile: {
        let range = attribute!(class, depths);
        let both: Vec<[Vec<f64>; 2]> = attribute!(class, profile);
        both.into_iter().map(|both| both.map(|values| Table { range, values })).collect()
    },
} of class);

from_attributes!(Clumps {
    strength;
    waves: waves(clumps)?,
    weights: numbers(attribute!(clumps, weights))?,
} of clumps);

from_attributes!(Mask {
    depths;
    shares: {
        let shares: PyReadonlyArray2<'_, f32> = attribute!(mask, shares);
        shares.as_array().to_owned()
    },
} of mask);

from_attributes!(Body { at, half, round } of body);

from_attributes!(Notes { between, hidden, mask, bodies } of notes);

from_attributes!(Air {
    seed, opacity, classes, eyes, sway, clumps, notes, shape, window, room, near;
    waves: waves(air)?,
} of air);

/// Numbers of waves, row by row; none where there are no waves.
fn waves(object: Borrowed<'_, '_, PyAny>) -> PyResult<Vec<f64>> {
    numbers(attribute!(object, waves))
}

fn numbers(array: Option<PyReadonlyArray2<'_, f64>>) -> PyResult<Vec<f64>> {
    Ok(array.map(|array| array.as_slice().map(<[f64]>::to_vec)).transpose()?.unwrap_or_default())
}

/// Rough nanoseconds of a frame's flakes: nothing is known of how many there are before they are listed.
const UNKNOWN: f64 = 5e7;

/// Finds the flakes that the window of a frame may show, and their images.
#[pyfunction]
pub fn fall(py: Python<'_>, request: &Bound<'_, PyAny>) -> PyResult<SortedFlakes> {
    let air = request.extract::<Air>()?.checked()?;
    let closeup: Option<Closeup> = attribute!(request, closeup);
    let images: Py<BallImages> = attribute!(request, images);
    let balls = &images.get().0;
    let (list, images) = gate::run(py, work(&air), |cancel| {
        let list = List::of(&air, cancel)?;
        let images = Images::of(&air, &list, balls, closeup.as_ref(), cancel)?;
        Ok((list, images))
    })?;
    let nanoseconds = (air.shape.0 * air.shape.1) as f64 + 300.0 * list.flakes.len() as f64;
    let Images { sorted, patches, tumble } = images;
    Ok(SortedFlakes { sorted, patches, tumble, lens: lens_of(&air), nanoseconds, list })
}

/// A rough estimate of listing the flakes, nanoseconds.
fn work(air: &Air) -> f64 {
    let [fx, fy] = air.eyes[0].focal;
    let view = air.shape.0 as f64 * air.shape.1 as f64 / (fx * fy) / 3.0;
    let deep = air.classes.iter().map(|each| each.density * each.shown[3].powi(3)).sum::<f64>();
    (100.0 * view * deep).min(UNKNOWN * 1e3)
}

type Rows<'py> = (Bound<'py, PyArray1<u64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// Lists flakes: their identities; place in the camera's axes, place in the picture, depth from the eye, diameter
/// and the share that is there, (n, 8); and their places in the picture at the times after the exposure's, two
/// numbers for each, (n, 2 k).
#[pyfunction]
pub fn flake_rows<'py>(py: Python<'py>, flakes: &SortedFlakes) -> PyResult<Rows<'py>> {
    let list = &flakes.list;
    let count = list.flakes.len();
    let ids = collected(list.flakes.iter().map(|flake| flake.id))?;
    let mut rows = Vec::new();
    reserve(&mut rows, 8 * count)?;
    for flake in &list.flakes {
        let [x, y, z] = flake.point;
        let [u, v] = flake.seen[0];
        rows.extend_from_slice(&[x, y, z, u, v, flake.depths[0], flake.diameter, flake.share]);
    }
    let times = list.others.len().checked_div(count).unwrap_or(0);
    Ok((
        PyArray1::from_vec(py, ids),
        PyArray1::from_vec(py, rows).reshape([count, 8])?,
        PyArray1::from_slice(py, list.others.as_flattened()).reshape([count, 2 * times])?,
    ))
}

/// Far flakes of one layer on a torus; see [`Law`].
#[pyclass(frozen, module = "flurries._core")]
pub struct FlakeSheet(Sheet);

#[pymethods]
impl FlakeSheet {
    #[new]
    #[pyo3(signature = (seed, period, shear, count, diameters, streak, circle, opacity, ranks, thin=1.0))]
    fn new(
        seed: u64,
        period: (usize, usize),
        shear: usize,
        count: f64,
        diameters: Vec<f32>,
        streak: [f64; 2],
        circle: f64,
        opacity: f64,
        ranks: (f64, f64),
        thin: f64,
    ) -> PyResult<Self> {
        let tau0 = middle_depth(opacity)?;
        let law = Law { seed, period, shear, count, diameters, streak, circle, tau0, thin, ranks };
        Ok(Self(Sheet::new(law)?))
    }

    #[getter]
    fn bytes(&self) -> usize {
        self.0.bytes()
    }

    #[getter]
    fn mean(&self) -> f64 {
        self.0.mean()
    }

    /// The factor with which it takes a mean optical depth of light.
    fn factor(&self, py: Python<'_>, wanted: f64, strong: [f64; 2]) -> PyResult<f64> {
        gate::run(py, 1e6, |cancel| self.0.factor(wanted, strong, cancel))
    }
}

/// A sheet, the displacement (x, y) px of its flakes, px that they lean by and its rows in a row, a gain and what is
/// added, and the depths between which it lies.
type LayerValues<'py> = (PyRef<'py, FlakeSheet>, [f64; 2], (f64, f64), (f32, f32), f32, f32);

/// Factors (groups, rows, columns) of optical depths, how many layers each group has, and the picture's row and column
/// of the first pixel.
type GainValues<'py> = (PyReadonlyArray3<'py, f32>, Vec<usize>, (usize, usize));

/// Writes the optical depth of sheets over `out` (h, w), or their opacity. `origin` is the row and the column
/// of the first pixel from the principal point; `depth` (h, w) is that of the scene. To an opacity add drawn
/// flakes, which are an opacity and a factor of their optical depth, a veil, and the opacity of an even one.
#[pyfunction]
#[pyo3(signature = (out, origin, sheets, depth, opacity, drawn=None, veil=None, haze=0.0, gains=None))]
pub fn sheet_read(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f32>,
    origin: [i64; 2],
    sheets: Vec<LayerValues<'_>>,
    depth: Option<PyReadonlyArray2<'_, f32>>,
    opacity: bool,
    drawn: Option<(PyReadonlyArray2<'_, f32>, f32)>,
    veil: Option<PyReadonlyArray2<'_, f32>>,
    haze: f32,
    gains: Option<GainValues<'_>>,
) -> PyResult<()> {
    let layers = sheets.iter().map(|&(ref sheet, shift, lean, gain, near, far)| {
        let sheet = &sheet.0;
        Layer { sheet, shift, lean, gain, near, far }
    });
    let given: Vec<Layer<'_>> = layers.collect();
    let (out, depth) = (out.as_array_mut(), depth.as_ref().map(|depth| depth.as_array()));
    let others = opacity.then(|| Others {
        drawn: drawn.as_ref().map(|(plane, gain)| (plane.as_array(), *gain)),
        veil: veil.as_ref().map(|plane| plane.as_array()),
        haze,
    });
    let gains = gains.as_ref().map(|(nodes, counts, corner)| Gains {
        nodes: nodes.as_array(),
        counts,
        corner: *corner,
    });
    let nanoseconds = 0.3 * (out.len() * (given.len() + 1)) as f64;
    gate::run(py, nanoseconds, |cancel| {
        layers::read(out, origin, &given, depth, others, gains, cancel)
    })
}

/// The sheets of one depth with their nodes, the ways at the nodes, and the depths between which they lie.
type GroupValues<'py> = (
    Vec<(PyRef<'py, FlakeSheet>, PyReadonlyArray3<'py, f32>)>,
    PyReadonlyArray3<'py, f32>,
    f32,
    f32,
);

/// Writes the opacity of sheets over `out` (h, w), whose first pixel's row and column in the picture are
/// `corner`, as [`Group`] has them. `depth` (h, w) is that of the scene.
#[pyfunction]
pub fn sheet_bent(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f32>,
    corner: [usize; 2],
    groups: Vec<GroupValues<'_>>,
    depth: Option<PyReadonlyArray2<'_, f32>>,
) -> PyResult<()> {
    fn group<'a>((sheets, ways, near, far): &'a GroupValues<'_>) -> Group<'a> {
        let sheets = sheets.iter().map(|(sheet, nodes)| (&sheet.0, nodes.as_array())).collect();
        Group { sheets, ways: ways.as_array(), near: *near, far: *far }
    }
    let given: Vec<Group<'_>> = groups.iter().map(group).collect();
    let (out, depth) = (out.as_array_mut(), depth.as_ref().map(|depth| depth.as_array()));
    let number: usize = given.iter().map(|group| group.sheets.len() + 4).sum();
    let nanoseconds = 0.5 * (out.len() * number) as f64;
    gate::run(py, nanoseconds, |cancel| bent::read(out, corner, &given, depth, cancel))
}
