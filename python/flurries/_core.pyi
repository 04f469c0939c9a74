from collections.abc import Sequence
from typing import Any, final

import numpy as np
import numpy.typing as npt

from flurries.cone.sheet import Pose
from flurries.effects.air import Air
from flurries.gas.splatting import Gas
from flurries.spectral.flakes import Request as FlakeRequest
from flurries.spectral.frame import Request
from flurries.spectral.volume import Film

__all__ = [
    "BallImages", "FlakeSheet", "InternalError", "SortedFlakes", "SortedGas", "__version__",
    "advance_phase",
    "all_within", "band_amplitude", "blend_tiles", "box_means", "cone_chart", "cone_footprints",
    "cone_layer", "cone_needed", "cone_rays", "cone_shown", "cone_stack", "cone_table",
    "cone_tile", "encode_bytes", "extinction", "fall", "field", "flake_choices", "flake_frame",
    "flake_patterns", "flake_rows", "gas_draw", "gas_glow", "gas_light",
    "gas_slices", "gas_sort", "inverse_transform", "join", "lamp_light",
    "layer_finish", "layer_rgba", "opacity", "over", "particle_draw",
    "particle_draw_lit", "particle_edge_fade", "particle_ids", "particle_positions",
    "particle_splat", "particle_sway_offsets", "plate_cells", "random_phase", "reproducible",
    "set_reproducible", "set_scope", "set_threads", "shade_add", "shade_over", "sheet_bent",
    "sheet_read", "smooth", "snow", "temporal_filter", "temporal_gain", "tent_rate", "threads",
    "tile_count", "tile_shares", "to_half", "uniform", "veil", "volume", "whiten", "wind_waves",
]  # fmt: skip

__version__: str

_Array = npt.NDArray[Any]
_Float64 = npt.NDArray[np.float64]
_Int32 = npt.NDArray[np.int32]
_Pair = tuple[float, float]
_Vector = tuple[float, float, float]
_Window = tuple[int, int, int, int]
# Focal length and principal point, px, and the eye; then the near plane.
_Sight = tuple[float, float, float, _Vector]
_Lens = tuple[float, float, float, _Vector, float]
_Listed = tuple[_Float64, _Float64, _Float64, _Float64, float]
_Map = tuple[float, float, float, float]
_Colors = tuple[_Array, float, int, int]
# Cones: tiles around, stretch, first row; multiple, offsets, gain, log2 of the texels of a tile.
_Course = tuple[int, float, int]
_Sheet = tuple[int, int, int, float, float]
_Manner = tuple[str, str, float, str, bool, float]
# Slices of gas: extinction on a coarse grid, edges, what ends them, slopes of columns and rows, and
# short waves with their strength.
_Detail = tuple[_Array, float] | None
_Bank = tuple[_Array, Sequence[float], _Array | None, tuple[_Array, _Array], _Detail]

class InternalError(RuntimeError): ...

