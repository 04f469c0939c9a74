"""Every public function of arrays, with arguments that it takes: for tests of all of them alike."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import flurries as fl

RNG = np.random.default_rng(12)
LENS = fl.Camera(40.0)
SHAPE = (24, 30)
COUNT = 7


@dataclass(frozen=True)
class Call:
    """A function and arguments that it takes.

    Attributes
    ----------
    function : callable
    arrays : dict of str to array
        What may come in any layout and dtype.
    rest : dict of str to object
        The other arguments.
    pixels : tuple of str
        Arrays whose integers are levels of a picture, not numbers.
    """

    function: Callable[..., Any]
    arrays: dict[str, np.ndarray]
    rest: dict[str, Any] = field(default_factory=dict)
    pixels: tuple[str, ...] = ()

    def __call__(self, **changed: Any) -> list[np.ndarray]:
        """Return all arrays of the result."""
        return list(arrays_in(self.function(**{**self.arrays, **self.rest, **changed})))


def arrays_in(result: Any) -> Iterator[np.ndarray]:
    if isinstance(result, fl.cone.Texture):
        yield result.tile
    elif isinstance(result, fl.cone.Mapping):
        yield fl.cone.layers(SHAPE, LENS, TILE, axis=(0.0, 1.0, 0.0), phase=0.0, mapping=result)
    elif dataclasses.is_dataclass(result):
        for part in dataclasses.fields(result):
            yield from arrays_in(getattr(result, part.name))
    elif isinstance(result, (tuple, list)):
        for one in result:
            yield from arrays_in(one)
    elif not isinstance(result, (str, bool)):
        yield np.asarray(result)


def _vector(*values: float) -> np.ndarray:
    return np.array(values, np.float64)


TILE = np.asarray(fl.cone.snow_tile(16, seed=1, dtype=np.float64))
POINTS = RNG.random((COUNT, 3)) * (4.0, 3.0, 4.0) + (-2.0, -1.5, 1.0)
FAR = POINTS + np.array([0.0, 0.0, 4.0])
RADIUS = 1.0 + RNG.random(COUNT)
PICTURE = RNG.random((*SHAPE, 3))
COVER = RNG.random(SHAPE)
DEPTH = 1.0 + 4.0 * RNG.random(SHAPE)
MOVING: dict[str, np.ndarray] = {
    "drift": _vector(3.0, 9.0), "shift": _vector(1.0, 0.0), "velocity": _vector(1.0, 4.0),
    "shift_rate": _vector(0.0, 1.0), "shortest": np.full((1, 1), 4.0),
    "ring_edges": _vector(4.0, 8.0, 16.0), "ring_gains": _vector(1.0, 0.5),
}  # fmt: skip
PATTERNS = fl.spectral.flake_patterns(
    16, counts=[4, 9], diameters=[[1, 2], [1, 3]], patterns=2, shear=0.382, seed=1
)
FLAKES: dict[str, np.ndarray] = {
    "points": POINTS, "radius": RADIUS, "opacity": RNG.random(COUNT),
    "velocity": RNG.random((COUNT, 3)), "depth": DEPTH,
}  # fmt: skip
GAS: dict[str, np.ndarray] = {
    "centers": POINTS, "radius": RADIUS, "density": RNG.random(COUNT), "depth": DEPTH,
}  # fmt: skip
AIR = fl.hybrid.Population(density=0.02, radius=(0.01, 0.02), depth=(1.0, 12.0))
SNOW = fl.hybrid.Population(density=110, radius=(0.006, 0.014), depth=(1.5, 24.0))
TEXTURE: dict[str, Any] = {"shape": SHAPE, "seed": 1, "tile": 32, "wavelengths": (4.0, 16.0)}
SIGHT: dict[str, Any] = {"shape": SHAPE, "camera": LENS}

CALLS: dict[str, Call] = {
    "spectral.advance_phase": Call(
        fl.spectral.advance_phase,
        {"phase": fl.spectral.random_phase((16, 16), seed=1), "drift": _vector(3.0, 9.0),
         "shift": _vector(1.0, 0.0)},
    ),
    "spectral.alpha": Call(fl.spectral.alpha, MOVING, {**TEXTURE, "shutter": 0.5}),
    "spectral.field": Call(fl.spectral.field, MOVING, {**TEXTURE, "shutter": 0.5}),
    "spectral.blend_tiles": Call(
        fl.spectral.blend_tiles, {"tiles": RNG.random((2, 2, 16, 16))},
        {"shape": (30, 29), "overlap": 2},
    ),
    "spectral.inverse_transform": Call(
        fl.spectral.inverse_transform,
        {"amplitude": RNG.random((12, 10)), "phase": RNG.random((12, 10))},
    ),
    "spectral.loop": Call(
        fl.spectral.loop, {"velocity": _vector(1.0, 4.0), "time": _vector(0.0, 1.5, 7.0)},
        {"frames": 16, "shape": SHAPE, "seed": 1, "wavelengths": (4.0, 12.0)},
    ),
    "spectral.flake_patterns": Call(
        fl.spectral.flake_patterns,
        {"counts": np.array([4.0, 9.0]), "diameters": np.array([[1.0, 2.0], [1.0, 3.0]])},
        {"tile": 16, "seed": 1, "patterns": 2, "shear": 0.382},
    ),
    "spectral.optical_depth": Call(
        fl.spectral.optical_depth,
        {"drift": np.ones((2, 2)), "velocity": np.ones((2, 2)), "gain": np.ones(2)},
        {"patterns": PATTERNS, "shape": (30, 29), "shutter": 0.5, "seed": 1, "overlap": 5,
         "shear": 0.382},
    ),
    "spectral.opacity": Call(fl.spectral.opacity, {"field": 4.0 * COVER - 2.0}),
    "spectral.temporal_filter": Call(
        fl.spectral.temporal_filter,
        {"amplitude": RNG.random((16, 16)), "velocity": _vector(1.0, 4.0),
         "shift_rate": _vector(0.0, 1.0)},
        {"shutter": 0.5},
    ),
    "spectral.tent_rate": Call(
        fl.spectral.tent_rate, {"velocity": _vector(1.0, 4.0)}, {"shape": (16, 16)}
    ),
    "spectral.volume": Call(
        fl.spectral.volume, {"velocity": _vector(1.0, 2.0)},
        {"frames": 16, "size": 16, "seed": 1, "wavelengths": (4.0, 8.0)},
    ),
    "particles.edge_fade": Call(
        fl.particles.edge_fade,
        {"points": POINTS, "box": _vector(9.0, 9.0, 12.0), "center": _vector(0.0, 0.0, 3.0)},
    ),
    "particles.ids": Call(fl.particles.ids, FLAKES, {**SIGHT, "shutter": 0.5}),
    "particles.splat": Call(fl.particles.splat, FLAKES, {**SIGHT, "shutter": 0.5}),
    "particles.positions": Call(
        fl.particles.positions,
        {"box": _vector(4.0, 3.0, 6.0), "velocity": _vector(1.0, 2.0, 0.0),
         "center": _vector(0.0, 0.0, 3.0)},
        {"count": COUNT, "seed": 1, "time": 3.5},
    ),
    "gas.alpha": Call(fl.gas.alpha, GAS, SIGHT),
    "gas.splat": Call(fl.gas.splat, {**GAS, "color": RNG.random((COUNT, 3))}, SIGHT),
    "gas.light": Call(
        fl.gas.light,
        {"centers": POINTS, "radius": RADIUS, "density": RNG.random(COUNT),
         "direction": _vector(1.0, 2.0, 0.0)},
    ),
    "gas.parallax_error": Call(
        fl.gas.parallax_error, {"centers": FAR, "radius": 0.1 * RADIUS},
        {"eye_distance": 0.1},
    ),
    "gas.projection_error": Call(
        fl.gas.projection_error, {"centers": FAR, "radius": 0.1 * RADIUS},
    ),
    "gas.particles_of": Call(
        fl.gas.particles_of, {"volume": RNG.random((3, 4, 5)), "center": _vector(0.0, 1.0, 3.0)},
        {"spacing": 0.5},
    ),
    "gas.phase": Call(fl.gas.phase, {"cosine": 2.0 * RNG.random(5) - 1.0}),
    "cone.Mapping": Call(
        fl.cone.Mapping, {"axis": _vector(0.0, 1.0, 0.0), "depth": DEPTH}, {**SIGHT, "radius": 3.0},
    ),
    "cone.Texture": Call(fl.cone.Texture, {"tile": TILE}),
    "cone.elongation": Call(fl.cone.elongation, {"speed": _vector(1.0, 4.0)}),
    "cone.frame": Call(fl.cone.frame, {"axis": _vector(1.0, 2.0, 0.0)}),
    "cone.layer": Call(
        fl.cone.layer, {"tile": TILE, "axis": _vector(1.0, 2.0, 0.0)}, {**SIGHT, "phase": 0.3}
    ),
    "cone.layers": Call(
        fl.cone.layers,
        {"tile": TILE, "axis": _vector(1.0, 2.0, 0.0), "offsets": RNG.random((4, 2)),
         "gains": RNG.random(4)},
        {**SIGHT, "phase": 0.3},
    ),
    "cone.path": Call(
        fl.cone.path,
        {"times": _vector(0.0, 1.0, 3.0), "drop": np.array([[0.0, 8.0, 0.0]] * 3),
         "camera": np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [1.0, 0.0, 2.0]])},
    ),
    "cone.rays": Call(
        fl.cone.rays, {"axis": _vector(1.0, 2.0, 0.0), "points_px": 20.0 * RNG.random((5, 2))},
        SIGHT,
    ),
    "cone.scroll": Call(
        fl.cone.scroll,
        {"speed": _vector(1.0, 4.0), "dt": _vector(1.0, 2.0), "stretch": _vector(1.0, 2.0)},
    ),
    "cone.tile_of": Call(
        fl.cone.tile_of, {"picture": RNG.random((16, 16))}, pixels=("picture",)
    ),
    "cone.travel": Call(
        fl.cone.travel,
        {"drop": _vector(0.0, 8.0, 0.0), "camera": _vector(0.0, 0.0, 2.0), "dt": _vector(1.0)[0]},
    ),
    "composite.join": Call(
        lambda layers, matte: fl.composite.join(
            list(layers) if np.ndim(layers) else layers, matte=matte, haze=0.1
        ),
        {"layers": RNG.random((2, *SHAPE)), "matte": COVER},
    ),
    "composite.over": Call(
        fl.composite.over,
        {"background": PICTURE, "layer": np.dstack([0.5 * PICTURE, COVER])}, pixels=("background",),
    ),
    "composite.snow": Call(
        fl.composite.snow, {"background": PICTURE, "alpha": COVER}, pixels=("background",)
    ),
    **{
        f"stereo.{name}": Call(
            getattr(fl.stereo, name), {"left": PICTURE, "right": PICTURE[:, ::-1].copy()},
            pixels=("left", "right"),
        )
        for name in ("anaglyph", "over_under", "side_by_side")
    },
    "camera.image_velocity": Call(
        fl.camera.image_velocity,
        {"points_px": 20.0 * RNG.random((5, 2)), "depth": 1.0 + RNG.random(5),
         "velocity": _vector(1.0, 2.0, 0.0), "rotation": _vector(0.0, 1.0, 0.0)},
        SIGHT,
    ),
    "camera.project": Call(fl.camera.project, {"points": POINTS}, SIGHT),
    "camera.tile_drift": Call(
        fl.camera.tile_drift, {"displacement": _vector(1.0, 2.0, 0.0)},
        {**SIGHT, "near_depth": 1.0, "tile": 16},
    ),
    "camera.tile_shift": Call(
        fl.camera.tile_shift, {"rotation": _vector(0.0, 1.0, 0.0)}, {**SIGHT, "tile": 16}
    ),
    "hybrid.simulate": Call(
        fl.hybrid.simulate,
        {"displacement": _vector(1.0, 2.0, 0.0), "velocity": _vector(0.0, 1.0, 0.0),
         "depth": DEPTH},
        {**SIGHT, "population": AIR, "seed": 1},
    ),
    "hybrid.statistics": Call(
        fl.hybrid.statistics, {"edges": _vector(2.0, 4.0, 8.0)},
        {"population": AIR, "focal": 40.0},
    ),
}  # fmt: skip

# Numbers only: nothing of theirs has a layout.
NUMBERS: dict[str, Call] = {
    "spectral.band_amplitude": Call(
        fl.spectral.band_amplitude, {}, {"shape": (16, 16), "wavelengths": (4.0, 16.0)}
    ),
    "spectral.random_phase": Call(fl.spectral.random_phase, {}, {"shape": (16, 16), "seed": 1}),
    "spectral.tile_starts": Call(
        fl.spectral.tile_starts, {}, {"length": 99, "tile": 16, "overlap": 3}
    ),
    "spectral.velocity_from_paper": Call(
        fl.spectral.velocity_from_paper, {}, {"C": 2.0, "theta": 0.3, "period": 64.0}
    ),
    "particles.sway_offsets": Call(
        fl.particles.sway_offsets, {}, {"count": 5, "seed": 1, "time": 2.5, "sway": (0.1, 2.0)}
    ),
    "gas.count_for_visibility": Call(
        fl.gas.count_for_visibility, {},
        {"distance": 9.0, "volume": 300.0, "radius": 0.5, "density": 0.3},
    ),
    "gas.density_for_visibility": Call(
        fl.gas.density_for_visibility, {},
        {"distance": 30.0, "count": 300, "volume": 300.0, "radius": 0.5},
    ),
    "gas.extinction": Call(
        fl.gas.extinction, {}, {"count": 300, "volume": 300.0, "radius": 0.5, "density": 0.3}
    ),
    "gas.footprint_table": Call(fl.gas.footprint_table, {}, {"size": 9}),
    "gas.visibility": Call(fl.gas.visibility, {}, {"beta": 0.3}),
    "cone.rain_tile": Call(fl.cone.rain_tile, {}, {"size": 16, "seed": 1}),
    "cone.sleet_tile": Call(fl.cone.sleet_tile, {}, {"size": 16, "seed": 1}),
    "cone.snow_tile": Call(fl.cone.snow_tile, {}, {"size": 16, "seed": 1}),
    "stereo.eyes": Call(
        lambda **words: [eye.offset for eye in fl.stereo.eyes(LENS, **words)], {},
        {"distance": 0.1, "convergence": 2.0},
    ),
    "camera.tile_zoom": Call(
        fl.camera.tile_zoom, {}, {**SIGHT, "growth": 0.1, "tile": 16}
    ),
    "camera.Camera": Call(
        fl.Camera, {},
        {"focal": 40.0, "center": (3.0, 4.0), "offset": (0.0, 0.0, 1.0), "aspect": 1.0},
    ),
    "hybrid.Population": Call(
        fl.hybrid.Population, {}, {"density": 0.02, "radius": (0.01, 0.02), "depth": (1.0, 12.0)}
    ),
    "hybrid.match": Call(
        fl.hybrid.match, {}, {"population": SNOW, "focal": 1229.0}
    ),
}  # fmt: skip

# Results, and what other tests send bad arguments to: files, whole scenes, timers.
ELSEWHERE = {
    "spectral.BANDS", "spectral.export_loop", "cone.Path", "cone.Rays", "cone.State",
    "hybrid.Match", "hybrid.Octaves", "hybrid.render", "trace.Trace", "trace.count", "trace.stage",
    "trace.tracing",
}  # fmt: skip
MODULES = (
    "spectral",
    "particles",
    "gas",
    "cone",
    "composite",
    "stereo",
    "camera",
    "hybrid",
    "trace",
)
