//! `flurries.cone`: rays, one layer, charts, tables, stacks, tiles.

use numpy::ndarray::{ArrayView2, ArrayViewMut2};
use numpy::{
    PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray2, PyReadwriteArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::gate::{self, PlaneMut, each_precision};
use crate::base::error::Error;
use crate::base::pool;
use crate::cone::area::Area;
use crate::cone::basis::Basis;
use crate::cone::chart::{self, Chart, Course};
use crate::cone::layer::{self, Layer};
use crate::cone::sheet::{Sheet, Table, Tables};
use crate::cone::stack::{self, Planes, Source};
use crate::cone::view::View;
use crate::cone::{table, tile};

/// Rough nanoseconds, which only decide who watches for Ctrl-C.
const RAY: f64 = 60.0;
const LOOK_UP: f64 = 4.0;

/// (focal, cx, cy, rotation row-major, axis, slope, eye over radius), as the Python layer passes it.
type Pose = (f64, f64, f64, [f64; 9], [f64; 3], f64, [f64; 3]);

fn view_of(pose: Pose) -> Result<View, Error> {
    let (focal, x, y, rotation, axis, slope, eye) = pose;
    let basis = Basis::of(axis)?.in_camera(&rotation);
    Ok(View { basis, focal, center: [x, y], slope, eye })
}

/// Fills `out` (n, 5): azimuth, height, azimuth's and height's step per pixel, fade, of positions.
#[pyfunction]
pub fn cone_rays(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f64>,
    places: PyReadonlyArray2<'_, f64>,
    pose: Pose,
) -> PyResult<()> {
    let (mut out, places) = (out.as_array_mut(), places.as_array());
    let view = view_of(pose)?;
    if out.dim() != (places.nrows(), 5) || places.ncols() != 2 {
        return Err(Error::Internal("wrong shapes".into()).into());
    }
    gate::run(py, RAY * places.nrows() as f64, move |cancel| {
        let chunks = out
            .axis_chunks_iter_mut(numpy::ndarray::Axis(0), 4096)
            .zip(places.axis_chunks_iter(numpy::ndarray::Axis(0), 4096));
        pool::for_each(chunks, |(mut out, places): (ArrayViewMut2<f64>, ArrayView2<f64>)| {
            cancel.check()?;
            for (mut out, place) in out.rows_mut().into_iter().zip(places.rows()) {
                let p = view.point(place[0], place[1]);
                let values = [p.azimuth, p.height, p.azimuth_step, p.height_step, p.fade];
                out.iter_mut().zip(values).for_each(|(out, value)| *out = value);
            }
            Ok(())
        })
    })
}

/// One texture on the cone, exact boxes. `sheet` is (repeats, phase, stretch, offset, gain).
#[pyfunction]
pub fn cone_layer(
    py: Python<'_>,
    out: PlaneMut<'_>,
    texture: PyReadonlyArray2<'_, f64>,
    pose: Pose,
    sheet: (u32, f64, f64, [f64; 2], f64),
) -> PyResult<()> {
    let (view, texture) = (view_of(pose)?, texture.as_array());
    let (repeats, phase, stretch, offset, gain) = sheet;
    let sheet = Layer { repeats, phase, stretch, offset, gain };
    each_precision!(out, view_out => {
        let work = 2.0 * RAY * view_out.len() as f64;
        gate::run(py, work, |cancel| {
            layer::layer(view_out, &view, &Area::of(texture)?, &sheet, cancel)
        })
    })
}

/// Fills the planes of a chart; see `cone::chart`.
#[pyfunction]
pub fn cone_chart(
    py: Python<'_>,
    mut across: PyReadwriteArray2<'_, u32>,
    mut along: PyReadwriteArray2<'_, u32>,
    mut fade: PyReadwriteArray2<'_, f32>,
    mut state: PyReadwriteArray2<'_, u8>,
    pose: Pose,
    course: (u32, f64, usize),
) -> PyResult<()> {
    let (view, course) = (view_of(pose)?, course_of(course));
    let blocks = state.as_array().ncols();
    let pixels = [across.as_array().len(), along.as_array().len(), fade.as_array().len()];
    if pixels != [state.as_array().len() * chart::BLOCK; 3] || blocks == 0 {
        return Err(Error::Internal("the planes of a chart do not fit".into()).into());
    }
    let planes = Chart {
        across: across.as_slice_mut()?,
        along: along.as_slice_mut()?,
        fade: fade.as_slice_mut()?,
        state: state.as_slice_mut()?,
    };
    let work = LOOK_UP * pixels[0] as f64;
    gate::run(py, work, |cancel| chart::chart(planes, blocks, &view, &course, cancel))
}

/// (tiles around, stretch, first row)
fn course_of((tiles, stretch, top): (u32, f64, usize)) -> Course {
    Course { tiles, stretch, top }
}

/// Fills the footprints of a chart's blocks, (blocks down, blocks, 2).
#[pyfunction]
pub fn cone_footprints(
    py: Python<'_>,
    mut out: PyReadwriteArray3<'_, f32>,
    pose: Pose,
    course: (u32, f64, usize),
) -> PyResult<()> {
    let (view, course, out) = (view_of(pose)?, course_of(course), out.as_array_mut());
    gate::run(py, RAY * out.len() as f64, move |_| {
        chart::footprints(out, &view, &course);
        Ok(())
    })
}

/// How many of the radii, least first, lie before the depth map, (H, W) in the columns of a chart.
#[pyfunction]
pub fn cone_shown(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, u8>,
    depth: PyReadonlyArray2<'_, f32>,
    pose: Pose,
    radii: Vec<f64>,
    top: usize,
) -> PyResult<()> {
    let view = view_of(pose)?;
    let (out, depth) = (out.as_array_mut(), depth.as_array());
    gate::run(py, 10.0 * depth.len() as f64, move |cancel| {
        layer::shown(out, depth, &view, &radii, top, cancel)
    })
}

/// Fills a table for boxes of the given size in texels.
#[pyfunction]
pub fn cone_table(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, u32>,
    texture: PyReadonlyArray2<'_, f64>,
    width: f64,
    height: f64,
    peak: f64,
) -> PyResult<()> {
    let (out, texture) = (out.as_array_mut(), texture.as_array());
    let work = 20.0 * out.len() as f64;
    gate::run(py, work, move |cancel| {
        table::table(out, &Area::of(texture)?, width, height, peak, cancel)
    })
}

/// (multiple, offset across, offset along, gain, log2 of the texels in a tile)
type SheetValues = (u32, u32, u32, f32, f32);

fn sheets_of(sheets: &[SheetValues]) -> Vec<Sheet> {
    sheets
        .iter()
        .map(|&(multiple, across, along, gain, texels)| Sheet {
            multiple,
            offset: [across, along],
            gain,
            texels,
        })
        .collect()
}

type TableValues<'py> = (usize, usize, PyReadonlyArray2<'py, u32>);

