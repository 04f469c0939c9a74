//! Flakes that live in the world: a frame's request in, its flakes out, ready to be drawn or listed.

use std::sync::Arc;

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray2,
};
use pyo3::prelude::*;

use super::gate;
use super::particles::{CloseupRequest, SortedFlakes};
use crate::base::ball::middle_depth;
use crate::base::error::{Error, collected};
use crate::falling::air::{Air, Class, Eye};
use crate::falling::bent::{self, Bent, Group};
use crate::falling::draw::{Images, balls_of, lens_of};
use crate::falling::law::{Sizes, Table};
use crate::falling::layers::{self, Layer, Others};
use crate::falling::list::List;
use crate::falling::sheet::{Law, Sheet};
use crate::particles::balls::Balls;

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

/// An eye at one time: the attributes of `flurries.effects.air.Eye`.
#[derive(FromPyObject)]
struct EyeRequest {
    turn: [[f64; 3]; 3],
    focal: [f64; 2],
    center: [f64; 2],
    offset: [f64; 3],
}

/// A class of size: the attributes of `flurries.effects.air.Class`.
#[derive(FromPyObject)]
struct ClassRequest<'py> {
    number: i64,
    density: f64,
    sizes: (f64, f64),
    slope: f64,
    shown: [f64; 4],
    by_size: bool,
    heights: (f64, f64),
    amounts: Vec<f64>,
    ranks: (f64, f64),
    at: Vec<[f64; 3]>,
    swung: Vec<f64>,
    waves: Option<PyReadonlyArray2<'py, f64>>,
    depths: (f64, f64),
    profile: Vec<[Vec<f64>; 2]>,
}

/// The flakes before an eye: the attributes of `flurries.effects.air.Air`.
#[derive(FromPyObject)]
pub struct AirRequest<'py> {
    seed: i64,
    opacity: f64,
    images: Py<BallImages>,
    classes: Vec<ClassRequest<'py>>,
    eyes: Vec<EyeRequest>,
    sway: f64,
    waves: Option<PyReadonlyArray2<'py, f64>>,
    shape: (usize, usize),
    window: [usize; 4],
    room: f64,
    near: f64,
    closeup: Option<CloseupRequest>,
}

fn numbers(array: Option<&PyReadonlyArray2<'_, f64>>) -> PyResult<Vec<f64>> {
    Ok(array.map(|array| array.as_slice().map(<[f64]>::to_vec)).transpose()?.unwrap_or_default())
}

impl AirRequest<'_> {
    fn air(&self) -> PyResult<Air> {
        let classes: PyResult<Vec<Class>> = self.classes.iter().map(ClassRequest::class).collect();
        let eye = |eye: &EyeRequest| Eye {
            turn: eye.turn,
            focal: eye.focal,
            center: eye.center,
            offset: eye.offset,
        };
        let air = Air {
            seed: self.seed,
            opacity: self.opacity,
            classes: classes?,
            eyes: self.eyes.iter().map(eye).collect(),
            sway: self.sway,
            waves: numbers(self.waves.as_ref())?,
            shape: self.shape,
            window: self.window,
            room: self.room,
            near: self.near,
        };
        Ok(air.checked()?)
    }
}

impl ClassRequest<'_> {
    fn class(&self) -> PyResult<Class> {
        let table = |values: &Vec<f64>| Table { range: self.depths, values: values.clone() };
        Ok(Class {
            number: self.number,
            density: self.density,
            sizes: Sizes::new(self.sizes, self.slope),
            shown: self.shown,
            by_size: self.by_size,
            amount: Table { range: self.heights, values: self.amounts.clone() },
            ranks: self.ranks,
            at: self.at.clone(),
            swung: self.swung.clone(),
            waves: numbers(self.waves.as_ref())?,
            profile: self.profile.iter().map(|both| [table(&both[0]), table(&both[1])]).collect(),
        })
    }
}

/// Rough nanoseconds of a frame's flakes: nothing is known of how many there are before they are listed.
const UNKNOWN: f64 = 5e7;

/// Finds the flakes that the window of a frame may show, and their images.
#[pyfunction]
pub fn fall(py: Python<'_>, request: AirRequest<'_>) -> PyResult<SortedFlakes> {
    let air = request.air()?;
    let closeup = request.closeup.as_ref().map(CloseupRequest::closeup);
    let images = Arc::clone(&request.images.get().0);
    let (list, images) = gate::run(py, work(&air), |cancel| {
        let list = List::of(&air, cancel)?;
        let images = Images::of(&air, &list, &images, closeup.as_ref(), cancel)?;
        Ok((list, images))
    })?;
    let nanoseconds = (air.shape.0 * air.shape.1) as f64 + 300.0 * list.flakes.len() as f64;
    let Images { sorted, patches } = images;
    Ok(SortedFlakes { sorted, patches, lens: lens_of(&air), nanoseconds, list })
}

