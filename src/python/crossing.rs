//! Flakes of the weather for data sets.

use numpy::{PyReadonlyArray1, PyReadwriteArray2};
use pyo3::prelude::*;

use super::gate;
use crate::particles::crossing::{Crossing, cross};

/// Flakes that cross the picture of a camera at rest; returns how many are seen, the first rows.
///
/// `view` is (width, height, focal, room, soft), `way` the motion since time 0, `sway` (amplitude,
/// angle), `fade` two sigmas in px.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "one flat call from the weather for data sets")]
pub fn particle_crossing(
    py: Python<'_>,
    mut points: PyReadwriteArray2<'_, f64>,
    mut parts: PyReadwriteArray2<'_, f64>,
    seed: i64,
    stream: i64,
    depths: PyReadonlyArray1<'_, f64>,
    sums: PyReadonlyArray1<'_, f64>,
    view: (f64, f64, f64, f64, f64),
    way: [f64; 2],
    sway: (f64, f64),
    sizes: Vec<f64>,
    opacity: f64,
    fade: (f64, f64),
) -> PyResult<usize> {
    let (width, height, focal, room, soft) = view;
    let (depths, sums) = (depths.as_slice()?, sums.as_slice()?);
    let (points, parts) = (points.as_array_mut(), parts.as_array_mut());
    // Some 50 ns for each.
    gate::run(py, 50.0 * points.nrows() as f64, move |cancel| {
        let law = Crossing {
            depths,
            sums,
            size: [width, height],
            focal,
            room: (room, soft),
            way,
            sway,
            sizes: &sizes,
            opacity,
            fade,
        };
        cross(points, parts, &law, seed, stream, cancel)
    })
}
