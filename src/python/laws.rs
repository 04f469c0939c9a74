//! Laws of flakes, a number or a point for each: places, fades, the width of an image, light of lamps.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2};
use pyo3::prelude::*;

use super::gate;
use super::particles::swaying;
use crate::base::lamps::{Lamps, light};
use crate::base::pool;
use crate::base::smooth::smoothstep;
use crate::particles::torus::{self, Sway, Torus};

/// Fills `out` (n, 3) with the positions of flakes 0..n at `time`, or of those of some `numbers` (n,).
#[pyfunction]
#[pyo3(signature = (out, sides, center, seed, velocity, time, sway, numbers=None))]
#[expect(clippy::too_many_arguments, reason = "the Python layer passes plain values")]
pub fn particle_positions(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f64>,
    sides: [f64; 3],
    center: [f64; 3],
    seed: i64,
    velocity: PyReadonlyArray2<'_, f64>,
    time: f64,
    sway: Option<(f64, f64)>,
    numbers: Option<PyReadonlyArray1<'_, i64>>,
) -> PyResult<()> {
    let (out, velocity) = (out.as_array_mut(), velocity.as_array());
    let seeds = (seed, numbers.as_ref().map(|numbers| numbers.as_array()));
    gate::run(py, 60.0 * out.nrows() as f64, |cancel| {
        let torus = Torus::new(sides, center)?;
        torus::positions(out, &torus, seeds, velocity, time, swaying(sway), cancel)
    })
}

/// Fills `out` (n, 3) with what the sway adds to the positions of flakes 0..n at `time`.
#[pyfunction]
pub fn particle_sway_offsets(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f64>,
    seed: i64,
    time: f64,
    sway: (f64, f64),
) -> PyResult<()> {
    let out = out.as_array_mut();
    let sway = Sway { amplitude: sway.0, angular_frequency: sway.1 };
    gate::run(py, 60.0 * out.nrows() as f64, |cancel| {
        torus::sway_offsets(out, seed, time, sway, cancel)
    })
}

/// Fills `out` (n,) with how much of each point is shown: less near the walls of the box.
#[pyfunction]
pub fn particle_edge_fade(
    py: Python<'_>,
    mut out: PyReadwriteArray1<'_, f64>,
    points: PyReadonlyArray2<'_, f64>,
    sides: [f64; 3],
    center: [f64; 3],
) -> PyResult<()> {
    let (out, points) = (out.as_array_mut(), points.as_array());
    gate::run(py, 10.0 * out.len() as f64, |cancel| {
        torus::edge_fade(out, points, &Torus::new(sides, center)?, cancel)
    })
}

/// Fills `out` (n, 3) with the radiance that particles at points send to an eye.
#[pyfunction]
pub fn lamp_light(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f64>,
    points: PyReadonlyArray2<'_, f64>,
    lamps: PyReadonlyArray2<'_, f64>,
    optics: (f64, f64),
    eye: [f64; 3],
) -> PyResult<()> {
    let lamps = Lamps::of(lamps.as_slice()?, optics.0, optics.1, eye)?;
    let (out, points) = (out.as_slice_mut()?, points.as_slice()?);
    gate::run(py, 40.0 * points.len() as f64, |_| {
        let (points, out): (&[[f64; 3]], &mut [[f64; 3]]) =
            (points.as_chunks().0, out.as_chunks_mut().0);
        let tasks: Vec<_> = points.chunks(4096).zip(out.chunks_mut(4096)).collect();
        pool::for_each(tasks, |(points, out)| {
            light(&lamps, points, out);
            Ok(())
        })
    })
}

/// Fills `out` (n,) with 0 below 0, 1 above 1 and the cubic between.
#[pyfunction]
pub fn smooth(mut out: PyReadwriteArray1<'_, f64>, t: PyReadonlyArray1<'_, f64>) -> PyResult<()> {
    gate::each(&mut out, &t, smoothstep)
}
