"""Mist in scenes: presets, visibility, wind, depth, layers, light."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries import _core, stereo

FOCAL = 100.0


def scene(*effects, **about):
    about = {"camera": fl.Camera(FOCAL), "seed": 5, "background": np.zeros((72, 96, 3), np.float32),
             **about}  # fmt: skip
    return fl.Scene(effects=list(effects), **about)


def cover(shown, t=0.0, **options):
    return shown.layers(t, **options).alpha


@pytest.mark.parametrize(
    ("name", "numbers", "beta"),
    [
        ("clouds", (1500, 0.37, 0.4, 0.86), 0.4356),
        ("mist", (1000, 0.45, 0.15, 0.6), 0.1611),
        ("fog", (1200, 0.45, 0.4, 0.7), 0.5154),
    ],
)
def test_presets_have_the_papers_numbers(name, numbers, beta):
    effect = fl.Mist(name)
    assert (effect.count, effect.radius, effect.density, effect.color) == numbers
    assert effect.box == (5.0, 5.0, 5.0) and abs(effect.extinction() - beta) < 6e-5
    # One draw of it. The view goes through 4.4 units of it or so, and its far end fades.
    assert abs(-math.log(1 - cover(scene(effect)).mean()) / (beta * 4.2) - 1) < 0.4


@pytest.mark.parametrize("far", [4.0, 12.0])
def test_visibility_is_what_one_sees(far):
    # A wall half as far: what is left of it. Rays lean by up to 31 degrees; it is farther there.
    fogs = [fl.Mist(visibility=far, seed=seed) for seed in range(12)]
    means = [1 - cover(scene(fog, depth=far / 2)).mean() for fog in fogs]
    off = np.mean(means) - math.exp(math.log(0.05) / 2)
    assert abs(off) < 3 * np.std(means) / math.sqrt(12) + 0.02


def test_visibility_and_count():
    effect = fl.Mist(visibility=10.0, count=3000)
    assert effect.particles_in_box() == 3000
    assert abs(fl.gas.visibility(effect.extinction()) - 10.0) < 1e-9
    effect = fl.Mist("fog", visibility=20.0)
    assert effect.count is None and effect.radius == pytest.approx(0.45 / 5 * 24)
    assert abs(fl.gas.visibility(effect.extinction()) / 20.0 - 1) < 1e-3
    keyed = fl.Mist(visibility=fl.Keys([(0, 10.0), (100, 40.0)]))
    for t, far in ((0, 10.0), (50, 25.0), (100, 40.0)):
        assert abs(fl.gas.visibility(keyed.extinction(t)) / far - 1) < 1e-3
    with pytest.raises(ValueError, match="visibility"):
        fl.Mist(visibility=0.1, count=5)
    with pytest.raises(ValueError, match="visibility"):
        fl.Mist(visibility=1.0, box=500.0, radius=0.05)


def test_wind_moves_the_gas_and_its_box_wraps():
    # Against a camera that moves the other way: the same pictures.
    blown = scene(fl.Mist("fog", wind=(0.6, 0.0, 0.3)))
    path = fl.CameraPath(fl.Camera(FOCAL), velocity=(-0.6, 0.0, -0.3))
    flown = scene(fl.Mist("fog"), camera=path)
    for t in (0.0, 40.0, 1e4):
        np.testing.assert_allclose(cover(blown, t), cover(flown, t), atol=2e-5)
    # After one box's length the gas is where it was.
    fog = fl.Mist("fog", wind=(0.0, 1.5, 0.0), center=(0.0, 0.0, 2.5), box=5.0)
    round_ = scene(fog, fps=30.0)
    np.testing.assert_allclose(cover(round_, 0), cover(round_, 100.0), atol=2e-5)
    assert np.abs(cover(round_, 0) - cover(round_, 50.0)).max() > 0.05
    # Frame by frame: nothing pops at the walls.
    assert np.abs(np.diff([cover(round_, t) for t in range(60)], axis=0)).max() < 0.12


def test_a_box_in_the_world_stays_there():
    effect = fl.Mist("clouds", center=(0.0, 0.0, 8.0), box=3.0)
    near = fl.CameraPath(fl.Camera(FOCAL), position=[(0, 0, 0), (0, 0, 2.0)])
    first, later = (cover(scene(effect, camera=near), t) for t in (0, 1))
    # From 8 to 6 units away; and around it is nothing.
    assert 1.3 < (later > 0.05).sum() / (first > 0.05).sum() < 2.4
    assert first[:5].max() < 0.05
    turned = cover(scene(effect, camera=fl.Camera(FOCAL, rotation=(0.0, 0.2, 0.0))))
    before, after = (p.sum(axis=0) @ np.arange(96) / p.sum() for p in (first, turned))
    assert abs(after - before + FOCAL * math.tan(0.2)) < 3.0


def test_depths_put_gas_behind_and_in_front():
    whole = cover(scene(fl.Mist("fog", seed=7)))
    parts = [fl.Mist("fog", seed=7, depths=d) for d in ((2.5, math.inf), (0, 2.5))]
    back, front = (cover(scene(part)) for part in parts)
    together = cover(scene(*parts))
    # Particles that the border cuts are two of lesser opacity: 1 - (1 - a F)(1 - a (1 - F)).
    assert np.abs(together - whole).max() < 0.03
    assert back.mean() > 0.1 and front.mean() > 0.1
    # A red wall of flakes between them.
    snow = fl.effects.TentSnow(flakes=0, texture=0.0, haze=1.0, color=(1.0, 0.0, 0.0), fall=0.0)
    picture = scene(parts[0], snow, parts[1]).render(0)
    grey = fl.io.srgb_to_linear(np.array(0.7))
    np.testing.assert_allclose(picture[..., 1], front * grey, atol=2e-6)
    np.testing.assert_allclose(picture[..., 0], front * grey + (1 - front), atol=2e-6)


def test_what_stands_in_the_picture_hides_gas_behind_it():
    depth = np.full((72, 96), np.inf, np.float32)
    depth[:, 64:] = 1.0
    alpha = cover(scene(fl.Mist("fog"), depth=depth))
    free = cover(scene(fl.Mist("fog")))
    assert alpha[:, 65:].mean() < 0.75 * free[:, 65:].mean()
    np.testing.assert_array_equal(alpha[:, :64], free[:, :64])


def test_the_sun_shades_the_gas():
    effect = fl.Mist("clouds", center=(0, 0, 7.0), box=4.0, scatter="even", forward=0.0)
    dark = scene(effect, sun=fl.scene.Sun((0, 1, 0), 1.0, ambient=0.0)).layers(0)
    layer = dark.layers["mist"].rgba
    with np.errstate(invalid="ignore", divide="ignore"):
        light = np.where(layer[..., 3] > 0.2, layer[..., 1] / layer[..., 3], np.nan)
    own = fl.io.srgb_to_linear(np.array(0.86))
    rows = np.flatnonzero(np.isfinite(light).any(axis=1))
    top, bottom = (np.nanmean(light[r]) for r in (rows[:6], rows[-6:]))
    assert top > 2 * bottom and np.nanmax(light) <= own * 1.000001
    # Ambient light alone is the plain color; so is no sun, and a gas that is not lit.
    flat = scene(effect, sun=fl.scene.Sun((0, 1, 0), 1.0, ambient=1.0)).render(0)
    none = scene(effect).render(0)
    unlit = scene(replace(effect, lit=False), sun=fl.scene.Sun()).render(0)
    np.testing.assert_allclose(flat, none, atol=3e-6)
    np.testing.assert_array_equal(unlit, none)
    # Into the sun a cloud of droplets is brighter than away from it.
    into, away = (
        scene(fl.Mist("mist", scatter="henyey"), sun=fl.scene.Sun((0, 0.2, z), 1.0, 0.0)).render(0)
        for z in (-1.0, 1.0)
    )
    assert into.mean() > 3 * away.mean()


def test_light_is_computed_once_for_a_gas_and_a_light(monkeypatch):
    made: list[Any] = []
    kernel = _core.gas_light
    monkeypatch.setattr(_core, "gas_light", lambda *args: made.append(args) or kernel(*args))
    shown = scene(fl.Mist("clouds", center=(0, 0, 6.0)), sun=fl.scene.Sun())
    for eye in (None, *stereo.eyes(shown.camera.camera, distance=0.065)):
        shown.render(4, eye=eye)
    # Nothing moves, so that the next frame is the last one.
    shown.render(5)
    assert len(made) == 1


def test_amount_fades_and_nothing_is_nothing():
    keyed = fl.Mist("fog", amount=fl.Keys([(0, 0.0), (10, 1.0)]))
    means = [cover(scene(keyed), t).mean() for t in (0, 3, 10)]
    assert means[0] == 0 and 0 < means[1] < means[2]
    for nothing in (fl.Mist(count=0), fl.Mist(density=0.0)):
        assert not cover(scene(nothing, sun=fl.scene.Sun())).any()


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


@pytest.mark.parametrize("structure", [0.0, 0.7])
def test_a_lamp_lights_the_mist_around_it(structure: float):
    plate = np.full((48, 64, 3), 0.01, np.float32)
    lamp = fl.scene.Lamp(place=(1.0, 0.0, 4.0), power=2.0)
    about = {"effects": [fl.Mist(visibility=12.0, box=8.0, structure=structure)], "seed": 2}
    dark, lit = (fl.Scene(plate, lights=lamps, **about).render(0) for lamps in ([], [lamp]))
    gained = (lit - dark).mean(axis=2)
    assert (gained >= 0.0).all()
    # Around the lamp's image, 1 m aside at 4 m behind a lens of 1.2 widths, and less elsewhere.
    column = int(32 + 1.2 * 64 / 4)
    around = gained[18:30, column - 6 : column + 6].mean()
    assert around > 0.05
    assert around > 4.0 * gained[:, :12].mean() > 0.0
