from typing import Any

import numpy as np
import numpy.typing as npt

from flurries.effects.peopled import Flurry
from flurries.spectral.frame import Request
from flurries.spectral.volume import Film

__all__ = [
    "InternalError",
    "advance_phase",
    "all_finite",
    "band_amplitude",
    "blend_tiles",
    "field",
    "inverse_transform",
    "join",
    "opacity",
    "over",
    "panic_for_test",
    "particle_edge_fade",
    "particle_flurry",
    "particle_positions",
    "particle_splat",
    "particle_sway_offsets",
    "random_phase",
    "set_threads",
    "snow",
    "snowfall",
    "temporal_filter",
    "tent_rate",
    "threads",
    "tile_starts",
    "uniform",
    "volume",
    "wind_waves",
]

_Array = npt.NDArray[Any]
_Float64 = npt.NDArray[np.float64]
_Map = tuple[float, float, float, float]

class InternalError(RuntimeError): ...

def set_threads(n: int) -> None: ...
def threads() -> int: ...
def panic_for_test() -> None: ...
def tent_rate(out: _Float64, drift: list[float], repeat: float | None = None) -> None: ...
def band_amplitude(out: _Float64, wavelengths: tuple[float, float], exponent: float) -> None: ...
def random_phase(out: _Float64, seed: int, tile: tuple[int, int]) -> None: ...
def advance_phase(
    out: _Float64, phase: _Float64, drift: list[float], shift: list[float]
) -> None: ...
def temporal_filter(
    out: _Float64,
    amplitude: _Float64,
    drift: list[float],
    shift: list[float],
    alias: str,
    soft_from: float,
    shutter: float,
    renormalise: bool,
) -> None: ...
def inverse_transform(out: _Array, amplitude: _Float64, phase: _Float64) -> None: ...
def tile_starts(length: int, tile: int, overlap: int) -> list[int]: ...
def blend_tiles(out: _Array, tiles: _Array, overlap: int, blend: str) -> None: ...
def opacity(out: _Array, field: _Array, map: _Map) -> None: ...
def field(
    out: _Array, request: Request, map: _Map | None = None, preserve_mean: bool = False
) -> int: ...
def snowfall(
    out: _Array,
    background: _Array,
    request: Request,
    map: _Map,
    preserve_mean: bool,
    haze: float,
    intensity: list[float],
    flakes: _Array | None = None,
) -> int: ...
def all_finite(values: _Array) -> bool: ...
def volume(out: _Array, film: Film, times: _Float64) -> int: ...
def snow(out: _Array, background: _Array, alpha: _Array, intensity: list[float]) -> None: ...
def over(out: _Array, background: _Array, layer: _Array) -> None: ...
def join(out: _Array, layers: list[_Array], haze: float, matte: _Array | None = None) -> None: ...
def uniform(out: _Float64, seed: int, stream: int) -> None: ...
def wind_waves(out: _Float64, points: _Float64, k: _Float64, weights: _Float64) -> None: ...
def particle_positions(
    out: _Float64,
    sides: tuple[float, float, float],
    center: tuple[float, float, float],
    seed: int,
    velocity: _Float64,
    time: float,
    sway: tuple[float, float] | None,
) -> None: ...
def particle_flurry(out: _Array, request: Flurry, depth: _Array | None = None) -> None: ...
def particle_sway_offsets(
    out: _Float64, seed: int, time: float, sway: tuple[float, float]
) -> None: ...
def particle_edge_fade(
    out: _Float64,
    points: _Float64,
    sides: tuple[float, float, float],
    center: tuple[float, float, float],
) -> None: ...
def particle_splat(
    out: npt.NDArray[Any],
    points: _Float64,
    radius: _Float64,
    opacity: _Float64,
    velocity: _Float64,
    shutter: float,
    lens: tuple[float, float, float, tuple[float, float, float], float],
    depth: npt.NDArray[Any] | None,
) -> None: ...
