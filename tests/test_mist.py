"""Mist in scenes: presets, visibility, wind, depth, layers, light."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.effects.bank_density import Density
from measure import frame_of

FOCAL = 100.0


def scene(*effects, **about):
    about = {"camera": fl.Camera(FOCAL), "seed": 5, "background": np.zeros((72, 96, 3), np.float32),
             **about}  # fmt: skip
    return fl.Scene(effects=list(effects), **about)


def gas(*look, **fields):
    return fl.Mist(*look, method="particles", **fields)


def cover(shown, t=0.0, **options):
    return shown.layers(t, **options).alpha


@pytest.mark.parametrize(("name", "numbers", "beta"), [
    ("clouds", (1500, 0.37, 0.4, 0.86), 0.4356), ("mist", (1000, 0.45, 0.15, 0.6), 0.1611),
    ("fog", (1200, 0.45, 0.4, 0.7), 0.5154),
])  # fmt: skip
def test_presets_have_the_papers_numbers(name, numbers, beta):
    effect = gas(name)
    assert (effect.count, effect.radius, effect.density, effect.color) == numbers
    assert effect.box == (5.0, 5.0, 5.0) and abs(effect.extinction() - beta) < 6e-5
    # One draw of it. The view goes through 4.4 units of it or so, and its far end fades.
    assert abs(-math.log(1 - cover(scene(effect)).mean()) / (beta * 4.2) - 1) < 0.4


def test_a_visibility_may_be_keyed_and_is_not_of_particles():
    keyed = fl.Mist(visibility=fl.Keys([(0, 10.0), (100, 40.0)]))
    for t, far in ((0, 10.0), (50, 25.0), (100, 40.0)):
        assert abs(fl.gas.visibility(keyed.extinction(t)) / far - 1) < 1e-9
    for wrong in (
        {"count": 5, "visibility": 9.0}, {"method": "particles", "visibility": 9.0},
        {"count": 9, "top": 1.0}, {"method": "slices", "radius": 1.0},
    ):  # fmt: skip
        with pytest.raises(ValueError, match=f"{list(wrong)[-1]} is (not )?of particles"):
            fl.Mist(**wrong)


def left_of(effect, depth):
    black = np.zeros((9, 9, 3), np.float32)
    shown = scene(effect, depth=depth, camera=fl.Camera(1e5), background=black)
    return 1.0 - float(cover(shown)[4, 4])


def test_mist_goes_by_its_visibility_and_all_beyond_is_seen_through_all_of_it():
    for effect, far, reach in (
        (fl.Mist(), 200.0, 400.0), (fl.Mist(visibility=15.0), 15.0, 60.0),
        (fl.Mist(severity=4), 100.0, 200.0),
    ):  # fmt: skip
        ladder = np.append(np.geomspace(0.5, 1e5, 60), [1e10, np.inf])
        left = [left_of(effect, np.full((9, 9), depth, np.float32)) for depth in ladder]
        want = np.exp(math.log(0.05) / far * np.minimum(ladder, reach))
        np.testing.assert_allclose(left, want, rtol=2e-5, atol=2e-7)
    stirred = fl.Mist("fog")
    left = [left_of(stirred, np.full((9, 9), depth, np.float32)) for depth in ladder]
    assert (np.diff(left) <= 1e-7).all() and len(set(left[-4:])) == 1


def test_without_a_depth_there_is_a_wall_at_the_backdrop_and_the_plan_says_so():
    for wall, effect in ((60.0, fl.Mist("fog")), (25.0, fl.Mist("fog", backdrop=25.0))):
        given = cover(scene(effect, depth=wall))
        np.testing.assert_allclose(cover(scene(effect)), given, atol=1e-6)
        assert f"wall at {wall:g} m" in str(scene(effect).plan(probe=False))
        assert "wall at" not in str(scene(effect, depth=wall).plan(probe=False))


def test_wind_moves_the_gas_and_its_box_wraps():
    # Against a camera that moves the other way: the same pictures.
    blown = scene(gas("fog", wind=(0.6, 0.0, 0.3)))
    path = fl.CameraPath(fl.Camera(FOCAL), velocity=(-0.6, 0.0, -0.3))
    flown = scene(gas("fog"), camera=path)
    for t in (0.0, 40.0, 1e4):
        np.testing.assert_allclose(cover(blown, t), cover(flown, t), atol=2e-5)
    # After one box's length the gas is where it was.
    fog = gas("fog", wind=(0.0, 1.5, 0.0), center=(0.0, 0.0, 2.5), box=5.0)
    round_ = scene(fog, fps=30.0)
    np.testing.assert_allclose(cover(round_, 0), cover(round_, 100.0), atol=2e-5)
    assert np.abs(cover(round_, 0) - cover(round_, 50.0)).max() > 0.05
    # Frame by frame: nothing pops at the walls.
    assert np.abs(np.diff([cover(round_, t) for t in range(60)], axis=0)).max() < 0.12


def test_a_box_in_the_world_stays_there():
    effect = gas("clouds", center=(0.0, 0.0, 8.0), box=3.0)
    near = fl.CameraPath(fl.Camera(FOCAL), position=[(0, 0, 0), (0, 0, 2.0)])
    first, later = (cover(scene(effect, camera=near), t) for t in (0, 1))
    # From 8 to 6 units away; and around it is nothing.
    assert 1.3 < (later > 0.05).sum() / (first > 0.05).sum() < 2.4
    assert first[:5].max() < 0.05
    turned = cover(scene(effect, camera=fl.Camera(FOCAL, rotation=(0.0, 0.2, 0.0))))
    before, after = (p.sum(axis=0) @ np.arange(96) / p.sum() for p in (first, turned))
    assert abs(after - before + FOCAL * math.tan(0.2)) < 3.0


def test_depths_put_gas_behind_and_in_front():
    fog = {"visibility": 6.0, "color": 0.7, "seed": 7}
    whole = cover(scene(fl.Mist("fog", **fog), depth=50.0))
    parts = [fl.Mist("fog", **fog, depths=d) for d in ((2.5, math.inf), (0, 2.5))]
    back, front = (cover(scene(part, depth=50.0)) for part in parts)
    together = cover(scene(*parts, depth=50.0))
    assert np.abs(together - whole).max() < 0.03 < min(back.mean(), front.mean())


def test_amount_fades_and_nothing_is_nothing():
    keyed = fl.Mist("fog", amount=fl.Keys([(0, 0.0), (10, 1.0)]))
    means = [cover(scene(keyed), t).mean() for t in (0, 3, 10)]
    assert means[0] == 0 and 0 < means[1] < means[2]
    assert not cover(scene(fl.Mist(count=0), fl.Mist(density=0.0))).any()


@pytest.mark.parametrize("space", ["linear", "display"])
@pytest.mark.parametrize("structure", [0.0, 0.7])
def test_fog_is_never_darker_than_the_sky_unless_asked(structure: float, space: str):
    rows = np.linspace(1.0, 0.2, 48, dtype=np.float32)[:, None, None]
    noon, dusk, night = (
        (rows * np.ones((48, 64, 3)) * light).astype(np.float32)
        for light in (0.9, (0.2, 0.1, 0.08), 0.004)
    )
    for plate in (noon, dusk, night):
        fog = fl.Mist(visibility=8.0, structure=structure)
        seen = fl.Scene(plate, effects=[fog], space=space).render(0)
        # The sky is the brighter quarter of the plate, and fog before it as bright; below it is
        # brighter than what it hides.
        assert np.allclose(seen[:12].mean(), plate[:12].mean(), rtol=0.02)
        assert (seen[12:] >= 0.98 * plate[12:]).all()
        assert seen.max() < 1.01 * plate.max()
        assert np.abs(seen - plate).max() > 0.1 * plate.max()
    smoke = fl.Mist(visibility=8.0, structure=structure, color=0.3)
    assert fl.Scene(noon, effects=[smoke]).render(0)[0].mean() < 0.7


def test_a_lamp_lights_the_particles_around_it():
    plate = np.full((48, 64, 3), 0.01, np.float32)
    lamp = fl.scene.Lamp(place=(1.0, 0.0, 4.0), power=2.0)
    about = {"effects": [fl.Mist(density=0.2, box=8.0)], "seed": 2}
    dark, lit = (fl.Scene(plate, lights=lamps, **about).render(0) for lamps in ([], [lamp]))
    gained = (lit - dark).mean(axis=2)
    # Around the lamp's image, 1 m aside at 4 m behind a lens of 1.2 widths.
    around = gained[18:30, 45:57].mean()
    assert around > max(0.05, 4.0 * gained[:, :12].mean()) and (gained >= 0.0).all()


def integral(
    beta: float, lamp: Any, ray: Any, end: float, spot: float = 0.0, start: float = 0.0
) -> float:
    """Return the light of a lamp of power 60 and radius .05 m, or a spot along x, along a ray."""
    length = np.linalg.norm(ray)
    way, start, end = np.asarray(ray) / length, start * length / ray[2], end * length / ray[2]
    lamp = np.asarray(lamp, np.float64)
    aside = np.geomspace(1e-7, 1e3, 20_000)
    s = np.concatenate([-aside[::-1], aside]) + lamp @ way
    s = np.concatenate([[start], s[(s > start) & (s < end)], [end]])
    to = s[:, None] * way - lamp
    r = np.maximum(np.linalg.norm(to, axis=1), 1e-12)
    g, cosine = 0.87, -(to @ way) / r
    phase = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)
    lit = (to[:, 0] / r > math.cos(spot)) if spot else 1.0
    light = beta * np.exp(-beta * (s - start + r)) * phase * lit * 60.0 / np.maximum(r, 0.05) ** 2
    return float(np.trapezoid(light, s))


@pytest.mark.parametrize("distance", [10.0, 20.0])
@pytest.mark.parametrize("wall", [np.inf, 9.0])
def test_lamps_in_mist_are_the_integral_of_single_scattering(distance: float, wall: float):
    mist, focal, beta = fl.Mist(visibility=15.0, color=0.0), 600.0, -math.log(0.05) / 15.0
    lamps = [fl.scene.Lamp((0.0, 0.0, distance), power=60.0)]
    about = {"camera": fl.Camera(focal), "background": np.zeros((3, 321, 3), np.float32)}
    depth = np.full((3, 321), wall, np.float32)
    seen = scene(mist, lights=lamps, depth=depth, **about).render(0)[1, :, 0]
    for aside in (0, 1, 3, 20, 100):
        ray = (aside / focal, 0.0, 1.0)
        want = integral(beta, (0.0, 0.0, distance), ray, min(wall, 60.0))
        assert seen[160 + aside] == pytest.approx(want, rel=0.015)
    # Snow and rain before and around it dim it too: their extinction is on the lamp's way.
    snow = fl.Snow(density=40.0, flake_size=(0.02, 0.02, 0.02), opacity=0.9)
    both = scene(mist, snow, lights=lamps, depth=depth, **about).layers(0).layers["mist"].rgba
    more = 40.0 * math.pi / 4 * 0.02**2 * 0.9
    # The light that comes by this ray goes no less than from the lamp to it, hardly farther than
    # from the lamp to the eye.
    dimmed, aside = both[1, 320, 0] / seen[320], 160 / focal * distance
    assert math.exp(-more * 1.1 * distance) < dimmed < math.exp(-more * 0.9 * aside)


def test_lamps_in_rough_mist_are_the_integral_through_its_slices():
    shape, lamp, off = (192, 256), (0.3, -0.2, 8.0), []
    mist = fl.Mist(visibility=30.0, structure=1.0, color=0.0)
    about = {"background": np.zeros((*shape, 3), np.float32), "camera": fl.Camera(500.0)}
    shown = scene(mist, lights=[fl.scene.Lamp(lamp, power=60.0)], **about)
    seen = shown.layers(0).layers["mist"].rgba
    parts = Density(mist, frame_of(shown), mist.extinction(), mist.extinction()).slices()
    slices = [one for part in parts for one in zip(part.dense, pairwise(part.edges), strict=True)]
    for place in np.random.default_rng(1).integers(0, shape, (200, 2)):
        # Extinctions of coarse samples, 4 px apart, by the quadratic spline.
        t = (place % 4 + 0.5) / 4.0
        down, across = np.transpose([(1 - t) ** 2 / 2, 0.5 + t * (1 - t), t**2 / 2])
        ray = (*((place + 0.5 - np.divide(shape, 2)) / 500.0)[::-1], 1.0)
        light, left, (row, column) = 0.0, 1.0, place // 4
        for dense, (start, end) in slices:
            beta = down @ dense[row : row + 3, column : column + 3] @ across
            light += left * integral(beta, lamp, ray, end, start=start)
            left *= math.exp(-beta * (end - start) * np.linalg.norm(ray))
        red, _, _, alpha = seen[tuple(place)]
        off.append(red / alpha * (1.0 - left) / light - 1.0)
    assert np.abs(off).max() < 0.03 and np.std(off) < 0.006


def test_a_spot_in_mist_lights_its_cone_alone():
    mist, beta = fl.Mist(visibility=15.0, color=0.0), -math.log(0.05) / 15.0
    spot = fl.scene.Lamp((-3.0, 0.0, 9.0), direction=(1, 0, 0), angle=0.6, soft=0.02, power=60.0)
    about = {"camera": fl.Camera(600.0), "background": np.zeros((401, 3, 3), np.float32)}
    depth = np.full((401, 3), np.inf, np.float32)
    seen = scene(mist, lights=[spot], depth=depth, **about).render(0)[:, 1, 0]
    for down in (0, 20, 40):
        want = integral(beta, (-3.0, 0.0, 9.0), (0.0, down / 600.0, 1.0), 60.0, spot=0.3)
        assert seen[200 + down] == pytest.approx(want, rel=0.06)
    assert seen[0] < 1e-6


def test_an_orange_lamp_goes_over_to_white_without_a_yellow_ring():
    lamp = fl.scene.Lamp((0.0, 0.0, 8.0), color=(1.0, 0.6, 0.25), power=60.0)
    plate = np.zeros((3, 301, 3), np.uint8)
    about = {"effects": [fl.Mist(visibility=60.0, color=0.0)], "lights": [lamp], "depth": 60.0}
    bytes_ = fl.Scene(plate, **about).render(0)[1, 150:].astype(float)
    light = fl.Scene(plate.astype(np.float32), **about).render(0)[1, 150:]
    np.testing.assert_allclose(light[:, 2] / light[:, 0], 0.25, rtol=1e-4)
    assert (bytes_[0] == 255).all() and light.max() > 10.0
    assert (bytes_[bytes_[:, 1] == 255, 2] > 240).all()
    dim = light.max(axis=1) < 1.0
    np.testing.assert_allclose(bytes_[dim], 255 * fl.io.color.linear_to_srgb(light[dim]), atol=0.51)
