//! The binding: the only folder that imports pyo3. One thin wrapper file per module, one gate.
//!
//! The Python layer owns the contract (types, dtypes, layout, allocation of outputs); what arrives
//! here is C-contiguous and of the stated dtype, or raises TypeError.

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;

use crate::base::error::Error;

mod cone;
mod falling;
mod flakes;
mod frame;
mod gas;
mod gate;
mod numbers;
mod particles;
mod spectral;

#[pymodule]
#[pyo3(name = "_core")]
mod core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::cone::{
        cone_chart, cone_footprints, cone_layer, cone_needed, cone_rays, cone_shown, cone_stack,
        cone_table, cone_tile,
    };
    #[pymodule_export]
    use super::falling::{BallImages, FlakeSheet, fall, flake_rows, sheet_bent, sheet_read};
    #[pymodule_export]
    use super::flakes::{flake_choices, flake_frame, flake_patterns};
    #[pymodule_export]
    use super::frame::{
        box_means, encode_bytes, extinction, join, layer_finish, layer_rgba, over, plate_cells,
        shade_add, shade_over, snow, veil, whiten,
    };
    #[pymodule_export]
    use super::gas::{SortedGas, gas_draw, gas_glow, gas_light, gas_slices, gas_sort};
    #[pymodule_export]
    use super::gate::{
        InternalError, reproducible, set_reproducible, set_scope, set_threads, threads,
    };
    #[pymodule_export]
    use super::numbers::{
        all_within, lamp_light, particle_edge_fade, particle_positions, particle_sway_offsets,
        smooth, to_half, uniform, wind_waves,
    };
    #[pymodule_export]
    use super::particles::{
        SortedFlakes, particle_draw, particle_draw_lit, particle_ids, particle_splat,
    };
    #[pymodule_export]
    use super::spectral::{
        advance_phase, band_amplitude, blend_tiles, field, inverse_transform, opacity,
        random_phase, temporal_filter, temporal_gain, tent_rate, tile_count, tile_shares, volume,
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        super::look_up(module.py())
    }
}

/// Finds NumPy's functions and its table of borrowed arrays while the module is imported, on another thread: Python hears
/// Ctrl-C on the main thread alone, and the binding, which would look them up at the first array, panics if that fails.
fn look_up(py: Python<'_>) -> PyResult<()> {
    // Where NumPy is missing or Ctrl-C is pressed in its import, this is an error like any other.
    py.import("numpy")?;
    let found = py.detach(|| {
        let thread = std::thread::Builder::new().spawn(|| {
            Python::attach(|py| PyArray1::<f64>::zeros(py, 1, false).try_readwrite().is_ok())
        });
        thread.is_ok_and(|thread| thread.join().unwrap_or(false))
    });
    if found { Ok(()) } else { Err(Error::Internal("NumPy cannot be reached".into()).into()) }
}
