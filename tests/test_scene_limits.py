"""Weather in front of a scene that ends: less before a wall than before the sky."""

import math
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.effects.maps import wall_maps
from flurries.io import linear_to_srgb, srgb_to_linear
from measure import cover

Snow, Scene = fl.effects.TentSnow, fl.Scene
W, H = 256, 192
MODES = ("tile", "pixel")
NEAR, FAR = 12.0, 96.0  # three octaves
# A map that is linear, so that mean and deviation follow from those of the field.
PLAIN = {"flakes": 0, "haze": 0.0, "mean": 0.5, "spread": 6.0, "power": 1.0, "texture": 1.0,
         "wavelengths": (4.0, 32.0), "near_depth": NEAR, "alias": "keep", "shutter": 0.0,
         "exponent": 1.0, "tile": 64}  # fmt: skip


def alpha(snow: Any, depth: Any, t: float = 5.0, seed: int = 0, **more: Any) -> np.ndarray:
    scene = Scene(size=(W, H), depth=depth, effects=[snow], seed=seed)
    return scene.layers(t, **more).alpha.astype(float)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("kind", [Snow, lambda **how: fl.effects.TentRain(drops=500, **how)])
def test_what_is_beyond_all_snow_changes_nothing(kind: Any, mode: str):
    snow = kind(depth_mode=mode)
    far = max(snow.parts.texture.field.far_depth, snow.near_depth)
    want = alpha(snow, None)
    for depth in (np.full((H, W), np.inf), 1.001 * far):
        assert np.abs(alpha(snow, depth) - want).max() < 1e-7


@pytest.mark.parametrize("look, mode", [
    ({}, "pixel"), ({"mean": 0.5, "spread": 3.0, "exponent": 1.0}, "tile"), ("heavy", "pixel"),
])  # fmt: skip
def test_the_waves_before_a_wall_keep_their_contrast_and_the_mean_its_share(look: Any, mode: str):
    # At twice `near_depth`, in the band of the waves that are left; looks of three exponents.
    plain = {"flakes": 0, "haze": 0.0, "wavelengths": (4.0, 32.0), "near_depth": NEAR,
             "depth_mode": mode}  # fmt: skip
    snow = Snow(look, **plain) if isinstance(look, str) else Snow(**plain, **look)
    k = np.hypot(np.fft.fftfreq(320)[:, None], np.fft.fftfreq(320))
    waves = (k > 1 / 31) & (k < 1 / 18)

    def pictures(depth: float | None) -> list[np.ndarray]:
        scenes = [Scene(size=(320, 320), depth=depth, effects=[snow], seed=s) for s in range(4)]
        return [cover(scene, 5.0).astype(float) for scene in scenes]

    def contrast(alphas: list[np.ndarray]) -> float:
        return math.sqrt(np.mean([(np.abs(np.fft.fft2(a)) ** 2)[waves].mean() for a in alphas]))

    sky, wall = pictures(None), pictures(24.0)
    assert contrast(wall) / contrast(sky) == pytest.approx(1.0, abs=0.06)
    for depth, share in ((24.0, 1 / 3), (48.0, 2 / 3), (18.0, math.log(1.5) / math.log(8.0))):
        got = wall if depth == 24.0 else pictures(depth)
        # Tiles before the nearest walls hold few waves, whose sum is not quite normal.
        assert np.mean(got) / np.mean(sky) == pytest.approx(share, abs=0.01)


