//! Numbers and points, one after the other: laws of flakes, light of lamps, wind, random numbers, checks of
//! whole arrays, half floats.

use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2};
use pyo3::prelude::*;

use super::gate::{self, arrays, either};
use crate::air;
use crate::base::lamps::{Lamps, light};
use crate::base::pixel::smoothstep;
use crate::base::real::Real;
use crate::base::{pool, random, scan};
use crate::encode::to_half as half;
use crate::particles::torus::{self, Torus};

/// Makes values (n,) 0 below 0, 1 above 1 and the cubic between.
#[pyfunction]
pub fn smooth(mut values: PyReadwriteArray1<'_, f64>) {
    values.as_array_mut().map_inplace(|t| *t = smoothstep(*t));
}

/// Fills `out` (n, 3) with the positions of flakes 0..n at `time`.
#[pyfunction]
pub fn particle_positions(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f64>,
    sides: [f64; 3],
    center: [f64; 3],
    seed: i64,
    velocity: PyReadonlyArray2<'_, f64>,
    time: f64,
    sway: Option<(f64, f64)>,
) -> PyResult<()> {
    let (out, velocity) = (out.as_array_mut(), velocity.as_array());
    gate::run(py, 60.0 * out.nrows() as f64, |cancel| {
        let torus = Torus::new(sides, center)?;
        torus::positions(out, &torus, seed, velocity, time, sway, cancel)
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

/// Fills `out` (n, c) with sums of plane waves at points (n, 3).
#[pyfunction]
pub fn wind_waves(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f64>,
    points: PyReadonlyArray2<'_, f64>,
    k: PyReadonlyArray2<'_, f64>,
    weights: PyReadonlyArray2<'_, f64>,
) -> PyResult<()> {
    let (out, points) = (out.as_array_mut(), points.as_array());
    let (k, weights) = (k.as_array(), weights.as_array());
    let work = 5.0 * out.nrows() as f64 * k.nrows() as f64;
    gate::run(py, work, move |cancel| air::sum(out, points, k, weights, cancel))
}

/// Single floats as the bits of the nearest half floats, within what is finite.
#[pyfunction]
pub fn to_half(
    py: Python<'_>,
    mut out: PyReadwriteArray1<'_, u16>,
    values: PyReadonlyArray1<'_, f32>,
) -> PyResult<()> {
    let (out, values) = (out.as_slice_mut()?, values.as_slice()?);
    gate::run(py, values.len() as f64, move |cancel| half(out, values, cancel))
}

/// Uniform numbers in [0, 1), one for each index of a stream.
#[pyfunction]
pub fn uniform(mut out: PyReadwriteArray1<'_, f64>, seed: i64, stream: i64) -> PyResult<()> {
    random::uniform(out.as_slice_mut()?, seed, stream);
    Ok(())
}

arrays! {
    /// A flat array of either precision.
    pub enum Flat by try_readonly, PyArray1 as PyReadonlyArray1 { Single: f32, Double: f64 }
}

/// Whether all numbers are from `low` to `high`.
#[pyfunction]
pub fn all_within(py: Python<'_>, values: Flat<'_>, low: f64, high: f64) -> PyResult<bool> {
    // About a nanosecond for a few numbers.
    either!(Flat values = values => {
        let values = values.as_slice()?;
        gate::run(py, 0.2 * values.len() as f64, move |_| {
            Ok(scan::all_within(values, Real::of(low), Real::of(high)))
        })
    })
}
