//! Patterns of the texture of flakes: made of layers or of a population, and prepared for frames.

use std::sync::Arc;

use num_complex::Complex;
use numpy::{
    PyArray3, PyArray4, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray4,
    PyReadwriteArray5,
};
use pyo3::prelude::*;

use super::gate::{self, arrays, either};
use crate::base::error::{Cancel, Error};
use crate::spectral::flakes::pattern::{Law, patterns};
use crate::spectral::flakes::places::{self, Slab, population};
use crate::spectral::flakes::prepared::Prepared;

/// Rough nanoseconds for a flake of a pattern, for one at a place within a pixel, and for a pixel.
const FLAKE: f64 = 2000.0;
const STAMP: f64 = 100.0;
const PIXEL: f64 = 3.0;

arrays! {
    /// Spectra of either precision, to be written.
    pub enum SpectraMut by try_readwrite, PyArray4 as PyReadwriteArray4 {
        Single: Complex<f32>, Double: Complex<f64>
    }
}

arrays! {
    /// Spectra of either precision.
    pub enum Spectra by try_readonly, PyArray3 as PyReadonlyArray3 {
        Single: Complex<f32>, Double: Complex<f64>
    }
}

/// Patterns of layers; `law` is (shear, opacity, share of the flakes that are shown, seed).
#[pyfunction]
pub fn flake_patterns(
    py: Python<'_>,
    out: SpectraMut<'_>,
    counts: PyReadonlyArray1<'_, f64>,
    diameters: PyReadonlyArray2<'_, f64>,
    law: (f64, f64, f64, i64),
) -> PyResult<()> {
    let counts = counts.as_slice().map_err(|_| Error::invalid("counts", "must be contiguous"))?;
    let (diameters, (shear, opacity, amount, seed)) = (diameters.as_array(), law);
    either!(SpectraMut mut out = out => {
        let out = out.as_array_mut();
        let (_, number, tile, _) = out.dim();
        let work = counts.iter().sum::<f64>() * number as f64 * FLAKE;
        let law = Law { tile, shear, opacity, amount, seed };
        gate::run(py, work, move |cancel| patterns(out, counts, diameters, law, cancel))
    })
}

/// A slab of a population, as the Python layer has it.
#[derive(FromPyObject)]
pub struct SlabRequest {
    drawn: f64,
    number: f64,
    coverage: f64,
    diameters: Vec<f64>,
    streak: [f64; 2],
    thin: f64,
}

/// Patterns (L, P, 1 or 16, M, M/2 + 1) of a population, at places within a pixel. `law` is (shear in
/// pixels, opacity, share of the flakes that are shown, seed). Returns the mean depth of a tile of each
/// slab in square pixels.
#[pyfunction]
pub fn flake_population(
    py: Python<'_>,
    mut out: PyReadwriteArray5<'_, Complex<f32>>,
    slabs: Vec<SlabRequest>,
    law: (i64, f64, f64, i64),
) -> PyResult<Vec<f64>> {
    let out = out.as_array_mut();
    let (_, number, _, tile, _) = out.dim();
    let (shear, opacity, amount, seed) = law;
    let law = places::Law { tile, shear, opacity, amount, seed };
    let flakes = slabs.iter().map(|slab| slab.drawn).sum::<f64>();
    let run = move |cancel: &Cancel| {
        let slabs: Vec<Slab<'_>> = slabs
            .iter()
            .map(|slab| Slab {
                drawn: slab.drawn,
                count: slab.number,
                coverage: slab.coverage,
                diameters: &slab.diameters,
                streak: slab.streak,
                thin: slab.thin.clamp(1e-3, 1.0),
            })
            .collect();
        population(out, &slabs, law, cancel)
    };
    gate::run(py, flakes * number as f64 * STAMP + (number * tile * tile) as f64 * PIXEL, run)
}

/// Patterns as frames read them, in the precision of these.
#[pyclass(module = "flurries._core", frozen)]
pub struct PreparedFlakes {
    pub(super) patterns: Either,
}

pub(super) enum Either {
    Single(Arc<Prepared<f32>>),
    Double(Arc<Prepared<f64>>),
}

#[pymethods]
impl PreparedFlakes {
    /// Coverage of a tile of each pattern, square pixels.
    #[getter]
    fn means(&self) -> Vec<f64> {
        either!(Either patterns = &self.patterns => patterns.means().to_vec())
    }

    /// Size of a tile, pixels.
    #[getter]
    fn tile(&self) -> usize {
        either!(Either patterns = &self.patterns => patterns.tile)
    }
}

/// Prepares spectra (n, M, M/2 + 1) for frames of float64, or of float32.
#[pyfunction]
pub fn flake_prepare(
    py: Python<'_>,
    spectra: Spectra<'_>,
    shear: f64,
    double: bool,
) -> PyResult<PreparedFlakes> {
    either!(Spectra spectra = &spectra => {
        let spectra = spectra.as_array();
        let patterns = if double {
            Either::Double(Arc::new(gate::run(py, 0.0, move |_| Prepared::new(spectra, shear))?))
        } else {
            Either::Single(Arc::new(gate::run(py, 0.0, move |_| Prepared::new(spectra, shear))?))
        };
        Ok(PreparedFlakes { patterns })
    })
}

/// Patterns between two prepared sets: (1 - weight) of the first, `weight` of the second.
#[pyfunction]
pub fn flake_mix(
    py: Python<'_>,
    first: &PreparedFlakes,
    second: &PreparedFlakes,
    weight: f64,
) -> PyResult<PreparedFlakes> {
    let patterns = match (&first.patterns, &second.patterns) {
        (Either::Single(a), Either::Single(b)) => {
            Either::Single(Arc::new(gate::run(py, 0.0, move |_| a.mixed(b, weight))?))
        }
        (Either::Double(a), Either::Double(b)) => {
            Either::Double(Arc::new(gate::run(py, 0.0, move |_| a.mixed(b, weight))?))
        }
        _ => return Err(Error::invalid("second", "must have the dtype of the first").into()),
    };
    Ok(PreparedFlakes { patterns })
}
