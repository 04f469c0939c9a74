//! Gas: the image of its particles, and the light that reaches them.

use numpy::{
    PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray1,
    PyReadwriteArray2, PyReadwriteArray3,
};
use pyo3::prelude::*;

use super::gate::{self, Plane, PlaneMut, arrays, each_map, either};
use crate::base::error::{Error, named};
use crate::base::lamps::Lamps;
use crate::gas::draw::Drawing;
use crate::gas::footprint::Edge;
use crate::gas::glow::see;
use crate::gas::light;
use crate::gas::picture::{Picture, Touched};
use crate::gas::slices::{self, Slices};
use crate::gas::splat;
use crate::gas::sprite::{Cloud, Eye, Footprint, Look, NearMode, Sprite};

arrays! {
    /// RGBA of either precision, to be written.
    pub enum LayerMut by try_readwrite, PyArray3 as PyReadwriteArray3 { Single: f32, Double: f64 }
}

/// Particles: the attributes of `flurries.gas.splatting.Gas`.
#[derive(FromPyObject)]
pub struct Gas<'py> {
    centers: PyReadonlyArray2<'py, f64>,
    radius: PyReadonlyArray1<'py, f64>,
    density: PyReadonlyArray1<'py, f64>,
}

impl Gas<'_> {
    fn cloud<'a>(&'a self, colors: &'a [[f64; 3]]) -> Cloud<'a> {
        Cloud {
            centers: self.centers.as_array(),
            radius: self.radius.as_array(),
            density: self.density.as_array(),
            colors,
        }
    }
}

/// (focal, cx, cy, offset)
type Lens = (f64, f64, f64, [f64; 3]);

/// (footprint, edge, near, near mode, hard, error)
type Manner = (String, String, f64, String, bool, f64);

fn look_of((footprint, edge, near, near_mode, hard, error): Manner) -> PyResult<Look> {
    let footprint = named(
        "footprint",
        &footprint,
        &[
            ("viewplane", Footprint::Viewplane),
            ("viewplane_c", Footprint::ViewplaneC),
            ("viewpoint", Footprint::Viewpoint),
            ("volume", Footprint::Volume),
            ("table", Footprint::Table),
        ],
    )?;
    let edge = named("edge", &edge, &[("taper", Edge::Taper), ("square", Edge::Square)])?;
    let near_mode = named(
        "near_mode",
        &near_mode,
        &[("fade", NearMode::Fade), ("cull", NearMode::Cull), ("exact", NearMode::Exact)],
    )?;
    Ok(Look { footprint, edge, near, near_mode, hard, error })
}

