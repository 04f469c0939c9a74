//! `flurries.spectral`: films that repeat.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

use super::gate::{self, PlaneMut, each_precision};
use crate::base::error::Error;
use crate::spectral::band::Band;
use crate::spectral::filter::{Alias, TemporalFilter};
use crate::spectral::tent::Motion;
use crate::spectral::volume::{Cells, Volume};

/// Rough nanoseconds for a pixel of a frame on one thread; only decides who watches Ctrl-C.
const PIXEL: f64 = 10.0;

/// A film that repeats, as the Python layer has settled it; the attributes of its request.
#[derive(FromPyObject)]
pub struct Film {
    frames: usize,
    shape: (usize, usize),
    drift: [f64; 2],
    seed: i64,
    wavelengths: (f64, f64),
    exponent: f64,
    alias: String,
    soft_from: f64,
    shutter: f64,
    jitter: bool,
    cells: String,
}

impl Film {
    fn volume(&self) -> Result<Volume, Error> {
        Ok(Volume {
            shape: self.shape,
            frames: self.frames,
            band: Band {
                shortest: self.wavelengths.0,
                longest: self.wavelengths.1,
                exponent: self.exponent,
            },
            seed: self.seed,
            velocity: Motion { drift: self.drift, shift: [0.0; 2] },
            filter: TemporalFilter {
                alias: Alias::named(&self.alias)?,
                soft_from: self.soft_from,
                shutter: self.shutter,
            },
            jitter: self.jitter,
            cells: Cells::named(&self.cells)?,
        })
    }
}

/// The frames of a film at the given times, one below the other; returns the number of cells.
#[pyfunction]
pub fn volume(
    py: Python<'_>,
    out: PlaneMut<'_>,
    film: Film,
    times: PyReadonlyArray1<'_, f64>,
) -> PyResult<usize> {
    let times = times.as_slice().map_err(|_| Error::invalid("time", "must be contiguous"))?;
    let volume = film.volume()?;
    let work = times.len() as f64 * (film.shape.0 * film.shape.1) as f64 * PIXEL;
    each_precision!(out, view => gate::run(py, work, move |cancel| {
        let spectrum = volume.spectrum()?;
        spectrum.render(view, times, cancel)?;
        Ok(spectrum.len())
    }))
}
