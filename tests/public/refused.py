"""Values of the right type that are refused all the same, beside those of the calls."""

from typing import Any

import numpy as np

import flurries as fl
from public.arrays import PATTERNS as SPECTRA

NAN, INF = float("nan"), float("inf")
Keys = fl.Keys
SHARE = (-0.1, 1.1, Keys([(0, 0.5), (1, 1.1)]), Keys([(0, (1.0, 2.0))]))
POSITIVE = (0.0, -1.0)
VECTOR = ((1.0, 2.0), 1.0, (NAN, 0, 0), Keys([(0, 1.0)]), Keys([(0, (1.0, 2.0))]))
COLOR = (
    -0.1, 1.1, (0.5, 0.5), (0.0, 0.0, 2.0), (0.0, 0.0, NAN), [[1.0], [1.0, 2.0]], "white"
)  # fmt: skip
SIZES = ((0.0, 1.0), (0.02, 0.01), (0.1,), 0.1, (0.01, INF))
KEYED = Keys([(0, 1.0), (1, 2.0)])
COUNT = (-1, 100_000_001, 7.0, KEYED)
LEVELS = np.zeros((4, 5, 3), np.uint8)
LIGHT = np.zeros((4, 5, 3), np.float32)
IDS = np.ones((4, 5), np.int64)
METADATA = ({"a b": 1}, {"": 1}, {"x" * 61: 1}, {"a": None}, {"a": b"x"}, {1: "a"}, {"a": "x\0y"},
            {"DateTime": "yesterday"})  # fmt: skip
WEATHER: dict[str, tuple[Any, ...]] = {
    "amount": (-0.1, 1.1, NAN, "x", type(None), (0.5, 0.2), (0.1, 0.2, 0.3), [[0, 1]]),
    "severity": (0, 6, 1.5, (3, 2), INF, "3", (1, 2, 3)), "wind": (NAN, 1e9, (1, -1), "w"),
    "color": (-1.0, 2.0, (0.1, 0.2, 3.0), "white", (1, 2)), "ground": (3, "flat", type),
    "focal": (0.0, -1.0, INF, "f"), "white": (0.0, NAN), "seed": (1.5, "s", 2**63, True),
    "weather_seed": (1.5, 2**63),
}  # fmt: skip

TENT: dict[str, tuple[Any, ...]] = {
    "amount": SHARE, "fall": (Keys([(0, (1.0, 2.0))]),), "wind": VECTOR, "color": COLOR,
    "haze": SHARE, "shutter": (-0.1, 180.0, Keys([(0, 0.5), (1, -0.1)])), "texture": SHARE,
    "spread": POSITIVE, "power": POSITIVE, "near_depth": (*POSITIVE, KEYED),
    "depth_mode": ("Tile", "row"), "tile": (4, -1, 2**15 + 1, 16.0), "blend": ("smooth",),
    "overlap": (-1, 2**15 + 1, 3.0), "alias": ("Cut", "hard"), "jitter": (1, 0, KEYED),
    "look": ("v0",), "exponent": (KEYED,), "severity": (0, 6, 2.5), "rate": (0.0, NAN, "much"),
    "wavelengths": ((1.9, 4.0), (4.0, 4.0), (5.0, 4.0), (4.0,), 4.0, (2.0, INF), KEYED),
}  # fmt: skip
CONE: dict[str, tuple[Any, ...]] = {
    "amount": SHARE, "damping": (-0.1, 1.1), "radius": POSITIVE, "repeats": (0,), "slope": (-1.0,),
    "tile": (4,), "shutter": (-1.0, Keys([(0, 0.5), (9, -1.0)]), Keys([(0, (0.5, 0.5))])),
    "wind": ((0, 0),), "conserve": (1,), "look": ("v0",),
}  # fmt: skip

