from typing import Any

import numpy as np
import numpy.typing as npt

_Float64 = npt.NDArray[np.float64]

class InternalError(RuntimeError): ...

def set_threads(n: int) -> None: ...
def threads() -> int: ...
def panic_for_test() -> None: ...
def particle_positions(
    out: _Float64,
    sides: tuple[float, float, float],
    center: tuple[float, float, float],
    seed: int,
    velocity: _Float64,
    time: float,
    sway: tuple[float, float] | None,
) -> None: ...
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
