//! Layers and what they lie over: Eq. 7, over, joint opacity, light that differs over the picture, bytes of linear
//! light, and what pixels show besides color.

use numpy::ndarray::{ArrayView3, ArrayViewMut3};
use numpy::{
    PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray1,
    PyReadwriteArray2, PyReadwriteArray3,
};
use pyo3::prelude::*;

use super::gate::{self, Plane, PlaneMut, alike, arrays, either};
use super::particles::SortedFlakes;
use crate::base::error::Error;
use crate::frame::boxes;
use crate::frame::coding::{self, Coding};
use crate::frame::composite;
use crate::frame::grid::Grid;
use crate::frame::plate;
use crate::frame::sample::Sample;
use crate::frame::shade::{self, Lit};
use crate::frame::shown::{Passes, Shown, finish, rgba};
use crate::frame::veil as fog;

const VALUE: f64 = 0.3;

arrays! {
    /// A background of any supported dtype.
    pub enum Picture by try_readonly, PyArray3 as PyReadonlyArray3 {
        Byte: u8, Word: u16, Single: f32, Double: f64
    }
}

arrays! {
    /// An output of the same dtypes.
    pub enum PictureMut by try_readwrite, PyArray3 as PyReadwriteArray3 {
        Byte: u8, Word: u16, Single: f32, Double: f64
    }
}

arrays! {
    /// RGBA of either precision.
    pub enum Layer by try_readonly, PyArray3 as PyReadonlyArray3 { Single: f32, Double: f64 }
}

fn mismatch() -> PyErr {
    Error::invalid("out", "must have the dtype of the background").into()
}

/// Snow of one color over a background.
#[pyfunction]
pub fn snow(
    py: Python<'_>,
    out: PictureMut<'_>,
    background: Picture<'_>,
    alpha: Plane<'_>,
    intensity: Vec<f64>,
) -> PyResult<()> {
    alike!([Byte, Word, Single, Double] PictureMut mut out = out, Picture back = background =>
        either!(Plane alpha = &alpha => {
            let (out, back, alpha) = (out.as_array_mut(), back.as_array(), alpha.as_array());
            let work = VALUE * out.len() as f64;
            gate::run(py, work, |cancel| composite::snow(out, back, alpha, &intensity, cancel))
        }), else mismatch())
}

/// A premultiplied layer over a background.
#[pyfunction]
pub fn over(
    py: Python<'_>,
    out: PictureMut<'_>,
    background: Picture<'_>,
    layer: Layer<'_>,
) -> PyResult<()> {
    alike!([Byte, Word, Single, Double] PictureMut mut out = out, Picture back = background =>
        either!(Layer layer = &layer => {
            let (out, back, layer) = (out.as_array_mut(), back.as_array(), layer.as_array());
            let work = VALUE * out.len() as f64;
            gate::run(py, work, |cancel| composite::over(out, back, layer, cancel))
        }), else mismatch())
}

/// Joint opacity of layers of one color.
#[pyfunction]
#[pyo3(signature = (out, layers, haze, matte=None))]
pub fn join(
    py: Python<'_>,
    out: PlaneMut<'_>,
    layers: Vec<Plane<'_>>,
    haze: f64,
    matte: Option<Plane<'_>>,
) -> PyResult<()> {
    let differ = || PyErr::from(Error::invalid("layers", "must have the dtype of out"));
    macro_rules! of {
        ($variant:ident, $out:expr) => {{
            let pick = |plane| match plane {
                &Plane::$variant(ref array) => Ok(array.as_array()),
                _ => Err(differ()),
            };
            let planes = layers.iter().map(pick).collect::<PyResult<Vec<_>>>()?;
            let matte = matte.as_ref().map(pick).transpose()?;
            let out = $out.as_array_mut();
            let work = VALUE * out.len() as f64;
            gate::run(py, work, |cancel| composite::join(out, &planes, haze, matte, cancel))
        }};
    }
    match out {
        PlaneMut::Single(mut out) => of!(Single, out),
        PlaneMut::Double(mut out) => of!(Double, out),
    }
}

