//! What the pixels of a layer show besides color.

use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2, PyReadwriteArray3};
use pyo3::prelude::*;

use super::gate;
use crate::frame::shown::{Flakes, Passes, Shown, finish, rgba};

/// Numbers of flakes (h, w), opacities of flakes and of the texture behind them.
type Planes<'py> =
    (PyReadonlyArray2<'py, i32>, PyReadonlyArray2<'py, f32>, Option<PyReadonlyArray2<'py, f32>>);

fn shown<'a>(planes: &'a Planes<'_>) -> Shown<'a> {
    let (numbers, front, behind) = planes;
    Shown {
        numbers: numbers.as_array(),
        front: front.as_array(),
        behind: behind.as_ref().map(|behind| behind.as_array()),
    }
}

/// Returns the numbers of the flakes that are seen in a layer, in order.
#[pyfunction]
pub fn layer_seen<'py>(
    py: Python<'py>,
    planes: Planes<'py>,
) -> PyResult<Bound<'py, PyArray1<i32>>> {
    let shown = shown(&planes);
    let seen = gate::run(py, 2.0 * shown.numbers.len() as f64, |cancel| shown.seen(cancel))?;
    Ok(PyArray1::from_vec(py, seen))
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

/// Writes what flakes say, one row of `said` for each of `seen`, over what a texture says of the pixels of
/// a layer, and that nothing is where its alpha is 0.
#[pyfunction]
#[pyo3(signature = (forward, backward, depth, alpha, scene=None, flakes=None))]
pub fn layer_finish(
    py: Python<'_>,
    mut forward: PyReadwriteArray3<'_, f32>,
    mut backward: PyReadwriteArray3<'_, f32>,
    mut depth: PyReadwriteArray2<'_, f32>,
    alpha: PyReadonlyArray2<'_, f32>,
    scene: Option<PyReadonlyArray2<'_, f32>>,
    flakes: Option<(Planes<'_>, PyReadonlyArray1<'_, i32>, PyReadonlyArray2<'_, f32>)>,
) -> PyResult<()> {
    let passes = Passes {
        forward: forward.as_array_mut(),
        backward: backward.as_array_mut(),
        depth: depth.as_array_mut(),
    };
    let (alpha, scene) = (alpha.as_array(), scene.as_ref().map(|scene| scene.as_array()));
    let flakes = match &flakes {
        None => None,
        Some((planes, seen, said)) => {
            Some(Flakes { shown: shown(planes), seen: seen.as_slice()?, said: said.as_array() })
        }
    };
    gate::run(py, 4.0 * alpha.len() as f64, |cancel| {
        finish(passes, alpha, scene, flakes.as_ref(), cancel)
    })
}
