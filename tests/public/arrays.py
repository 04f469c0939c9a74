"""Calls of the array functions and their classes."""

from typing import Any

import numpy as np

import flurries as fl
from public import Call

RNG = np.random.default_rng(12)
LENS = fl.Camera(40.0)
SHAPE = (24, 30)
COUNT = 7
FEW = RNG.random(COUNT)
POINTS = RNG.random((COUNT, 3)) * (4.0, 3.0, 4.0) + (-2.0, -1.5, 1.0)
FAR = POINTS + np.array([0.0, 0.0, 4.0])
DOWN = np.array([0.0, 1.0, 0.0])
ASIDE = np.array([1.0, 2.0, 0.0])
PICTURE = RNG.random((*SHAPE, 3))
OTHER = PICTURE[:, ::-1].copy()
COVER = RNG.random(SHAPE)
DEPTH = 1.0 + 4.0 * RNG.random(SHAPE)
TILE = fl.cone.snow_tile(16, seed=1, dtype=np.float64)
PATTERNS = fl.spectral.flake_patterns(
    16, counts=[4, 9], diameters=[[1, 2], [1, 3]], patterns=2, shear=0.382, seed=1
)
NO_COVER = (COVER + 1.0, COVER - 1.0, COVER[:1])
NO_PICTURES = (np.zeros((*SHAPE, 2)), np.zeros(SHAPE, np.int64))
MATRICES = np.stack([np.eye(4)] * 3)
MATRICES[:, 0, 3] = (0.0, 1.0, 2.0)

SIGHT: dict[str, Any] = {"shape": SHAPE, "camera": LENS}
WAVES: dict[str, Any] = {
    "tile": 20, "overlap": 4, "wavelengths": (4.0, 16.0), "shutter": 0.5, "alias": "soft",
}  # fmt: skip
RINGS = {"ring_edges": np.array([4.0, 8.0, 16.0]), "ring_gains": np.array([1.0, 0.5])}
OWN = {"envelope": RNG.random((20, 20)), "rate": fl.spectral.tent_rate((20, 20), (1, 2))}
FRAME: dict[str, Any] = {
    "shape": SHAPE, "seed": 1, "drift": np.array([3.0, 9.0]), "shift": np.array([1.0, 0.0]),
    "velocity": np.array([1.0, 4.0]), "shift_rate": np.array([0.0, 1.0]),
    "shortest": np.full((2, 2), 5.0), "texture": fl.spectral.Texture(**WAVES, **RINGS),
}  # fmt: skip
FLAKES: dict[str, Any] = {
    **SIGHT, "points": POINTS, "radius": 1.0 + FEW, "opacity": FEW,
    "velocity": RNG.random((COUNT, 3)), "depth": DEPTH, "shutter": 0.5,
}  # fmt: skip
GAS: dict[str, Any] = {
    "centers": POINTS, "radius": 1.0 + FEW, "density": FEW,
}  # fmt: skip
# NaN hides nothing there.
HIDES: dict[str, Any] = {"takes": {"depth": ("NaN",)}}
PAIR: dict[str, Any] = {
    "pictures": ("left", "right"), "both": {"left": "right", "right": "left"}, "light": True,
}  # fmt: skip
# Neither two for all tiles, nor two a tile, nor two a ring.
NOT_MOTIONS = tuple(
    np.ones(s) for s in ((3,), (3, 2, 2), (2, 2, 3), (2, 1), (3, 1, 2), (2, 2, 1, 2), (3, 2))
)
MOTIONS: dict[str, tuple[Any, ...]] = {
    "drift": NOT_MOTIONS, "shift": NOT_MOTIONS, "velocity": (*NOT_MOTIONS, None),
    "shift_rate": NOT_MOTIONS, "shortest": (np.full((2, 3), 5.0), 5.0),
}  # fmt: skip
NO_AXIS: dict[str, tuple[Any, ...]] = {"axis": ((0, 0, 0), (0, 1)), "slope": (-1.0,)}
NO_TILE: dict[str, tuple[Any, ...]] = {
    "tile": (np.zeros((4, 5)), np.full((4, 4), 2.0), np.zeros(4)),
}  # fmt: skip
COSINE = {"cosine": 2.0 * RNG.random(5) - 1.0}
ROUND: dict[str, Any] = {
    "times": np.array([0.0, 1.0, 3.0]), "drop": np.array([[0.0, 8.0, 0.0]] * 3),
    "camera": np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [1.0, 0.0, 2.0]]),
}  # fmt: skip
NO_GAS: dict[str, tuple[Any, ...]] = {
    "centers": ([(0.0, 0.0)], np.full((COUNT, 3), 1e101)), "radius": (0.0, -1.0, [0.1]),
    "density": (1.01, [-0.1] * COUNT),
}  # fmt: skip
FLAT = (np.ones(16), np.ones((2, 2, 2)), np.ones((0, 4)))