OUTSIDE: dict[str, dict[str, tuple[Any, ...]]] = {
    "effects.TentSnow": {
        **TENT, "flakes": COUNT, "flake_opacity": SHARE, "flake_size": SIZES,
        "flake_density": (-0.1, 1e7, "many"), "sway": ((1.0,), 1.0, (NAN, 1.0)),
    },
    "effects.TentRain": {
        **TENT, "drops": COUNT, "drop_size": SIZES, "drop_depth": POSITIVE, "gain": (-1.0, 1e5),
        "renormalise": (1,),
    },
    "Snow": {
        "flake_size": ((0.01, 0.005, 0.02),), "density": (-1.0,), "method": ("drawn",),
        "emission": (1.5,), "look": ("v1",), "time": (NAN, 1e3, "slow"), "hide": ([-1],),
        "split": ((), (12.0, 3.0)), "place": ([(1.0, 2.0)], [(0, 0, 0, 1, 0.0)]), "wakes": ([3],),
        "where": (1.5, np.full((2, 2), 1.5), np.zeros((2, 3, 4))),
    },
    "Mist": {
        "amount": SHARE, "count": (-1, 10.0, 10**9), "visibility": (0.0, -3.0), "radius": (0.0,),
        "density": (2.0,), "color": (2.0, "blue"), "wind": ((1.0, 2.0),), "box": (0.0, (1.0, 2.0)),
        "center": ((1.0, 2.0),), "depths": ((3.0, 2.0), 3.0), "footprint": ("ball",), "lit": (1,),
        "forward": (-0.1,), "scatter": ("mie",), "asymmetry": (1.0,), "structure": (-0.1, 2.1),
        "falloff": (0.0,), "look": ("v0",), "backdrop": (0.0,), "top": (INF,),
    },
    "effects.ConeRain": {
        **CONE, "drops": (-1,), "drop_size": (0.0,), "drop_length": (3.0,), "spread": (-1.0, 2.0),
    },
    "effects.ConeSnow": {
        **CONE, "texture_flakes": (10**6,), "flakes": (-1,), "flake_size": ((0.02, 0.01),),
        "flake_opacity": (1.5,),
    },
    "Wind": {
        "mean": VECTOR, "gusts": (-1.0,), "swirl": (-0.1,), "scale": POSITIVE, "modes": (0, 1.5),
        "profile": ([(1.0, (1.0, 2.0))], [(-1.0, 1.0)], [(2, 1.0), (1, 1.0)], 3.0, []),
        "field": (np.zeros((3, 3)), np.full((2, 2, 2, 3), NAN), np.zeros((0, 2, 2, 3)),
                  np.ones((4, 5, 6, 7, 2))),
        "spacing": (0.0,), "duration": (-1.0,),
    },
    "Keys": {
        "keys": (
            [], 5, "ab", [(0,)], [(0, 1, 2)], [(0, 1), (0, 2)], [(1, 1), (0, 2)], [(NAN, 1)],
            [(INF, 1)], [("0", 1)], [(None, 1)], [(True, 1)], [(0, NAN)], [(0, 1), (1, INF)],
            [(0, "x")], [(0, None)], [(0, True)], [(0, 1j)], [(0, (1, NAN))], [(0, ())],
            [(0, [[1]])], [(0, 1), (1, (1, 2))], [(0, (1,)), (1, (1, 2))], {0: 1},
        ),
    },
    "CameraPath": {
        "camera": (300.0, None),
        "position": (1.0, (1.0, 2.0, 3.0), "x", np.zeros((0, 3)), np.zeros((4, 2)),
                     np.zeros((2, 2, 3)), [(0, 0, NAN)], Keys([(0, 1.0)]), [(0, 0, 0), (1, 2)]),
        "orientation": (np.zeros((4, 2)), np.zeros((0, 3)), (0.0, 0.1, 0.0), "x", {},
                        np.full((3, 4), 2.0), np.zeros((3, 4)), -np.stack([np.eye(3)] * 3),
                        np.stack([np.eye(3)] * 3) + 0.1, [(0.0, NAN, 0.0)],
                        Keys([(0, (0.0, 1.0))]), Keys([(0, 1.0)])),
        "focal": ([], [0.0], [1.0, NAN], "x", Keys([(0, (1.0, 2.0))])),
    },
    "CameraPath(velocity)": {
        "velocity": (*VECTOR, [[1, 2, 3]], [(1,), (1, 2), 3]), "position": ([(0, 0, 0)],)
    },
    "scene.DepthMap": {
        "near": (0.0, "1"), "far": (1.0, INF), "white": ("black",), "law": ("log",),
        "source": (3, np.ones((4, 4), int), np.zeros((4, 0), np.uint8), np.full((4, 4), 2.0),
                   np.full((4, 4), NAN), np.ones((4, 4, 3))),
    },
    "scene.Sun": {
        "direction": ((0.0, 0.0, 0.0), (1.0, 0.0), (1.0, NAN, 0.0)), "ambient": (1.5,),
        "color": (1.5, (0.5, -0.1, 0.5), "white"),
    },
    "scene.Light": {"snow": (-1.0, (1.0, 1.0), "white", Keys([(0, -1.0)])), "sky": (-1.0,)},
    "camera.Lens": {
        "focus": (0.0,), "f_stop": (-1.0,), "blades": (2,), "sensor": (0.0,),
    },
    "scene.Lamp": {
        "place": ((0, 0), (0, 0, NAN)), "power": (-1.0,), "color": ((-1, 0, 0),), "radius": (0.0,),
    },
    "spectral.flake_patterns": {
        "tile": (0, 32.0), "counts": ([-1.0] * 2, [], [1.0]),
        "diameters": ([[1.0, 2.0]], [[2.0, 1.0]] * 2, [[0.0, 1.0]] * 2, [[1.0, 1e6]] * 2),
        "opacity": (1.5,), "patterns": (0,), "dtype": (np.float32,),
    },
    "spectral.optical_depth": {
        "patterns": (SPECTRA[0], SPECTRA[..., :-1], np.full_like(SPECTRA, NAN),
                     np.full_like(SPECTRA, INF), "snow"),
        "drift": ([(0.0, 1.0)], np.zeros((4, 5, 2, 2)), np.full((2, 2), NAN)),
        "velocity": ([1.0, 2.0], None), "shutter": (-0.5,), "gain": ([1.0], [1.0, INF]),
        "shear": (2.0,), "overlap": (-1, 16, 1.5), "dtype": (np.float16,), "shape": ((0, 4),),
    },
    "augment.Fog.apply": {
        "image": (np.zeros((4, 4), np.int32), np.zeros((0, 4)), np.zeros(4), np.zeros((24, 30, 2)),
                  np.zeros((24, 30, 4))),
        "depth": (0.0, -1.0, "near", np.full((24, 30), -1.0), np.zeros((24, 30)),
                  np.full((24, 30), NAN), np.full((24, 30), 5), np.full((30, 24), 5.0),
                  np.full((24, 30, 1), 5.0), [[1.0, 2.0]], np.array(5.0)),
        "boxes": ([[1, 2, 3]], [[5, 5, 1, 9]], [[0, 0, NAN, 3]]),
        "flow": (np.zeros((24, 30)), np.zeros((24, 30, 2), int)),
    },
    **{f"augment.{kind}": WEATHER for kind in ("Snowfall", "Rainfall", "Fog")},
    "camera.tile_shift": {"rotation": ((0.0, 1.0), (0.0, NAN, 0.0), "x", None)},
    "Scene": {
        "size": ((0, 5), (5,), "5", "axb", (2.0, 3.0), (90, 71), (2**17 + 1, 4)),
        "background": ("#12", LEVELS[..., :2], LEVELS.astype(int), LEVELS[:0], None),
        "camera": (3.0, "x", object()), "effects": (["snow"], [None], [fl.effects.TentSnow], [1]),
        "fps": (0, -1.0, NAN, INF, "24", True), "seed": (2**63, 1.0, "1", None, True),
        "space": ("srgb", 1, None), "lights": ([3],), "lens": (2.8,),
        "depth": (0.0, -2.0, NAN, INF, True, {}, np.full((30, 24), 5.0), np.full((24, 30, 3), 5.0)),
        "foreground": (LIGHT[..., 0], np.full((24, 30), 2.0), np.full((24, 30), NAN), {}, 5),
        "loop": (1, 2.5),
    },
    "Scene.render": {
        "t": (NAN, "x", None, True),
        "region": (np.s_[0:0, :], np.s_[::2, :], np.s_[0, 0], 5, (slice(0, 1),), np.s_[200:300, :],
                   np.s_["a":, :]),
    },
    "effects.register": {"kind": ("snow", "My Ash"), "effect": (int, fl.Mist())},
    "augment.contrast_loss": {"amount": (-0.1, 1.1)},
    "augment.corrupt.corrupt": {
        "profile": ("easy",), "severity": ("2,", 0, "1-9", "many", [], 1.5), "seed": ("x",),
        "weather": ("hail", ["snow", "hail"]), "workers": (0, 1.5), "overwrite": ("yes",),
    },
    "spectral.export_loop": {
        "pattern": ("%d.jpg", "%d.hdr", "%d.mp4", "still.png"), "bits": (12,), "overwrite": (1,),
        "spread": (0.0,), "amount": (1.5,),
    },
    "Scene.write": {
        "damaged": ("ignore",), "layers": (True,), "overwrite": ("yes",),
        "frames": ([], "x", [1.5], [True], 1.5, "0-99999999", ["1"]),
    },
    "io.fit": {
        "pixels": (LEVELS.astype(int), LEVELS[..., :2], LEVELS[:0]), "how": ("fill",),
        "size": ((0, 2), (2, 2, 2), (2, 10**6), (2.0, 2)), "encoding": ("gamma",),
    },
    "io.write_picture": {
        "pixels": (LEVELS.astype(np.int32), LEVELS > 0, [[1, 2], [3, 4]], LEVELS[..., :2],
                   LEVELS[0, 0], LEVELS[:0], np.zeros((2, 2, 2, 2))),
        "alpha": (np.zeros((5, 4)), LEVELS[..., 0] > 0), "encoding": ("sRGB",), "bits": (12,),
        "quality": (101,), "compression": ("htj2k",), "metadata": METADATA,
    },
    "io.write_layers": {
        "layers": ({}, {"a": LIGHT, "b": LIGHT[:3]}, {"a": np.zeros((4, 5, 5), np.float32)},
                   {"a": LIGHT[:, :0]}, {"a": LEVELS}, {"a b": LIGHT}, {"": LIGHT}, {".a": LIGHT},
                   {"a..b": LIGHT}, {"id": -IDS}, {"id": np.full((4, 5), 2**63, np.uint64)},
                   {"id": np.dstack([IDS] * 2)}, {"id": IDS.astype(np.int32)}),
    },
}  # fmt: skip