fn tables_of<'a>(levels: usize, values: &'a [TableValues<'_>]) -> Result<Tables<'a>, Error> {
    let wrong = || Error::Internal("a table does not fit".into());
    let mut grid = vec![None; levels.checked_mul(levels).ok_or_else(wrong)?];
    for (across, along, entries) in values {
        let [rows, columns] = [0, 1].map(|axis| entries.shape()[axis]);
        let place = grid.get_mut(across * levels + along).ok_or_else(wrong)?;
        *place = Some(Table {
            entries: entries.as_slice().map_err(|_| wrong())?,
            columns: columns.trailing_zeros(),
            rows: rows.trailing_zeros(),
        });
    }
    Ok(Tables { levels, grid })
}

/// Marks the tables that a chart's layers look into.
#[pyfunction]
pub fn cone_needed(
    mut out: PyReadwriteArray2<'_, u8>,
    footprint: PyReadonlyArray3<'_, f32>,
    sheets: Vec<SheetValues>,
) -> PyResult<()> {
    Ok(stack::needed(out.as_array_mut(), footprint.as_array(), &sheets_of(&sheets))?)
}

/// The planes of a chart (across, along, fade, state), and which layers stand before what is in the picture.
type ChartValues<'py> = (
    PyReadonlyArray2<'py, u32>,
    PyReadonlyArray2<'py, u32>,
    PyReadonlyArray2<'py, f32>,
    PyReadonlyArray2<'py, u8>,
    Option<PyReadonlyArray2<'py, u8>>,
);

/// The joint alpha of layers, of a chart or else of a view: its pose and course. `tables` are (level across, level
/// along, entries).
#[pyfunction]
pub fn cone_stack(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f32>,
    chart: Option<ChartValues<'_>>,
    view: Option<(Pose, (u32, f64, usize))>,
    footprint: PyReadonlyArray3<'_, f32>,
    sheets: Vec<SheetValues>,
    levels: usize,
    tables: Vec<TableValues<'_>>,
) -> PyResult<()> {
    let source = match (&chart, view) {
        (Some((across, along, fade, state, shown)), _) => Source::Chart(Planes {
            across: across.as_slice()?,
            along: along.as_slice()?,
            fade: fade.as_slice()?,
            state: state.as_slice()?,
            shown: shown.as_ref().map(|shown| shown.as_slice()).transpose()?,
        }),
        (None, Some((pose, course))) => Source::View(view_of(pose)?, course_of(course)),
        (None, None) => return Err(Error::Internal("neither a chart nor a view".into()).into()),
    };
    let tables = tables_of(levels, &tables)?;
    let (out, sheets, footprint) = (out.as_array_mut(), sheets_of(&sheets), footprint.as_array());
    let work = 2.0 * LOOK_UP * out.len() as f64;
    gate::run(py, work, |cancel| stack::stack(out, &source, footprint, &sheets, &tables, cancel))
}

/// A toroidal texture of drops, rows of (u, v, sigma, half length, opacity) in texels.
#[pyfunction]
pub fn cone_tile(
    py: Python<'_>,
    out: PlaneMut<'_>,
    drops: PyReadonlyArray2<'_, f64>,
) -> PyResult<()> {
    let drops = drops.as_array();
    each_precision!(out, view => {
        let work = 20.0 * drops.nrows() as f64 * view.nrows() as f64;
        gate::run(py, work, |cancel| tile::tile(view, drops, cancel))
    })
}
