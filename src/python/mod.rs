//! The binding: the only folder that imports pyo3. One thin wrapper file per module, one gate.
//!
//! The Python layer owns the contract (types, dtypes, layout, allocation of outputs); what arrives
//! here is C-contiguous and of the stated dtype, or raises TypeError.

use pyo3::prelude::*;

mod cone;
mod falling;
mod flakes;
mod frame;
mod gas;
mod gate;
mod lookup;
mod numbers;
mod particles;
mod shade;
mod shown;
mod spectral;
mod threads;
mod volume;

#[pymodule]
#[pyo3(name = "_core")]
mod core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::cone::{
        cone_basis, cone_chart, cone_footprints, cone_layer, cone_moving, cone_needed, cone_rays,
        cone_shown, cone_stack, cone_table, cone_tile,
    };
    #[pymodule_export]
    use super::falling::{BallImages, FlakeSheet, fall, flake_rows, sheet_bent, sheet_read};
    #[pymodule_export]
    use super::flakes::{flake_choices, flake_frame, flake_patterns};
    #[pymodule_export]
    use super::frame::{join, over, snow, veil};
    #[pymodule_export]
    use super::gas::{SortedGas, gas_alpha, gas_draw, gas_light, gas_slices, gas_sort, gas_splat};
    #[pymodule_export]
    use super::gate::InternalError;
    #[pymodule_export]
    use super::numbers::{
        all_finite, all_within, lamp_light, particle_edge_fade, particle_positions,
        particle_sway_offsets, smooth, to_half, uniform, wind_waves,
    };
    #[pymodule_export]
    use super::particles::{
        SortedFlakes, particle_draw, particle_draw_lit, particle_ids, particle_splat,
    };
    #[pymodule_export]
    use super::shade::{encode_bytes, plate_cells, shade_add, shade_light, shade_over};
    #[pymodule_export]
    use super::shown::{layer_finish, layer_rgba, layer_seen};
    #[pymodule_export]
    use super::spectral::{
        advance_phase, band_amplitude, blend_tiles, field, inverse_transform, opacity,
        random_phase, temporal_filter, temporal_gain, tent_rate, tile_count, tile_shares,
        wave_depth,
    };
    #[pymodule_export]
    use super::threads::{reproducible, set_reproducible, set_scope, set_threads, threads};
    #[pymodule_export]
    use super::volume::volume;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::lookup::look_up(module.py())
    }
}
