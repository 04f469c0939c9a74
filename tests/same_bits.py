"""Hashes of kernels and scenes, whose bits are the same anywhere; `make hashes` takes them anew."""

import hashlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import flurries as fl
import textured
from flurries.effects import ConeRain, ConeSnow, TentRain, TentSnow

RNG = np.random.default_rng
# Large enough that threads get parts: rows of tiles, runs of flakes, strips of pixels.
SHAPE = (230, 257)
LENS = fl.Camera(310.0)
MOVING: dict[str, Any] = {
    "drift": (3.0, -9.0), "velocity": (1.0, 4.0), "shutter": 0.5, "alias": "soft", "seed": 5,
}  # fmt: skip

FLAKES: dict[str, Any] = {
    "counts": [30, 80], "diameters": [[1.5, 3.0], [0.6, 1.5]], "shear": 0.382, "seed": 1,
}  # fmt: skip


def points(count: int) -> np.ndarray:
    return RNG(1).random((count, 3)) * (4.0, 3.0, 6.0) + (-2.0, -1.5, 0.5)


def gas(dtype: Any, **options: Any) -> np.ndarray:
    radius = 0.05 + 0.4 * RNG(2).random(60)
    color = RNG(3).random((60, 3))
    return fl.gas.splat(
        SHAPE, points(60), radius, 0.5 + radius, color, LENS, dtype=dtype, **options
    )


def flakes(count: int) -> dict[str, Any]:
    return {
        "points": points(count), "radius": 0.004 + 0.4 * (np.arange(count) % 997 == 0),
        "camera": LENS, "opacity": 0.4, "velocity": 0.05 * RNG(9).random((count, 3)),
        "shutter": 0.5,
    }  # fmt: skip


def picture(dtype: Any) -> np.ndarray:
    numbers = RNG(4).random((*SHAPE, 3))
    return numbers.astype(dtype) if np.dtype(dtype).kind == "f" else (200 * numbers).astype(dtype)


def _kernels(dtype: Any) -> dict[str, Callable[[], Any]]:
    cover = RNG(5).random(SHAPE).astype(dtype)
    tile = fl.cone.snow_tile(64, seed=1)
    axis = (0.1, 0.9, 0.3)
    return {
        "alpha": lambda: textured.alpha((200, 150), preserve_mean=True, dtype=dtype, **MOVING),
        "alpha, power 1.7": lambda: textured.alpha(
            (70, 64), power=1.7, spread=0.4, dtype=dtype, **MOVING
        ),
        "alpha, small tiles": lambda: textured.alpha(
            (99, 97), tile=24, overlap=5, wavelengths=(2.0, 12.0), blend="linear", dtype=dtype,
            **MOVING,
        ),
        "field, prime tile": lambda: textured.field(
            (90, 70), tile=33, overlap=7, jitter=True, dtype=dtype, **MOVING
        ),
        "field, large tile": lambda: textured.field(
            (300, 280), tile=(256, 270), wavelengths=(2.0, 90.0), dtype=dtype, **MOVING
        ),
        "volume": lambda: fl.spectral.volume(32, 32, (1.0, 5.0), seed=1, dtype=dtype),
        "loop": lambda: fl.spectral.loop(
            9, (40, 44), (1.0, 5.0), seed=1, shutter=0.4, dtype=dtype
        ),
        "inverse_transform": lambda: fl.spectral.inverse_transform(
            RNG(6).random((45, 62)), RNG(7).random((45, 62)) - 0.5, dtype=dtype
        ),
        "opacity": lambda: fl.spectral.opacity(cover - 0.5, power=1.3, spread=0.2),
        "blend_tiles": lambda: fl.spectral.blend_tiles(
            RNG(8).random((2, 2, 32, 32)).astype(dtype), (54, 54), overlap=10
        ),
        "flake_patterns": lambda: fl.spectral.flake_patterns(
            33, **FLAKES, dtype=np.result_type(dtype, np.complex64)
        ),
        "optical_depth": lambda: fl.spectral.optical_depth(
            (90, 70), fl.spectral.flake_patterns(33, **FLAKES), drift=[(3.0, 9.0), (1.0, 4.0)],
            velocity=[(1.0, 4.0), (0.5, 2.0)], shutter=0.5, shear=0.382, seed=2, dtype=dtype,
        ),
        "particles.splat": lambda: fl.particles.splat(SHAPE, dtype=dtype, **flakes(20_000)),
        "gas.splat": lambda: gas(dtype),
        "gas.splat, by ray": lambda: gas(dtype, footprint="volume", edge="square"),
        "gas.splat, viewpoint": lambda: gas(dtype, footprint="viewpoint", error=0.01),
        "gas.splat, table": lambda: gas(dtype, footprint="table"),
        "cone.layer": lambda: fl.cone.layer(
            SHAPE, LENS, tile, axis=axis, phase=0.3, stretch=2.5, dtype=dtype
        ),
        "cone.layers": lambda: fl.cone.layers(
            SHAPE, LENS, tile, axis=axis, phase=0.3, stretch=2.5, dtype=dtype
        ),
        "cone.rain_tile": lambda: fl.cone.rain_tile(64, seed=2, dtype=dtype),
        "composite.snow": lambda: fl.composite.snow(picture(dtype), cover),
        "composite.snow, 8 bits": lambda: fl.composite.snow(picture(np.uint8), cover),
        "composite.join": lambda: fl.composite.join([cover, cover**2], haze=0.1),
        "composite.over": lambda: fl.composite.over(
            picture(dtype), np.dstack([picture(dtype), cover])
        ),
        "stereo.anaglyph": lambda: fl.stereo.anaglyph(picture(dtype), picture(dtype)[:, ::-1]),
    }  # fmt: skip


