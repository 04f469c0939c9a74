//! Light that differs over the picture, and bytes of linear light.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray1};
use numpy::{PyReadwriteArray3, ndarray::ArrayView3};
use pyo3::prelude::*;

use super::frame::Picture;
use super::gate;
use crate::base::error::Error;
use crate::frame::coding::{self, Coding};
use crate::frame::grid::Grid;
use crate::frame::plate;
use crate::frame::shade::{self, Lit};

/// Colors at the middles of cells: (colors, side of a cell, first row, first column).
pub(super) type Shade<'py> = (PyReadonlyArray3<'py, f32>, f64, usize, usize);

pub(super) fn grid<'a>(shade: &'a Shade<'_>) -> Grid<'a> {
    Grid { colors: shade.0.as_array(), cell: shade.1, first: (shade.2, shade.3) }
}

/// Sums the linear light of cells of a plate into `out` (rows, columns, 4).
#[pyfunction]
pub fn plate_cells(
    py: Python<'_>,
    mut out: PyReadwriteArray3<'_, f32>,
    picture: Picture<'_>,
    table: PyReadonlyArray1<'_, f32>,
    cell: usize,
) -> PyResult<()> {
    let out = out.as_array_mut();
    let table = table.as_array();
    let table = table.to_slice().ok_or_else(|| Error::Internal("layout".into()))?;
    fn run<S: plate::Light>(
        py: Python<'_>,
        out: numpy::ndarray::ArrayViewMut3<'_, f32>,
        picture: ArrayView3<'_, S>,
        table: &[f32],
        cell: usize,
    ) -> PyResult<()> {
        let work = 2.0 * picture.len() as f64;
        gate::run(py, work, move |cancel| plate::cells(out, picture, table, cell, cancel))
    }
    match picture {
        Picture::Byte(plate) if table.len() == 256 => run(py, out, plate.as_array(), table, cell),
        Picture::Word(plate) if table.len() == 65536 => run(py, out, plate.as_array(), table, cell),
        Picture::Single(plate) => run(py, out, plate.as_array(), table, cell),
        _ => Err(Error::Internal("no such plate".into()).into()),
    }
}

/// Lays a layer whose color differs over the picture over linear light, or over bytes in linear light.
#[pyfunction]
#[pyo3(signature = (out, background, alpha, colors, glow=None, light=None, edges=None))]
pub fn shade_over(
    py: Python<'_>,
    out: super::frame::PictureMut<'_>,
    background: Picture<'_>,
    alpha: PyReadonlyArray2<'_, f32>,
    colors: Shade<'_>,
    glow: Option<PyReadonlyArray3<'_, f32>>,
    light: Option<PyReadonlyArray1<'_, f32>>,
    edges: Option<PyReadonlyArray1<'_, f32>>,
) -> PyResult<()> {
    use super::frame::PictureMut;
    let lit = Lit {
        alpha: alpha.as_array(),
        grid: grid(&colors),
        glow: glow.as_ref().map(|glow| glow.as_array()),
    };
    let work = 20.0 * lit.alpha.len() as f64;
    match (out, background) {
        (PictureMut::Single(mut out), Picture::Single(back)) => {
            let (out, back) = (out.as_array_mut(), back.as_array());
            gate::run(py, work, |cancel| shade::over(out, back, &lit, cancel))
        }
        (PictureMut::Byte(mut out), Picture::Byte(back)) => {
            let (Some(light), Some(edges)) = (&light, &edges) else {
                return Err(Error::Internal("bytes want their coding".into()).into());
            };
            let coding = Coding { light: light.as_slice()?, edges: edges.as_slice()? };
            let (out, back) = (out.as_array_mut(), back.as_array());
            gate::run(py, work, |cancel| shade::over_bytes(out, back, &lit, &coding, cancel))
        }
        _ => Err(Error::Internal("no such picture".into()).into()),
    }
}

/// Fills `out` (H, W, 3) with the premultiplied light of such a layer.
#[pyfunction]
#[pyo3(signature = (out, alpha, colors, glow=None))]
pub fn shade_light(
    py: Python<'_>,
    mut out: PyReadwriteArray3<'_, f32>,
    alpha: PyReadonlyArray2<'_, f32>,
    colors: Shade<'_>,
    glow: Option<PyReadonlyArray3<'_, f32>>,
) -> PyResult<()> {
    let lit = Lit {
        alpha: alpha.as_array(),
        grid: grid(&colors),
        glow: glow.as_ref().map(|glow| glow.as_array()),
    };
    let out = out.as_array_mut();
    gate::run(py, 20.0 * lit.alpha.len() as f64, |cancel| shade::light(out, &lit, cancel))
}

/// Adds the light of a layer to `glow` (H, W, 3).
#[pyfunction]
pub fn shade_add(
    py: Python<'_>,
    mut glow: PyReadwriteArray3<'_, f32>,
    alpha: PyReadonlyArray2<'_, f32>,
    colors: Shade<'_>,
) -> PyResult<()> {
    let behind = Lit { alpha: alpha.as_array(), grid: grid(&colors), glow: None };
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
