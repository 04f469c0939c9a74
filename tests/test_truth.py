"""What every layer says of its pixels, before every camera: depth, motion, number.

Flakes and drops are followed in the list of them, media and textures as points of the air at the
depth that the pixel tells; both through a camera written here.
"""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flurries as fl

SIZE, FOCAL, FPS, T = np.array((240, 180)), 260.0, 30.0, 12.0
SPEED, SPIN, ZOOM = np.array((0.5, -0.2, 2.0)), np.array((0.0, 0.0125, 0.0)), 2.0
AIR = (1.0, 0.0, 0.3)
STILL = (0.0, 0.0, 0.0)

CAMERAS: dict[str, dict[str, Any]] = {
    "still": {},
    "moving": {"velocity": tuple(SPEED)},
    "turning": {"orientation": fl.Keys([(0, STILL), (40, tuple(40 * SPIN))])},
    "zooming": {"focal": fl.Keys([(0, FOCAL), (40, FOCAL + 40 * ZOOM)])},
}
LENSES = {"pinhole": None, "opening": fl.camera.Lens(focus=4.0, f_stop=1.4)}
NEAR: dict[str, Any] = {"near": 1.5, "far": 8.0, "method": "simulated"}
FLAKES: dict[str, Any] = {
    "snow": fl.Snow("heavy", wind=AIR),
    "snow, all drawn": fl.Snow(density=12.0, wind=AIR, **NEAR),
    "snow in gusts": fl.Snow(density=12.0, wind=fl.Wind(AIR, gusts=0.8, swirl=0.4), **NEAR),
    "rain, all drawn": fl.Rain(density=60.0, wind=AIR, **NEAR),
    "tent": fl.effects.TentSnow(texture=0.0, haze=0.0, wind=AIR),
    "tent's rain": fl.effects.TentRain(texture=0.0, haze=0.0, wind=AIR),
}
# What is cut of fast streaks would weigh depth and motion differently.
WHOLE: dict[str, Any] = {"alias": "keep", "renormalise": False, "shutter": 0.0}
# With the largest error in pixels and the largest median error, of the median speed.
MEDIA: dict[str, Any] = {
    "fog": (fl.Mist("fog", wind=AIR), 1e-5, 1e-6),
    "bank": (fl.Mist("bank", wind=AIR), 1e-5, 1e-6),
    "particles": (fl.Mist("fog", method="particles", wind=AIR), 1e-5, 1e-6),
    "rain on the cone": (fl.effects.ConeRain(haze=0.0, wind=AIR), 1e-5, 1e-6),
    "snow on the cone": (fl.effects.ConeSnow(haze=0.0, flakes=0, wind=AIR), 1e-5, 1e-6),
    # One vector and one depth for each tile, in between interpolated.
    "texture": (fl.effects.TentSnow(flakes=0, haze=0.0, wind=AIR), 0.35, 0.03),
    "rain's texture": (fl.effects.TentRain(drops=0, haze=0.0, wind=AIR, **WHOLE), 0.35, 0.03),
}


def lens(kind: str, t: float) -> tuple[np.ndarray, Rotation, float]:
    """Return where the camera is, how it is turned, and its focal length."""
    turn = Rotation.from_rotvec(SPIN * t * (kind == "turning"))
    return SPEED * t / FPS * (kind == "moving"), turn, FOCAL + ZOOM * t * (kind == "zooming")


def seen(kind: str, places: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels (n, 2) and depths (n,) of places (n, 3)."""
    eye, turn, focal = lens(kind, t)
    x = turn.inv().apply(places - eye)
    return focal * x[:, :2] / x[:, 2:] + SIZE / 2, x[:, 2]


def rendered(effect: Any, kind: str, **more: Any) -> tuple[fl.Scene, fl.scene.Rendered, str]:
    path = fl.CameraPath(fl.Camera(FOCAL), **CAMERAS[kind])
    scene = fl.Scene(
        "#203040", size=tuple(SIZE), camera=path, effects=[effect], fps=FPS, seed=5, **more
    )
    made = scene.layers(T)
    (name,) = (name for name, one in made.layers.items() if one.depth is not None)
    return scene, made, name


@pytest.mark.parametrize("opening", LENSES)
@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("effect", FLAKES)
def test_a_pixel_tells_the_flake_that_it_shows(effect: str, kind: str, opening: str):
    scene, made, name = rendered(FLAKES[effect], kind, lens=LENSES[opening])
    ids, cover = made.layers[name].ids, made.layers[name].coverage
    # Where the texture behind a flake shows more, the planes are the texture's.
    shown = (ids >= 0) & (cover > 0.6 * made.layers[name].alpha) & (cover > 0.004)
    assert shown.sum() > 40 and len(np.unique(ids[shown])) > 4
    assert (ids[cover == 0.0] == -1).all()
    now = fl.flakes(scene, T)
    here, depth = seen(kind, now["place"], T)
    assert np.abs(here - now["pixel"]).max() < 1e-6
    order = np.argsort(now["id"])
    at = order[np.searchsorted(now["id"], ids[shown].astype(np.uint64), sorter=order)]
    np.testing.assert_array_equal(now["id"][at], ids[shown])
    np.testing.assert_allclose(made.layers[name].depth[shown], depth[at], rtol=1e-6)
    for step, plane in ((1.0, made.layers[name].motion), (-1.0, made.layers[name].backward)):
        then = fl.flakes(scene, T + step)
        both, first, second = np.intersect1d(now["id"], then["id"], return_indices=True)
        ways = np.full((len(now), 2), np.nan)
        ways[first] = seen(kind, then["place"][second], T + step)[0] - here[first]
        known = np.isfinite(ways[at, 0])
        assert known.mean() > 0.6 and len(both) > 20
        assert np.abs(plane[shown][known] - ways[at][known]).max() < 1e-5


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("medium", MEDIA)
def test_a_pixel_tells_the_air_at_its_depth(medium: str, kind: str):
    effect, most, share = MEDIA[medium]
    _, made, name = rendered(effect, kind)
    shown = np.isfinite(made.layers[name].depth) & (made.layers[name].alpha > 0.004)
    assert shown.mean() > 0.3
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    pixels = np.c_[x[shown], y[shown]]
    depth = made.layers[name].depth[shown].astype(float)[:, None]
    eye, turn, focal = lens(kind, T)
    places = eye + turn.apply(np.c_[(pixels - SIZE / 2) / focal, np.ones(len(pixels))] * depth)
    air = np.add(AIR, (0.0, getattr(effect, "fall", 0.0), 0.0))
    for step, plane in ((1.0, made.layers[name].motion), (-1.0, made.layers[name].backward)):
        way = seen(kind, places + air * step / FPS, T + step)[0] - pixels
        off = np.linalg.norm(plane[shown] - way, axis=1)
        assert off.max() < most
        assert np.median(off) < share * np.median(np.linalg.norm(way, axis=1))