def set_threads(n: int) -> None: ...
def set_reproducible(on: bool) -> None: ...
def reproducible() -> bool: ...
def set_scope(threads: int | None, reproducible: bool | None) -> tuple[int | None, bool | None]: ...
def threads() -> int: ...
def tent_rate(out: _Float64, drift: list[float], repeat: float | None = None) -> None: ...
def band_amplitude(out: _Float64, wavelengths: _Pair, exponent: float) -> None: ...
def random_phase(out: _Float64, seed: int, tile: tuple[int, int]) -> None: ...
def advance_phase(
    out: _Float64, phase: _Float64, drift: list[float], shift: list[float]
) -> None: ...
def temporal_filter(
    out: _Float64, amplitude: _Float64, drift: list[float], shift: list[float], alias: str,
    soft_from: float, shutter: float, renormalise: bool,
) -> None: ...  # fmt: skip
def inverse_transform(out: _Array, amplitude: _Float64, phase: _Float64) -> None: ...
def temporal_gain(
    out: _Float64, rate: _Float64, alias: str, soft_from: float, shutter: float
) -> None: ...
def tile_shares(out: _Float64, tile: int, overlap: int, blend: str) -> None: ...
def blend_tiles(out: _Array, tiles: _Array, overlap: int, blend: str) -> None: ...
def opacity(out: _Array, field: _Array, map: _Map) -> None: ...
def field(
    out: _Array, request: Request, map: _Map | None = None, preserve_mean: bool = False
) -> int: ...
def flake_patterns(
    out: _Array, counts: _Float64, diameters: _Float64, law: tuple[float, float, int]
) -> None: ...
def flake_choices(
    pattern: _Int32, shift: _Float64, seed: int, patterns: int, tile: int
) -> None: ...
def flake_frame(out: _Array, spectra: _Array, request: FlakeRequest) -> None: ...
def all_within(values: _Array, low: float, high: float) -> bool: ...
def volume(out: _Array, film: Film, times: _Float64) -> int: ...
def snow(out: _Array, background: _Array, alpha: _Array, intensity: list[float]) -> None: ...
def over(out: _Array, background: _Array, layer: _Array) -> None: ...
def join(out: _Array, layers: list[_Array], haze: float, matte: _Array | None = None) -> None: ...
def layer_rgba(out: _Array, alpha: _Array, color: Sequence[float]) -> None: ...
def layer_finish(
    forward: _Array, backward: _Array, depth: _Array, ids: _Array, alpha: _Array,
    scene: _Array | None = None,
    flakes: tuple[SortedFlakes, _Array, _Array, _Array | None] | None = None,
) -> None: ...  # fmt: skip
def plate_cells(out: _Array, picture: _Array, table: _Array, cell: int, step: int) -> None: ...
def shade_over(
    out: _Array, background: _Array, alpha: _Array, colors: _Colors, glow: _Array | None = None,
    coding: tuple[_Array, _Array] | None = None,
) -> None: ...  # fmt: skip
def shade_add(glow: _Array, alpha: _Array, colors: _Colors) -> None: ...
def whiten(light: _Array) -> None: ...
def encode_bytes(out: _Array, values: _Array, light: _Array, edges: _Array) -> None: ...
def veil(
    out: _Array, way: _Array, extinction: float, patches: tuple[_Array, float, float] | None
) -> None: ...
def extinction(ways: _Float64, lost: float) -> float: ...
def tile_count(length: int, tile: int, overlap: int) -> int: ...
def smooth(values: _Float64) -> None: ...
def box_means(
    out: _Float64, boxes: _Float64, alpha: _Array, veil: _Array, limits: _Pair
) -> None: ...
def uniform(out: _Float64, seed: int, stream: int) -> None: ...
def wind_waves(out: _Float64, points: _Float64, k: _Float64, weights: _Float64) -> None: ...
def particle_positions(
    out: _Float64, sides: _Vector, center: _Vector, seed: int, velocity: _Float64, time: float,
    sway: _Pair | None,
) -> None: ...  # fmt: skip

@final
class SortedFlakes:
    """Flakes of a frame, projected and sorted."""

@final
class FlakeSheet:
    def __new__(
        cls, seed: int, period: tuple[int, int], shear: int, count: float, diameters: list[float],
        streak: _Pair, circle: float, opacity: float, ranks: _Pair, thin: float = 1.0,
    ) -> FlakeSheet: ...  # fmt: skip
    @property
    def bytes(self) -> int: ...
    @property
    def mean(self) -> float: ...
    def factor(self, wanted: float, strong: _Pair) -> float: ...