CALLS: dict[str, Call] = {
    "spectral.tent_rate": Call(
        {"shape": (16, 16), "velocity": ASIDE[:2], "loop": 8}, refused={"loop": (0, 2.0)}
    ),
    "spectral.velocity_from_paper": Call({"C": 1.0, "theta": 0.5, "period": 64.0}),
    "spectral.band_amplitude": Call({"shape": (16, 16), "wavelengths": (3.0, 16.0)}),
    "spectral.random_phase": Call(
        {"shape": (16, 16), "seed": 1}, refused={"tile": ((0,), (0.5, 0), (2**63, 0))}
    ),
    "spectral.advance_phase": Call(
        {"phase": fl.spectral.random_phase((16, 16), seed=1), "drift": np.array([3.0, 9.0]),
         "shift": np.array([1.0, 0.0])}, refused={"phase": FLAT}, within=1e-4,
    ),
    "spectral.temporal_filter": Call(
        {"amplitude": RNG.random((16, 16)), "velocity": np.array([1.0, 4.0]),
         "shift_rate": np.array([0.0, 1.0]), "shutter": 0.5},
        refused={"amplitude": FLAT, "velocity": (np.ones((2, 2)),), "alias": ("Cut",)},
    ),
    "spectral.inverse_transform": Call(
        {"amplitude": RNG.random((12, 10)), "phase": RNG.random((12, 10))},
        refused={"amplitude": FLAT, "phase": (*FLAT, np.ones((12, 9)))}, within=1e-4,
    ),
    "spectral.tile_starts": Call(
        {"length": 99, "tile": 16, "overlap": 3},
        refused={"length": (0, -5), "overlap": (-1, 1.5, 16, 17)},
    ),
    "spectral.blend_tiles": Call(
        {"tiles": RNG.random((2, 2, 16, 16)), "shape": (30, 29), "overlap": 2}, keeps="tiles",
        refused={"tiles": (np.ones((16, 16)), np.ones((1, 2, 16, 16)), np.ones((2, 2, 0, 16))),
                 "overlap": (-1, 1.5, 16)},
    ),
    "spectral.field": Call(FRAME, refused=MOTIONS),
    # A drift for each ring of each tile.
    "spectral.alpha": Call({**FRAME, "drift": 9.0 * RNG.random((2, 2, 2, 2))}, refused=MOTIONS),
    "spectral.Texture": Call(
        {**WAVES, **RINGS}, then=lambda made: fl.spectral.field(**{**FRAME, "texture": made}),
        refused={"ring_edges": ((4.0, 8.0), (4.0, 4.0, 32.0), (8.0, 4.0, 32.0), (4.0,), None),
                 "ring_gains": ((1.0, 1.0, 1.0), (0.0, 0.0), (1.0, -1.0)),
                 "overlap": (-1, 1.5, 20, 21, np.int64(20))},
    ),
    # A spectrum and a motion of one's own.
    "spectral.Texture(own)": Call(
        {**WAVES, **OWN}, of=fl.spectral.Texture, unused=("exponent",),
        then=lambda made: fl.spectral.field(**{**FRAME, "texture": made, "time": 2.5}),
    ),
    "spectral.alpha(own)": Call(
        {**FRAME, "texture": fl.spectral.Texture(**WAVES, **OWN), "time": 2.5},
        of=fl.spectral.alpha, refused={**MOTIONS, "preserve_mean": (True,)},
    ),
    "spectral.opacity": Call(
        {"field": 4.0 * COVER - 2.0}, keeps="field",
        refused={"field": (np.ones(16), np.ones((0, 4)))}, takes={"field": ("NaN",)}
    ),
    "spectral.flake_patterns": Call(
        {"tile": 16, "counts": np.array([4.0, 9.0]),
         "diameters": np.array([[1.0, 2.0], [1.0, 3.0]]),
         "shear": 0.382, "seed": 1, "patterns": 2}
    ),
    "spectral.optical_depth": Call(
        {"shape": SHAPE, "patterns": PATTERNS, "drift": np.array([[3.0, 9.0], [1.0, 5.0]]),
         "velocity": np.array([[1.0, 2.0], [0.0, 1.0]]), "shutter": 0.5,
         "gain": np.array([1.0, 2.0]), "shear": 0.382, "seed": 3, "overlap": 5},
    ),
    "spectral.volume": Call(
        {"frames": 16, "size": 16, "velocity": np.array([1.0, 2.0]), "seed": 1,
         "wavelengths": (4.0, 8.0)},
        refused={"frames": (0, 2**31 - 1), "size": ((64, 64),), "velocity": (3.0,),
                 "cells": ("all",)},
    ),
    "spectral.cloud": Call(
        {"tile": (16, 20), "velocity": ASIDE[:2], "seed": 1, "frequency": 0.11,
         "orientation_bandwidth": 0.5, "speed_bandwidth": 0.2, "loop": 16},
        then=lambda made: fl.spectral.movie(3, (16, 20), seed=2, texture=made),
        refused={"frequency": (0.0, 0.6), "frequency_bandwidth": (0.0, 1e-3), "loop": (0,)},
    ),
    "spectral.movie": Call(
        {"frames": 3, "shape": SHAPE, "seed": 1, "velocity": np.array([1.0, 4.0]),
         "contrast": 0.3},
        refused={"velocity": NOT_MOTIONS, "contrast": (-0.1,), "frames": (0, 2**31 - 1)},
    ),
    "spectral.loop": Call(
        {"frames": 16, "shape": SHAPE, "velocity": np.array([1.0, 4.0]), "seed": 1,
         "time": np.array([0.0, 1.5, 7.0]), "wavelengths": (4.0, 12.0)},
        refused={"time": ([[1.0]], []), "soft_from": (0.5, -0.1)},
    ),
    "Camera": Call(
        {"focal": 40.0, "center": (3.0, 4.0), "offset": (0.0, 0.0, 1.0)},
        refused={
            "focal": (0.0, -1.0), "center": ((1.0,), (0.0, np.nan)), "rotation": (np.eye(3), 0.1),
            "offset": ((1.0, 2.0), (0.0, 0.0, np.inf)),
            "center_shift": ((1, 2, 3), (0.0, -np.inf)),
        },
    ),
    "camera.project": Call(
        {**SIGHT, "points": POINTS}, takes={"points": ("empty",)},
    ),
    "camera.image_velocity": Call(
        {**SIGHT, "points_px": 20.0 * RNG.random((5, 2)), "depth": 1.0 + RNG.random(5),
         "velocity": ASIDE, "rotation": DOWN},
        refused={"points_px": ([(1, 2, 3)], [1, 2]), "velocity": ((0, 0), [[0, 0, 1]] * 2),
                 "depth": (np.zeros(5), np.full(5, -1.0), np.full(5, np.inf), np.ones(4))},
    ),
    "camera.tile_drift": Call(
        {**SIGHT, "displacement": ASIDE, "near_depth": 5.0, "tile": 16},
        refused={"displacement": (1e300 * DOWN, (0.0, 1.0)), "near_depth": (0.0, -1.0),
                 "overlap": (-1, 0.5, 16)},
    ),
    "camera.tile_shift": Call({**SIGHT, "rotation": DOWN, "tile": 16}),
    "particles.positions": Call(
        {"count": COUNT, "box": np.array([4.0, 3.0, 6.0]), "seed": 1, "velocity": ASIDE,
         "time": 3.5, "center": 3.0 * DOWN, "sway": (0.1, 2.0)},
        refused={"box": (0.0, (1.0, -1.0, 1.0), (1.0, 1.0)), "count": (-1, 2**63),
                 "velocity": (np.zeros((4, 3)),), "sway": ((1.0, 1e308),)},
    ),
    "particles.sway_offsets": Call({"count": 5, "seed": 1, "time": 2.5, "sway": (0.1, 2.0)}),
    "particles.edge_fade": Call(
        {"points": POINTS, "box": np.array([9.0, 9.0, 12.0]), "center": 3.0 * DOWN},
        takes={"points": ("empty",)}, refused={"points": ([(0.0, 1.0)],), "box": (-2.0,)},
    ),
    "particles.splat": Call(
        FLAKES, refused={"velocity": (np.zeros((3, 3)),), "opacity": (1.5, -1e-9),
                         "radius": (-0.1, [0.1] * 3)}, **HIDES,
    ),
    "particles.ids": Call(FLAKES, within=0.0, **HIDES),
    "gas.splat": Call(
        {**SIGHT, **GAS, "color": RNG.random((COUNT, 3)), "depth": DEPTH},
        refused={**NO_GAS, "color": (np.ones(4), np.inf), "depth": (DEPTH.T,),
                 "error": (-1e-3, 1.0), "camera": (fl.Camera(120.0, aspect=1.3),)},
    ),
    "gas.alpha": Call({**SIGHT, **GAS, "depth": DEPTH}, refused=NO_GAS),
    "gas.light": Call(
        {**GAS, "direction": ASIDE},
        refused={**NO_GAS, "direction": ((0, 0, 0), (1, 2)), "forward": (1.5,)},
    ),
    "gas.phase": Call(
        COSINE, unused=("asymmetry",), takes={"cosine": ("empty", "too deep")}
    ),
    "gas.phase(henyey)": Call(
        {**COSINE, "kind": "henyey"}, of=fl.gas.phase, takes={"cosine": ("empty", "too deep")}
    ),
    "gas.footprint_table": Call(
        {"size": 9, "intervals": 20}, refused={"size": (0, 10**9), "intervals": (0,)}
    ),
    "gas.projection_error": Call(
        {"centers": FAR, "radius": 0.1 + 0.1 * FEW}, within=1e-3,
        refused={"centers": ([(1.0, 2.0)],), "radius": (0.0, [1.0, 2.0])},
    ),
    "gas.parallax_error": Call(
        {"centers": FAR, "radius": 0.1 + 0.1 * FEW, "eye_distance": 0.1},
        within=1e-3, refused={"eye_distance": (0.0,), "radius": (0.0, [1.0, 2.0])},
    ),
    "gas.extinction": Call({"count": 300.0, "volume": 300.0, "radius": 0.5, "density": 0.3}),
    "gas.visibility": Call({"beta": 0.3}, refused={"contrast": (0.0, 1.0, -1.0)}),
    "cone.rain_tile": Call(
        {"size": 16, "seed": 1},
        refused={"spread": (-1.0,), "size": (3,), "drops": (-1,), "length": (0.6,)},
        heavy=("drops",),
    ),
    "cone.snow_tile": Call(
        {"size": 16, "seed": 1},
        refused={"spread": (-1.0,), "width": (0.0,), "opacity": (1.1,)},
        heavy=("flakes",),
    ),
    "cone.Texture": Call({"tile": TILE}, refused=NO_TILE, then=lambda made: made.tile),
    "cone.rays": Call(
        {**SIGHT, "axis": ASIDE, "points_px": 20.0 * RNG.random((5, 2))},
        takes={"points_px": ("empty",)},
        refused={**NO_AXIS, "radius": (0.0,), "points_px": ([1.0, 2.0], [[1.0, 2.0, 3.0]])},
    ),
    "cone.layer": Call(
        {**SIGHT, "tile": TILE, "axis": ASIDE, "phase": 0.3},
        refused={**NO_AXIS, **NO_TILE, "stretch": (0.0,), "repeats": (0,), "gain": (-1.0,),
                 "offset": ((0, 0, 0),)},
    ),
    "cone.layers": Call(
        {**SIGHT, "tile": TILE, "axis": ASIDE, "gains": FEW[:4], "phase": 0.3, "depth": DEPTH,
         "radius": 3.0},
        refused={**NO_AXIS, **NO_TILE, "stretch": (0.0,), "repeats": (0,),
                 "gains": ((1.0, 2.0), -1.0), "depth": (np.ones((3, 3)),),
                 "radius": (0.0, np.inf), "rows": ((3, 99),)},
        **HIDES,
    ),
    "cone.path": Call(
        {**ROUND, "exposure": np.array([0.01, 0.02, 0.03])},
        refused={"times": ([], [0.0, -1.0, 2.0]), "drop": ((1, 2),), "camera": (np.zeros((2, 3)),),
                 "damping": (1.5,), "exposure": (-1.0, (0.1, -1.0, 0.1), (0.1, 0.1)),
                 "length": (0.0,), "radius": (0.0,), "repeats": (0,)},
    ),
    "composite.snow": Call(
        {"background": PICTURE, "alpha": COVER}, pictures=("background",), keeps="background",
        refused={"alpha": NO_COVER, "intensity": (-0.1, np.ones(4)), "background": NO_PICTURES},
    ),
    "composite.over": Call(
        {"background": PICTURE, "layer": np.dstack([0.5 * PICTURE, COVER])},
        pictures=("background",), keeps="background", light=True,
        refused={"layer": (PICTURE, np.full((*SHAPE, 4), 2.0), np.full((*SHAPE, 4), -1.0)),
                 "background": NO_PICTURES},
    ),
    "composite.join": Call(
        {"layers": [COVER], "haze": 0.25, "matte": COVER},
        refused={"layers": ([], [COVER, COVER[:1]], [COVER, COVER.astype(np.float32)],
                            [COVER + 1.0]),
                 "haze": (-0.1, 1.1), "matte": NO_COVER},
    ),
    "composite.join(layers)": Call(
        {"layers": RNG.random((2, *SHAPE))}, keeps="layers",
        of=lambda layers, out=None: fl.composite.join(
            list(layers) if isinstance(layers, np.ndarray) and layers.ndim else layers,
            haze=0.1, out=out),
    ),
    "stereo.eyes": Call(
        {"camera": LENS, "distance": 0.1, "convergence": 2.0},
        refused={"camera": (3.0,), "distance": (-0.1, "x"), "convergence": (0.0, -2.0, np.inf)},
    ),
    "stereo.anaglyph": Call({"left": PICTURE, "right": OTHER}, **PAIR),
    "stereo.side_by_side": Call({"left": PICTURE, "right": OTHER}, **PAIR),
    "stereo.over_under": Call({"left": PICTURE, "right": OTHER}, **PAIR),
    "set_threads": Call({"n": 2}, refused={"n": (0, -1, 257, 2**63, [2])}),
    "settings": Call({"threads": 2, "reproducible": False}, loose=True, refused={
        "threads": (0, -1, 257, 2**63), "reproducible": (1, 0, "yes", np.ones(2)),
    }),
}  # fmt: skip