/// Opacity of a veil: `patches` is a coarse field, the pixels between its points, and its strength.
#[pyfunction]
pub fn veil(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f32>,
    way: PyReadonlyArray2<'_, f32>,
    extinction: f64,
    patches: Option<(PyReadonlyArray2<'_, f32>, f64, f64)>,
) -> PyResult<()> {
    let (out, way) = (out.as_array_mut(), way.as_array());
    let patches = patches.as_ref().map(|(field, cell, strong)| (field.as_array(), *cell, *strong));
    let work = 2.0 * out.len() as f64;
    gate::run(py, work, move |cancel| fog::veil(out, way, extinction, patches, cancel))
}

/// The extinction by which a share of the light is lost on ways (n,), on average.
#[pyfunction]
pub fn extinction(ways: PyReadonlyArray1<'_, f64>, lost: f64) -> PyResult<f64> {
    gate::environment()?;
    Ok(fog::extinction(ways.as_slice()?, lost))
}

/// Adds means over boxes (n, 4) to `out` (n, 3); see [`boxes::means`].
#[pyfunction]
pub fn box_means(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f64>,
    boxes: PyReadonlyArray2<'_, f64>,
    alpha: Plane<'_>,
    veil: Plane<'_>,
    limits: (f64, f64),
) -> PyResult<()> {
    let (out, boxes) = (out.as_slice_mut()?.as_chunks_mut().0, boxes.as_slice()?.as_chunks().0);
    alike!([Single, Double] Plane alpha = &alpha, Plane veil = &veil => {
        let planes = (alpha.as_array(), veil.as_array());
        let work = 2.0 * planes.0.len() as f64;
        gate::run(py, work, |cancel| boxes::means(out, boxes, planes, limits, cancel))
    }, else mismatch())
}

/// Colors at the middles of cells: (colors, side of a cell, first row, first column).
pub type Shade<'py> = (PyReadonlyArray3<'py, f32>, f64, usize, usize);

/// A layer of such colors, and light besides.
pub fn lit<'a>(
    alpha: &'a PyReadonlyArray2<'_, f32>,
    shade: &'a Shade<'_>,
    glow: Option<&'a PyReadonlyArray3<'_, f32>>,
) -> Lit<'a> {
    let grid = Grid { colors: shade.0.as_array(), cell: shade.1, first: (shade.2, shade.3) };
    Lit { alpha: alpha.as_array(), grid, glow: glow.map(|glow| glow.as_array()) }
}

/// Sums the linear light of cells of a plate into `out` (rows, columns, 4), of each `step`-th of their rows.
#[pyfunction]
pub fn plate_cells(
    py: Python<'_>,
    mut out: PyReadwriteArray3<'_, f32>,
    picture: Picture<'_>,
    table: PyReadonlyArray1<'_, f32>,
    cell: usize,
    step: usize,
) -> PyResult<()> {
    let out = out.as_array_mut();
    let table = table.as_array();
    let table = table.to_slice().ok_or_else(|| Error::Internal("layout".into()))?;
    fn run<S: Sample<Working = f32>>(
        py: Python<'_>,
        out: ArrayViewMut3<'_, f32>,
        picture: ArrayView3<'_, S>,
        table: &[f32],
        cell: (usize, usize),
    ) -> PyResult<()> {
        let work = 2.0 * picture.len() as f64;
        gate::run(py, work, move |cancel| plate::cells(out, picture, table, cell, cancel))
    }
    let cell = (cell, step);
    match picture {
        Picture::Byte(plate) if table.len() == 256 => run(py, out, plate.as_array(), table, cell),
        Picture::Word(plate) if table.len() == 65536 => run(py, out, plate.as_array(), table, cell),
        Picture::Single(plate) => run(py, out, plate.as_array(), table, cell),
        _ => Err(Error::Internal("no such plate".into()).into()),
    }
}

/// Lays a layer whose color differs over linear light, or over bytes: in linear light with their coding.
#[pyfunction]
#[pyo3(signature = (out, background, alpha, colors, glow=None, coding=None))]
pub fn shade_over(
    py: Python<'_>,
    out: PictureMut<'_>,
    background: Picture<'_>,
    alpha: PyReadonlyArray2<'_, f32>,
    colors: Shade<'_>,
    glow: Option<PyReadonlyArray3<'_, f32>>,
    coding: Option<(PyReadonlyArray1<'_, f32>, PyReadonlyArray1<'_, f32>)>,
) -> PyResult<()> {
    let lit = lit(&alpha, &colors, glow.as_ref());
    let work = 20.0 * lit.alpha.len() as f64;
    match (out, background) {
        (PictureMut::Single(mut out), Picture::Single(back)) => {
            let (out, back) = (out.as_array_mut(), back.as_array());
            gate::run(py, work, |cancel| shade::over(out, back, &lit, cancel))
        }
        (PictureMut::Byte(mut out), Picture::Byte(back)) => {
            let (out, back) = (out.as_array_mut(), back.as_array());
            let Some((light, edges)) = &coding else {
                return gate::run(py, work, |cancel| shade::over_values(out, back, &lit, cancel));
            };
            let coding = Coding { light: light.as_slice()?, edges: edges.as_slice()? };
            gate::run(py, work, |cancel| shade::over_bytes(out, back, &lit, &coding, cancel))
        }
        _ => Err(Error::Internal("no such picture".into()).into()),
    }
}