KERNELS: dict[str, Callable[[], Any]] = {
    f"{name}, {np.dtype(dtype).name}": call
    for dtype in (np.float32, np.float64)
    for name, call in _kernels(dtype).items()
}
# Angles of tiles and places of flakes: float64 only.
KERNELS |= {
    "particles.ids": lambda: fl.particles.ids(SHAPE, **flakes(20_000)),
    "particles.edge_fade": lambda: fl.particles.edge_fade(points(20_000), (4.0, 3.0, 6.0)),
    "particles.positions": lambda: fl.particles.positions(
        20_000, (4.0, 3.0, 6.0), seed=3, velocity=(0.3, 1.2, 0.1), time=1234.5, sway=(0.1, 2.0)
    ),
    "random_phase": lambda: fl.spectral.random_phase((33, 40), seed=9),
    "tent_rate": lambda: fl.spectral.tent_rate((33, 40), (1.0, 5.0)),
    "band_amplitude": lambda: fl.spectral.band_amplitude((64, 60), exponent=0.7),
    "temporal_filter": lambda: fl.spectral.temporal_filter(
        np.ones((64, 60)), (1.0, 5.0), alias="soft", shutter=0.7
    ),
    "cone.rays": lambda: np.stack(
        [fl.cone.rays(SHAPE, LENS, axis=(0.1, 0.9, 0.3)).azimuth,
         fl.cone.rays(SHAPE, LENS, axis=(0.1, 0.9, 0.3)).height]
    ),
    "gas.light": lambda: fl.gas.light(points(60), np.full(60, 0.3), np.ones(60), (0.4, 1.0, 0.3)),
}  # fmt: skip

PATH = fl.CameraPath(
    fl.Camera(140.0),
    velocity=(0.3, 0.0, 2.0),
    orientation=fl.Keys([(0, (0.0, 0.0, 0.0)), (20, (0.0, 0.4, 0.1))]),
)
# Light in float32, so that the last bit is seen.
PLATE = RNG(0).random((120, 160, 3), np.float32)
# A pole whose pixels are means of its depth and of what is behind it.
POLE = 5.0 + 35.0 * np.clip(np.abs(np.mgrid[:120, :160][1] - 80.3) - 1.0, 0.0, 1.0)
SCENES: dict[str, fl.Scene] = {
    "snow": fl.Scene(PLATE, effects=TentSnow("heavy", flakes=2000)),
    "rain": fl.Scene(PLATE, camera=PATH, effects=TentRain("downpour", drops=300)),
    "gusts": fl.Scene(
        PLATE, camera=PATH,
        effects=[TentSnow(flakes=200, wind=fl.Wind((1.0, 0.0, 0.3), gusts=0.6, swirl=0.3))],
    ),
    "mist": fl.Scene(
        PLATE, sun=fl.scene.Sun(),
        effects=[fl.Mist(count=300, color=0.7, wind=(0.5, 0.0, 0.0))],
    ),
    "cone": fl.Scene(PLATE, effects=[ConeSnow(tile=128), ConeRain(tile=128)]),
    "flakes": fl.Scene(PLATE, camera=PATH, effects=[fl.Snow("heavy"), fl.Rain("rain")]),
    "local": fl.Scene(np.uint8(255 * PLATE), effects=fl.Snow("heavy", color="local")),
    "sheets": fl.Scene(PLATE, effects=[fl.Snow("heavy"), fl.Rain("rain")]),
    "still": fl.Scene(PLATE, effects=[fl.Mist(count=300), fl.Mist("bank")], depth=POLE),
}  # fmt: skip
# What a data set's pictures share is made once for a process.
WEATHERS: dict[str, Any] = {
    "snowfall": fl.augment.Snowfall(severity=3),
    "rainfall": fl.augment.Rainfall(severity=3),
}


def digest(array: Any) -> str:
    found = np.ascontiguousarray(array)
    return hashlib.sha256(f"{found.dtype.str}{found.shape}".encode() + found.tobytes()).hexdigest()


def of_kernels() -> dict[str, str]:
    return {name: digest(call()) for name, call in KERNELS.items()}


def of_scenes(frames: tuple[float, ...] = (0, 7.25, 1000)) -> dict[str, str]:
    found = {name: digest([scene.render(t) for t in frames]) for name, scene in SCENES.items()}
    return found | {name: digest(weather(PLATE, index=1)) for name, weather in WEATHERS.items()}


def take() -> None:
    fl.settings(reproducible=True)
    file = Path(__file__).parent / "frames" / "hashes.json"
    kept = json.loads(file.read_text(encoding="utf-8"))
    for name, found in of_scenes().items():
        number = kept[name]["number"] if name in kept else 0
        if number == 0 or kept[name]["sha256"] != found:
            kept[name] = {"sha256": found, "number": number + 1}
            if number:
                print(f"CHANGELOG.md wants: Frames of `{name}` change ({number + 1}): why.")
    file.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if "--take" in sys.argv:
        take()
    else:
        print(json.dumps({"kernels": of_kernels(), "scenes": of_scenes()}))