/// A rough estimate of listing the flakes, nanoseconds.
fn work(air: &Air) -> f64 {
    let [fx, fy] = air.eyes[0].focal;
    let view = air.shape.0 as f64 * air.shape.1 as f64 / (fx * fy) / 3.0;
    let deep = air.classes.iter().map(|each| each.density * each.shown[3].powi(3)).sum::<f64>();
    (100.0 * view * deep).min(UNKNOWN * 1e3)
}

/// What `flake_rows` returns.
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
    rows.try_reserve_exact(8 * count).map_err(|_| Error::Memory { bytes: 64 * count })?;
    for flake in &list.flakes {
        let [x, y, z] = flake.point;
        let [u, v] = flake.seen[0];
        rows.extend_from_slice(&[x, y, z, u, v, flake.depths[0], flake.diameter, flake.share]);
    }
    let times = list.others.len().checked_div(count).unwrap_or(0);
    let others =
        collected(list.others.iter().flatten().copied().collect::<Vec<f64>>().into_iter())?;
    Ok((
        PyArray1::from_vec(py, ids),
        PyArray1::from_vec(py, rows).reshape([count, 8])?,
        PyArray1::from_vec(py, others).reshape([count, 2 * times])?,
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

    /// Bytes that it keeps.
    #[getter]
    fn bytes(&self) -> usize {
        self.0.bytes()
    }

    /// Mean optical depth.
    #[getter]
    fn mean(&self) -> f64 {
        self.0.mean()
    }

    /// The mean light that it leaves, for factors of its optical depth.
    fn left(&self, py: Python<'_>, gains: Vec<f64>) -> PyResult<Vec<f64>> {
        gate::run(py, UNKNOWN, |cancel| self.0.left(&gains, cancel))
    }
}

/// A sheet, the displacement (x, y) px of its flakes, a gain and what is added, and the depths between which it
/// lies.
type LayerValues<'py> = (PyRef<'py, FlakeSheet>, [f64; 2], (f32, f32), f32, f32);

/// Writes the optical depth of sheets over `out` (h, w), or their opacity. `origin` is the row and the column
/// of the first pixel from the principal point; `depth` (h, w) is that of the scene. To an opacity add drawn
/// flakes, which are an opacity and a factor of their optical depth, a veil, and the opacity of an even one.
#[pyfunction]
#[pyo3(signature = (out, origin, sheets, depth, opacity, drawn=None, veil=None, haze=0.0))]
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
) -> PyResult<()> {
    let given: Vec<Layer<'_>> = sheets
        .iter()
        .map(|(sheet, shift, (gain, base), near, far)| Layer {
            sheet: &sheet.0,
            shift: *shift,
            gain: *gain,
            base: *base,
            near: *near,
            far: *far,
        })
        .collect();
    let (out, depth) = (out.as_array_mut(), depth.as_ref().map(|depth| depth.as_array()));
    let others = opacity.then(|| Others {
        drawn: drawn.as_ref().map(|(plane, gain)| (plane.as_array(), *gain)),
        veil: veil.as_ref().map(|plane| plane.as_array()),
        haze,
    });
    let nanoseconds = 0.3 * (out.len() * (given.len() + 1)) as f64;
    gate::run(py, nanoseconds, |cancel| layers::read(out, origin, &given, depth, others, cancel))
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
        let bent = |each: &'a (PyRef<'_, FlakeSheet>, PyReadonlyArray3<'_, f32>)| Bent {
            sheet: &each.0.0,
            nodes: each.1.as_array(),
        };
        let sheets = sheets.iter().map(bent).collect();
        Group { sheets, ways: ways.as_array(), near: *near, far: *far }
    }
    let given: Vec<Group<'_>> = groups.iter().map(group).collect();
    let (out, depth) = (out.as_array_mut(), depth.as_ref().map(|depth| depth.as_array()));
    let number: usize = given.iter().map(|group| group.sheets.len() + 4).sum();
    let nanoseconds = 0.5 * (out.len() * number) as f64;
    gate::run(py, nanoseconds, |cancel| bent::read(out, corner, &given, depth, cancel))
}
