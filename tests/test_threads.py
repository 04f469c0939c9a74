"""The bits of every kernel that shares its work do not depend on the number of threads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flurries as fl

S = fl.spectral
RNG = np.random.default_rng(5)
LENS = fl.Camera(390.0)
# Large enough that threads get parts: rows of tiles, runs of flakes, strips of pixels.
SHAPE = (300, 257)
TABLES = S.band_amplitude(SHAPE), S.random_phase(SHAPE, seed=1)
TILES = RNG.standard_normal((7, 5, 64, 64))
MANY = fl.particles.positions(
    30_000, (4.0, 3.0, 3.9), center=(0, 0, 2.0), seed=1, velocity=(0.1, 0.2, 0.3), time=3.0,
    sway=(0.1, 0.2),
)  # fmt: skip
# Some of them huge.
FLAKES: dict[str, Any] = {
    "points": MANY, "radius": 0.004 + 0.4 * (np.arange(len(MANY)) % 997 == 0), "shutter": 0.5,
    "opacity": 0.4 * fl.particles.edge_fade(MANY, (4.0, 3.0, 3.9), center=(0, 0, 2.0)),
}  # fmt: skip
CLOUD: dict[str, Any] = {
    "centers": RNG.uniform((-1.5, -1.0, -0.5), (1.5, 1.0, 5.0), (300, 3)), "camera": LENS,
    "radius": RNG.uniform(0.05, 0.6, 300), "density": RNG.random(300),
    "depth": 1.0 + 4.0 * RNG.random(SHAPE),
}  # fmt: skip
COLORS = RNG.random((300, 3))
TILE = fl.cone.snow_tile(64, seed=1)
ROUND: dict[str, Any] = {"axis": (0.1, 0.9, 0.3), "phase": 0.3}
PICTURE = RNG.random((*SHAPE, 3))
COVER = RNG.random(SHAPE)
PATTERNS: dict[str, Any] = {
    "counts": [50, 9], "diameters": [[0.5, 2.0], [1.0, 3.0]], "shear": 0.382, "seed": 1,
}  # fmt: skip
WAVES = {np.float32: np.complex64, np.float64: np.complex128}

FIELDS: dict[str, dict[str, Any]] = {
    "plain": {"shape": SHAPE},
    "small tiles": {"shape": SHAPE, "tile": 31, "overlap": 16, "wavelengths": (3.0, 31.0)},
    "one tile": {"shape": (512, 512), "tile": 512, "overlap": 0},
    "filtered": {"shape": SHAPE, "velocity": (9.0, 14.0), "alias": "cut", "shutter": 1.0,
                 "jitter": True},
    "less than one tile": {"shape": (64, 64)},
}  # fmt: skip


def field(dtype: Any, **options: Any) -> Any:
    asked = {**options, "drift": (1.0, 7.0), "seed": 2, "dtype": dtype}
    return S.field(**asked), S.alpha(**asked)


# By the dtype that they make, where they ask for one.
KERNELS: dict[str, Callable[[Any], Any]] = {
    **{f"field, {name}": lambda dtype, o=options: field(dtype, **o)
       for name, options in FIELDS.items()},
    "inverse_transform": lambda dtype: S.inverse_transform(*TABLES, dtype=dtype),
    "volume": lambda dtype: S.volume(10, 64, (3.0, 9.0), seed=1, dtype=dtype),
    "steps": lambda dtype: (
        S.advance_phase(TABLES[1], (1.0, 2.0)), S.random_phase(SHAPE, seed=1),
        S.temporal_filter(TABLES[0], (9.0, 20.0), renormalise=True), S.band_amplitude(SHAPE),
        S.blend_tiles(TILES.astype(dtype), (388, 280)), S.opacity(TABLES[1].astype(dtype))),
    "particles": lambda dtype: [
        fl.particles.splat((270, 333), camera=fl.Camera(200.0), velocity=v, dtype=dtype, **FLAKES)
        for v in (None, (0.03, 0.05, -0.02))],
    "places": lambda dtype: (
        fl.particles.positions(30_000, 4.0, seed=1, velocity=(0.1, 0.2, 0.3), time=3.0),
        fl.particles.edge_fade(MANY, (4.0, 3.0, 3.9), center=(0, 0, 2.0))),
    "ids": lambda dtype: fl.particles.ids((270, 333), camera=fl.Camera(200.0), **FLAKES),
    **{f"gas, {model}": lambda dtype, m=model: (
        fl.gas.alpha(SHAPE, footprint=m, dtype=dtype, **CLOUD),
        fl.gas.splat(SHAPE, color=COLORS, footprint=m, dtype=dtype, **CLOUD))
       for model in ("viewplane", "viewplane_c", "viewpoint", "volume", "table")},
    "gas, smooth": lambda dtype: fl.gas.alpha(SHAPE, smooth=8.0, dtype=dtype, **CLOUD),
    "flake_patterns": lambda dtype: S.flake_patterns(33, **PATTERNS, dtype=WAVES[dtype]),
    "optical_depth": lambda dtype: S.optical_depth(
        SHAPE, S.flake_patterns(64, **PATTERNS), drift=[(3.0, -9.0)] * 2, shear=0.382, seed=5,
        velocity=[(1.0, 4.0)] * 2, shutter=0.5, overlap=9, dtype=dtype),
    "cone.layer": lambda dtype: fl.cone.layer(SHAPE, LENS, TILE, **ROUND, dtype=dtype),
    "cone.layers": lambda dtype: fl.cone.layers(SHAPE, LENS, TILE, **ROUND, dtype=dtype),
    "composite": lambda dtype: (
        fl.composite.snow(PICTURE.astype(dtype), COVER),
        fl.composite.over(PICTURE.astype(dtype), np.dstack([0.5 * PICTURE, COVER]))),
}  # fmt: skip


@pytest.mark.parametrize("name", KERNELS)
def test_bits_do_not_depend_on_the_number_of_threads(name: str, threads: Callable[[int], None]):
    made = set()
    for count in (1, 2, 3, 8):
        threads(count)
        arrays = [KERNELS[name](dtype) for dtype in (np.float32, np.float64)]
        flat = [a for part in arrays for a in (part if isinstance(part, (tuple, list)) else [part])]
        assert all(np.ptp(np.abs(a)) > 0.0 for a in flat), "nothing is drawn"
        made.add(b"".join(a.tobytes() for a in flat))
    assert len(made) == 1