fn colors_of(colors: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<[f64; 3]>> {
    let colors = colors.as_array();
    if colors.ncols() != 3 {
        return Err(Error::invalid("color", "must have three numbers to a row").into());
    }
    Ok(colors.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
}

/// A gas as one eye sees it: its particles projected and sorted once, to be drawn in any part.
#[pyclass(frozen, module = "flurries._core")]
pub struct SortedGas {
    shape: (usize, usize),
    sprites: Vec<Sprite>,
    touched: Touched,
    colors: Vec<[f64; 3]>,
    eye: Eye,
    look: Look,
    /// A rough estimate of the whole frame.
    nanoseconds: f64,
}

/// Sorts a gas for frames of `shape` (H, W).
#[pyfunction]
pub fn gas_sort(
    py: Python<'_>,
    shape: (usize, usize),
    gas: Gas<'_>,
    colors: PyReadonlyArray2<'_, f64>,
    lens: Lens,
    manner: Manner,
) -> PyResult<SortedGas> {
    let colors = colors_of(&colors)?;
    let ((focal, x, y, offset), look) = (lens, look_of(manner)?);
    let eye = Eye { focal, center: [x, y], offset };
    let cloud = gas.cloud(&colors);
    cloud.check()?;
    let nanoseconds = splat::estimate(shape, &cloud, &eye, &look);
    let (sprites, touched) = gate::run(py, nanoseconds, |cancel| {
        let sprites = splat::sprites(&cloud, &eye, &look, shape, cancel)?;
        let touched = Touched::of(&sprites, &colors, shape.0)?;
        Ok((sprites, touched))
    })?;
    Ok(SortedGas { shape, sprites, touched, colors, eye, look, nanoseconds })
}

/// An alpha (h, w), or premultiplied linear RGBA (h, w, 4), to be written.
#[derive(FromPyObject)]
pub enum GasMut<'py> {
    Alpha(PlaneMut<'py>),
    Light(LayerMut<'py>),
}

/// Draws the part `window` (top, bottom, left, right) of a gas into `out`, (h, w) or (h, w, 4); `depth`
/// is the whole frame's.
#[pyfunction]
#[pyo3(signature = (out, gas, window, depth=None))]
pub fn gas_draw(
    py: Python<'_>,
    out: GasMut<'_>,
    gas: &SortedGas,
    window: [usize; 4],
    depth: Option<Plane<'_>>,
) -> PyResult<()> {
    let SortedGas { shape, sprites, touched, colors, eye, look, .. } = gas;
    let drawing = Drawing { sprites, colors, look };
    let rows = window[1].saturating_sub(window[0]) as f64;
    let work = gas.nanoseconds * rows / (shape.0 as f64).max(1.0);
    each_map!(&depth, depth => {
        let picture = Picture { shape: *shape, eye, drawing, touched, depth };
        match out {
            GasMut::Alpha(out) => gate::each_precision!(out, view => {
                gate::run(py, work, |cancel| picture.alpha(view, window, cancel))
            }),
            GasMut::Light(out) => either!(LayerMut mut out = out => {
                let out = out.as_array_mut();
                gate::run(py, work, |cancel| picture.light(out, window, cancel))
            }),
        }
    })
}

/// Fills `out` (n,) with the light of a direction that reaches each particle.
#[pyfunction]
pub fn gas_light(
    py: Python<'_>,
    mut out: PyReadwriteArray1<'_, f64>,
    gas: Gas<'_>,
    direction: [f64; 3],
    forward: f64,
) -> PyResult<()> {
    let cloud = gas.cloud(&[[0.0; 3]]);
    let out = out.as_array_mut();
    let count = cloud.centers.nrows() as f64;
    gate::run(py, 5.0 * count * count, |cancel| {
        light::light(out, &cloud, direction, forward, cancel)
    })
}

/// Slices of gas: extinction on a coarse grid (n, rows, columns), where they begin and end (n + 1,), what ends
/// them (H, W), the slopes of columns (W,) and rows (H,), and short waves of all (H, W) and their strength.
#[derive(FromPyObject)]
pub struct Bank<'py>(
    PyReadonlyArray3<'py, f32>,
    Vec<f32>,
    Option<PyReadonlyArray2<'py, f32>>,
    (PyReadonlyArray1<'py, f32>, PyReadonlyArray1<'py, f32>),
    Option<(PyReadonlyArray2<'py, f32>, f32)>,
);

impl Bank<'_> {
    fn slices(&self) -> PyResult<Slices<'_>> {
        Ok(Slices {
            density: self.0.as_array(),
            edges: &self.1,
            ground: self.2.as_ref().map(|ground| ground.as_array()),
            slopes: (self.3.0.as_slice()?, self.3.1.as_slice()?),
            detail: self.4.as_ref().map(|(waves, strength)| (waves.as_array(), *strength)),
        })
    }
}

/// Writes the opacity of groups of slices to `out` (H, W).
#[pyfunction]
pub fn gas_slices(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f32>,
    groups: Vec<Bank<'_>>,
) -> PyResult<()> {
    let (out, groups) = (out.as_array_mut(), groups.iter().map(Bank::slices));
    let groups = groups.collect::<PyResult<Vec<_>>>()?;
    gate::run(py, 8.0 * out.len() as f64, |cancel| slices::hide(out, &groups, cancel))
}

/// Adds to `light` (H, W, 3) that of lamps which slices of an opacity (H, W) scatter, and writes their mean depth to
/// `far` (H, W), if given; `grid` and `places` are those of its [`see`].
#[pyfunction]
pub fn gas_glow(
    py: Python<'_>,
    mut light: Option<PyReadwriteArray3<'_, f32>>,
    mut far: Option<PyReadwriteArray2<'_, f32>>,
    opacity: PyReadonlyArray2<'_, f32>,
    bank: Bank<'_>,
    grid: (PyReadonlyArray1<'_, f32>, PyReadonlyArray1<'_, f32>),
    places: Vec<f32>,
    lamps: PyReadonlyArray2<'_, f64>,
    optics: (f64, f64),
    eye: [f64; 3],
) -> PyResult<()> {
    let lamps = Lamps::of(lamps.as_slice()?, optics.0, optics.1, eye)?;
    let light = light.as_mut().map(|light| light.as_array_mut());
    let far = far.as_mut().map(|far| far.as_array_mut());
    let (opacity, slices) = (opacity.as_array(), bank.slices()?);
    let work = (6 * opacity.len() * (1 + lamps.lamps.len()) * places.len()) as f64;
    let gas = (&slices, (grid.0.as_slice()?, grid.1.as_slice()?), &places[..]);
    gate::run(py, work, |cancel| see(light, far, opacity, gas, &lamps, cancel))
}