def test_pixels_follow_edges_that_tiles_cannot():
    half = np.full((H, W), np.inf, np.float32)
    half[:, : W // 2] = 10.0
    sky = alpha(Snow(**PLAIN), None)
    pixel, tile = (alpha(Snow(**PLAIN, depth_mode=mode), half) for mode in ("pixel", "tile"))
    assert pixel[:, : W // 2].max() == 0.0
    assert np.abs(pixel[:, W // 2 :] - sky[:, W // 2 :]).max() < 2e-6
    assert tile[:, W // 2 - 8 : W // 2].mean() > 0.05
    assert tile[:, : W // 4].max() == 0.0
    assert np.abs(tile[:, 3 * W // 4 :] - sky[:, 3 * W // 4 :]).max() < 2e-6


LINEAR = {**PLAIN, "blend": "linear", "overlap": 24, "power": 2.0, "spread": 3.0}


@pytest.mark.parametrize("blend", ["linear", "power"])
def test_depth_and_motion_of_a_seam_are_weighed_by_power(blend: str):
    # Left a wall, right the sky: tiles of two depths, and between them a mix by their squares.
    half = np.full((H, W), np.inf, np.float32)
    half[:, :64] = 26.0
    snow = Snow(**{**LINEAR, "blend": blend, "fall": 0.4, "wind": (0.2, 0.0, 0.0)})
    got = Scene(size=(W, H), effects=[snow], depth=half).layers(5)
    depth, motion = got.layers["snow"].depth[100], got.layers["snow"].motion[100]
    # Tiles of 64 px begin every 40 px; the first ends before the wall's edge, the second does not.
    seam = slice(40, 64)
    place = (np.arange(40, 64) - 40 + 0.5) / 24.0
    other = np.sin(0.5 * np.pi * place) ** 2 if blend == "power" else place
    if blend == "linear":
        other = other**2 / (other**2 + (1.0 - other) ** 2)
    for plane, wall in ((depth, 26.0), (motion[:, 1], np.inf)):
        first, second = plane[20], plane[70]
        assert first != second
        # No weather lies behind what stands there.
        mixed = np.minimum(first + other * (second - first), wall)
        assert plane[seam] == pytest.approx(mixed, rel=1e-5)


def test_flakes_behind_the_scene_are_hidden():
    depth = np.random.default_rng(4).uniform(1.0, 12.0, (H, W)).astype(np.float32)
    snow = Snow(texture=0.0, haze=0.0, flakes=500, sway=(0.0, 1.0), flake_opacity=0.5)
    shown, hidden = alpha(snow, None), alpha(snow, depth)
    assert (hidden <= shown + 1e-6).all()
    # Before a wall only what is nearer: the same as a wall at each pixel's own depth.
    for wall in (3.0, 8.0):
        at = alpha(snow, wall)
        same = np.abs(depth - wall) < 0.05
        assert np.median(np.abs(at - hidden)[same]) < 1e-6
    assert alpha(snow, 0.5).mean() < 0.02 * shown.mean() < alpha(snow, 8.0).mean()


def test_the_veil_thickens_with_the_way_through_it():
    veil = Snow(texture=0.0, flakes=0, haze=0.4)
    far = veil.parts.veil.far
    sky = alpha(veil, None)
    assert sky == pytest.approx(0.4, abs=1e-6)
    for part in (0.01, 0.25, 0.5, 1.0, 7.0):
        want = 1.0 - 0.6 ** min(part, 1.0)
        assert alpha(veil, part * far) == pytest.approx(want, abs=1e-6)


def street(sky: float, walls: float) -> np.ndarray:
    plate = np.full((90, 120, 3), walls, np.float32)
    plate *= np.random.default_rng(2).uniform(0.5, 1.5, plate.shape).astype(np.float32)
    plate[:30] = sky
    return plate


def test_snow_is_a_little_darker_than_the_sky_at_any_exposure():
    for sky, walls in ((1.0, 0.1), (0.8, 0.4), (5.0, 0.2)):
        light = fl.scene.find_light(fl.Scene(street(sky, walls))).snow
        assert light == pytest.approx([0.9 * sky] * 3, rel=1e-4)
    snow = [fl.Snow("heavy")]
    shown = fl.Scene(street(1.0, 0.1), effects=snow, fps=24).render(3)
    for k in (16.0, 1.0 / 16.0):
        again = fl.Scene(np.float32(k) * street(1.0, 0.1), effects=snow, fps=24).render(3)
        np.testing.assert_allclose(again, k * shown, rtol=2e-5)


def test_a_coat_lights_nothing_and_a_sky_tints_little():
    picture = street(1.0, 0.1)
    picture[40:80, 20:] = 0.9, 0.15, 0.02
    assert np.ptp(linear_to_srgb(fl.scene.find_light(fl.Scene(picture)).snow)) < 2.0 / 255.0
    picture[:30] = 0.3, 0.5, 0.9
    red, green, blue = linear_to_srgb(fl.scene.find_light(fl.Scene(picture)).snow)
    assert red < green < blue < red + 17.0 / 255.0


def test_all_that_is_beyond_far_is_alike():
    """And monotone before it, of each effect; a whole picture at each depth."""
    ladder = [0.5, 4.0, 15.0, 40.0, 81.0, 1e3, 1e10, np.inf]
    walls = [np.full((60, 80), depth, np.float32) for depth in ladder]
    for effect in (
        fl.Snow("heavy", haze=0.2), fl.Rain("downpour", haze=0.2), fl.Mist(visibility=40.0),
        fl.effects.ConeSnow(radius=8.0), fl.effects.ConeRain(radius=8.0),
        fl.effects.TentSnow("light", near_depth=4.0), fl.effects.TentRain("rain"),
        fl.Snow(far=12.0, method="simulated"),
    ):  # fmt: skip
        scene = Scene("#000000", size=(80, 60), effects=[effect], fps=24)
        planes = [cover(scene.replace(depth=d), 3).mean(dtype=np.float64) for d in walls]
        assert (np.diff(planes) > -1e-6).all(), effect
        assert planes[4:] == pytest.approx([planes[-1]] * 4, rel=1e-6), effect


def test_the_veil_of_rain_does_not_shine():
    rain = fl.Rain(density=0.0, haze=0.5, color=0.6, gain=6.0)
    shown = Scene(np.zeros((6, 8, 3), np.float32), effects=[rain]).render(0)
    assert shown == pytest.approx(0.5 * float(srgb_to_linear(np.array(0.6))), rel=1e-5)


@pytest.mark.parametrize("sky", [(0.05, 0.25, 2.0), (0.5, 0.17, 2.0), (0.9, 0.3, 0.5), (0, 5, 1)])
def test_a_wall_s_map_has_its_share_of_the_mean(sky: tuple[float, float, float]):
    # By plain sums over a fine grid; the sky's own map where all of the air is there.
    z = np.linspace(-8.0, 8.0, 200_001)
    weight = np.exp(-0.5 * z * z) / np.exp(-0.5 * z * z).sum()

    def opacity(mean: float, deviation: float) -> np.ndarray:
        return np.clip(mean + deviation * z, 0.0, 1.0) ** sky[2]

    shares = (0.01, 0.1, 1 / 3, 0.7, 1.0)
    maps = wall_maps(sky, 1.0, shares, lambda share: share)
    means, deviations = maps.at(np.array(shares), None)
    whole = opacity(*sky[:2]) @ weight
    for share, mean, part in zip(shares, means, deviations, strict=True):
        assert opacity(mean, part * sky[1]) @ weight == pytest.approx(share * whole, rel=0.006)
    assert (means[-1], deviations[-1]) == (sky[0], 1.0)
    assert maps.at(np.zeros(1), None)[1] == 0.0