/// Adds the light of a layer to `glow` (H, W, 3).
#[pyfunction]
pub fn shade_add(
    py: Python<'_>,
    mut glow: PyReadwriteArray3<'_, f32>,
    alpha: PyReadonlyArray2<'_, f32>,
    colors: Shade<'_>,
) -> PyResult<()> {
    let behind = lit(&alpha, &colors, None);
    let glow = glow.as_array_mut();
    gate::run(py, 10.0 * behind.alpha.len() as f64, |cancel| shade::add(glow, &behind, cancel))
}

/// Writes linear light (n,) as bytes; see `Coding`.
#[pyfunction]
pub fn encode_bytes(
    py: Python<'_>,
    mut out: PyReadwriteArray1<'_, u8>,
    values: PyReadonlyArray1<'_, f32>,
    light: PyReadonlyArray1<'_, f32>,
    edges: PyReadonlyArray1<'_, f32>,
) -> PyResult<()> {
    let coding = Coding { light: light.as_slice()?, edges: edges.as_slice()? };
    let (out, values) = (out.as_slice_mut()?, values.as_slice()?);
    gate::run(py, 3.0 * values.len() as f64, |cancel| coding::bytes(out, values, &coding, cancel))
}

/// Turns linear light (n,), three values to a pixel, that is brighter than white to white.
#[pyfunction]
pub fn whiten(py: Python<'_>, mut light: PyReadwriteArray1<'_, f32>) -> PyResult<()> {
    let light = light.as_slice_mut()?;
    gate::run(py, light.len() as f64, |_| {
        shade::whiten(light);
        Ok(())
    })
}

/// Writes the layer of an alpha and one color, (h, w, 4), premultiplied.
#[pyfunction]
pub fn layer_rgba(
    py: Python<'_>,
    mut out: PyReadwriteArray3<'_, f32>,
    alpha: PyReadonlyArray2<'_, f32>,
    color: [f32; 3],
) -> PyResult<()> {
    let (out, alpha) = (out.as_array_mut(), alpha.as_array());
    gate::run(py, 2.0 * alpha.len() as f64, |cancel| rgba(out, alpha, color, cancel))
}

/// Flakes, which of them shows most at a pixel (h, w), and opacities of flakes and of the texture behind them.
type ShownValues<'py> = (
    PyRef<'py, SortedFlakes>,
    PyReadonlyArray2<'py, i32>,
    PyReadonlyArray2<'py, f32>,
    Option<PyReadonlyArray2<'py, f32>>,
);

/// Writes what flakes say over what a texture says of the pixels of a layer, and that nothing is where its alpha
/// is 0; and which flake shows most.
#[pyfunction]
#[pyo3(signature = (forward, backward, depth, ids, alpha, scene=None, flakes=None))]
pub fn layer_finish(
    py: Python<'_>,
    mut forward: PyReadwriteArray3<'_, f32>,
    mut backward: PyReadwriteArray3<'_, f32>,
    mut depth: PyReadwriteArray2<'_, f32>,
    mut ids: PyReadwriteArray2<'_, i64>,
    alpha: PyReadonlyArray2<'_, f32>,
    scene: Option<PyReadonlyArray2<'_, f32>>,
    flakes: Option<ShownValues<'_>>,
) -> PyResult<()> {
    let passes = Passes {
        forward: forward.as_array_mut(),
        backward: backward.as_array_mut(),
        depth: depth.as_array_mut(),
        ids: ids.as_array_mut(),
    };
    let (alpha, scene) = (alpha.as_array(), scene.as_ref().map(|scene| scene.as_array()));
    let said = flakes.as_ref().map_or(Ok(Vec::new()), |flakes| flakes.0.list.said())?;
    let shown = flakes.as_ref().map(|(_, numbers, front, behind)| Shown {
        said: &said,
        numbers: numbers.as_array(),
        front: front.as_array(),
        behind: behind.as_ref().map(|behind| behind.as_array()),
    });
    gate::run(py, 4.0 * alpha.len() as f64, |cancel| finish(passes, alpha, scene, shown, cancel))
}