def sheet_bent(
    out: _Array, corner: tuple[int, int],
    groups: Sequence[tuple[Sequence[tuple[FlakeSheet, _Array]], _Array, float, float]],
    depth: _Array | None,
) -> None: ...  # fmt: skip
def sheet_read(
    out: _Array, origin: tuple[int, int],
    sheets: Sequence[tuple[FlakeSheet, _Pair, _Pair, _Pair, float, float]], depth: _Array | None,
    opacity: bool, drawn: tuple[_Array, float] | None = None, veil: _Array | None = None,
    haze: float = 0.0, gains: tuple[_Array, Sequence[int], tuple[int, int]] | None = None,
) -> None: ...  # fmt: skip

@final
class BallImages:
    def __new__(cls, opacity: float) -> BallImages: ...

def fall(request: Air) -> SortedFlakes: ...
def flake_rows(flakes: SortedFlakes) -> tuple[npt.NDArray[np.uint64], _Float64, _Float64]: ...
def to_half(out: npt.NDArray[np.uint16], values: npt.NDArray[np.float32]) -> None: ...
def particle_draw_lit(
    out: _Array, glow: _Array, flakes: SortedFlakes, window: _Window, lamps: _Float64,
    optics: _Pair, depth: _Array | None = None, behind: tuple[_Array, _Colors] | None = None,
) -> None: ...  # fmt: skip
def lamp_light(
    out: _Float64, points: _Float64, lamps: _Float64, optics: _Pair, eye: _Vector
) -> None: ...
def particle_draw(
    out: _Array, flakes: SortedFlakes, window: _Window, depth: _Array | None = None,
    numbers: _Array | None = None,
) -> None: ...  # fmt: skip
def particle_sway_offsets(out: _Float64, seed: int, time: float, sway: _Pair) -> None: ...
def particle_edge_fade(
    out: _Float64, points: _Float64, sides: _Vector, center: _Vector
) -> None: ...
def particle_ids(out: _Int32, flakes: _Listed, lens: _Lens, depth: _Array | None) -> None: ...
def particle_splat(out: _Array, flakes: _Listed, lens: _Lens, depth: _Array | None) -> None: ...
def cone_rays(out: _Float64, places: _Float64, pose: Pose) -> None: ...
def cone_layer(
    out: _Array, texture: _Float64, pose: Pose, sheet: tuple[int, float, float, _Pair, float]
) -> None: ...
def cone_chart(
    across: _Array, along: _Array, fade: _Array, state: _Array, pose: Pose, course: _Course
) -> None: ...
def cone_footprints(out: _Array, pose: Pose, course: _Course) -> None: ...
def cone_shown(out: _Array, depth: _Array, pose: Pose, radii: list[float], top: int) -> None: ...
def cone_table(
    out: _Array, texture: _Float64, width: float, height: float, peak: float
) -> None: ...
def cone_needed(out: _Array, footprint: _Array, sheets: list[_Sheet]) -> None: ...
def cone_stack(
    out: _Array, chart: tuple[_Array, _Array, _Array, _Array, _Array | None] | None,
    view: tuple[Pose, _Course] | None, footprint: _Array, sheets: list[_Sheet], levels: int,
    tables: list[tuple[int, int, _Array]],
) -> None: ...  # fmt: skip
def cone_tile(out: _Array, drops: _Float64) -> None: ...

@final
class SortedGas:
    """A gas as one eye sees it, projected and sorted."""

def gas_sort(
    shape: tuple[int, int], gas: Gas, colors: _Float64, lens: _Sight, manner: _Manner
) -> SortedGas: ...
def gas_draw(out: _Array, gas: SortedGas, window: _Window, depth: _Array | None = None) -> None: ...
def gas_slices(out: _Array, groups: list[_Bank]) -> None: ...
def gas_glow(
    light: _Array | None,
    far: _Array | None,
    opacity: _Array,
    bank: _Bank,
    grid: tuple[_Array, _Array],
    places: Sequence[float],
    lamps: _Float64,
    optics: _Pair,
    eye: _Vector,
) -> None: ...
def gas_light(out: _Float64, gas: Gas, direction: _Vector, forward: float) -> None: ...
