"""An artist's notes on snow and rain: each changes what it names, and truth follows it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.scene.fingerprint import fingerprint
from measure import same_flakes

SLOW = fl.Keys([(0, 1.0), (10, 1.0), (20, 0.0), (30, 0.5)])
WINDS: dict[str, Any] = {
    "even": (0.5, 0.0, 0.1), "gusts": fl.Wind((0.5, 0.0, 0.0), gusts=0.6, swirl=0.3),
    "profile": fl.Wind((0.5, 0.0, 0.0), profile=[(0.0, 1.0), (9.0, 2.0)]),
}  # fmt: skip


def scene(*, camera: Any = None, size: tuple[int, int] = (240, 160), **fields: Any) -> fl.Scene:
    given = {"density": 60.0, "far": 30.0, "handover": 6.0, "shutter": 0.5, **fields}
    return fl.Scene(
        size=size, camera=camera or fl.Camera(260.0), effects=[fl.Snow(**given)], seed=3, fps=25
    )


def assert_moved(layer: Any, now: Any, after: Any, least: int) -> None:
    """The motion of a layer is the way of its flakes from one list to the next."""
    now, after = same_flakes(now, after)
    moved = dict(zip(now["id"].tolist(), after["pixel"] - now["pixel"], strict=True))
    places = [at for at in map(tuple, np.argwhere(layer.coverage > 0.7)) if layer.ids[at] in moved]
    assert len(places) > least
    want = [moved[layer.ids[at]] for at in places]
    np.testing.assert_allclose([layer.motion[at] for at in places], want, atol=1e-3)


def assert_kept(one: fl.Scene, path: Any) -> None:
    """A scene comes back from its file."""
    one.save(path)
    again = fl.open(path)
    assert np.array_equal(again.render(4), one.render(4)) and fingerprint(again) == fingerprint(one)


@pytest.mark.parametrize("wind", WINDS)
def test_the_weather_has_a_time_of_its_own(wind: str):
    """Under a camera at rest a frame is the one that the clock shows, by its integral."""
    plain, slow = scene(wind=WINDS[wind]), scene(wind=WINDS[wind], time=SLOW)
    at = np.linspace(0.0, 27.3, 200_001)
    clock = float(np.trapezoid(np.interp(at, *zip(*SLOW.keys, strict=True)), at))
    one, other = same_flakes(fl.flakes(slow, 27.3), fl.flakes(plain, clock))
    np.testing.assert_allclose(one["place"], other["place"], atol=1e-6)


def test_motion_and_streaks_go_by_the_weathers_time():
    slow = scene(time=SLOW)
    assert_moved(slow.layers(15.0).layers["snow"], *(fl.flakes(slow, t) for t in (15.0, 16.0)), 40)
    # The texture's too; and what stands still has no streak.
    half = scene(time=0.5, wind=(0.4, 0.0, 0.0), handover=2.0).layers(4).layers["snow"].motion
    whole = scene(wind=(0.4, 0.0, 0.0), handover=2.0).layers(2).layers["snow"].motion
    assert half is not None and whole is not None
    assert np.median(half[..., 1]) == pytest.approx(0.5 * np.median(whole[..., 1]), rel=0.05)
    still, open_ = (scene(time=0.0, shutter=shutter).layers(9).alpha for shutter in (0.0, 1.0))
    np.testing.assert_allclose(still, open_, atol=2e-6)


def test_a_layer_has_a_holdout_of_its_own():
    mask = np.zeros((160, 240), np.float32)
    mask[:, :100], mask[:, 100:120] = 1.0, 0.25
    one, other = scene(haze=0.1, color="local").effects[0], fl.Rain(rate=20.0)
    whole, cut = (
        scene().replace(effects=[replace(one, holdout=held), other]).layers(5).layers
        for held in (None, mask)
    )
    for name in ("snow", "snow.veil"):
        np.testing.assert_allclose(
            cut[name].rgba, whole[name].rgba * (1.0 - mask[..., None]), atol=1e-6
        )
    assert np.array_equal(cut["rain"].rgba, whole["rain"].rgba)


def texture(shown: fl.Scene, t: float = 5.0) -> Any:
    part = shown.effects[0].parts.texture
    return part.alpha(shown._program.views(t)[0][1], 1.0)


AHEAD = fl.CameraPath(fl.Camera(260.0), velocity=(0.0, 0.0, 1.0))


@pytest.mark.parametrize("camera", [None, AHEAD])
def test_a_picture_says_where_flakes_are(camera: Any):
    """Drawn ones are those of that amount, whole; what is far is as much thinner."""
    mask = np.ones((160, 240), np.float32)
    mask[:, 80:160], mask[:, 160:] = 0.5, 0.0
    plain, less, here = (
        scene(camera=camera, **fields) for fields in ({}, {"amount": 0.5}, {"where": mask})
    )
    want = [fl.flakes(one, 5) for one in (plain, less)]
    whole, part = (one[(one["pixel"][:, 0] >= low) & (one["pixel"][:, 0] < high)]
                   for one, low, high in zip(want, (-99, 81), (79, 159), strict=True))  # fmt: skip
    found = fl.flakes(here, 5)
    apart = np.abs(found["pixel"][:, :1] - (80, 160)).min(axis=1) > 1.0
    np.testing.assert_array_equal(
        np.sort(found[apart], order="id"), np.sort(np.concatenate([whole, part]), order="id")
    )
    before, after = texture(plain), texture(here)
    np.testing.assert_allclose(1.0 - after, (1.0 - before) ** mask, atol=1e-6)
    # No flake is cut, and what shows are these flakes.
    ids = here.layers(5).layers["snow"].ids
    assert ids is not None and set(ids[ids >= 0].tolist()) <= set(found["id"].tolist())


def test_it_counts_between_depths_and_may_be_a_function_or_a_number(tmp_path: Any):
    under = fl.effects.Where(lambda x, y: y < 0.5, near=3.0, far=10.0)
    plain, roofed = fl.flakes(scene(), 5), fl.flakes(scene(where=under), 5)
    gone = plain[np.isin(plain["id"], roofed["id"], invert=True)]
    assert (gone["pixel"][:, 1] > 79.0).all() and (gone["depth"] > 2.7).all() and len(gone) > 50
    below = roofed[(roofed["pixel"][:, 1] > 81.0) & (roofed["depth"] > 3.3)]
    assert len(below) == 0
    for camera in (None, AHEAD):
        one, other = (texture(scene(where=w, camera=camera)) for w in (None, under))
        np.testing.assert_allclose(one[:79], other[:79], atol=1e-6)
        assert 0.0 < other[82:].mean() < 0.9 * one[82:].mean()
    number = fl.Keys([(0, 1.0), (10, 0.0)])
    one, other = (fl.flakes(scene(**{name: number}), 5) for name in ("where", "amount"))
    np.testing.assert_array_equal(one, other)
    fl.io.write_picture(tmp_path / "roof.png", np.full((8, 12, 3), 255, np.uint8))
    for where in (str(tmp_path / "roof.png"), fl.effects.Where(number, near=3.0), 0.5):
        assert_kept(scene(where=where, holdout=where), tmp_path / "scene.toml")
    with pytest.raises(ValueError, match="where must be a file"):
        scene(where=under).save(tmp_path / "scene.toml")


@pytest.mark.parametrize("fields", [{}, {"camera": AHEAD}, {"haze": 0.1, "where": 0.7}])
def test_layers_by_depth_are_the_whole(fields: Any):
    whole, parted = (scene(**fields, split=split).layers(5) for split in (None, (3.0, 12.0)))
    names = ["snow.far", "snow.mid", "snow.near"]
    assert list(parted.layers) == names
    np.testing.assert_allclose(parted.alpha, whole.alpha, atol=2e-6)
    cover = np.prod([1.0 - parted.layers[name].coverage for name in names], axis=0)
    np.testing.assert_allclose(1.0 - cover, whole.layers["snow"].coverage, atol=2e-6)
    known = fl.flakes(scene(**fields), 5)
    np.testing.assert_array_equal(
        np.sort(fl.flakes(scene(**fields, split=(3.0, 12.0)), 5), order="id"),
        np.sort(known, order="id"),
    )
    depth = dict(zip(known["id"].tolist(), known["depth"], strict=True))
    for name, low, high in zip(names, (12.0, 3.0, 0.0), (np.inf, 12.0, 3.0), strict=True):
        layer = parted.layers[name]
        shown = {depth[number] for number in np.unique(layer.ids).tolist() if number >= 0}
        assert all(low <= far < high for far in shown)
        assert layer.depth is not None and layer.depth[layer.alpha > 0].min() >= 0.98 * low
        assert layer.depth[layer.alpha > 1e-5].max() <= 1.02 * high


def test_flakes_are_hidden_and_put_there_by_hand():
    fields: Any = {"sway": (0.1, 4.0), "clumps": 0.5, "time": 0.5}
    known = fl.flakes(scene(**fields), 8)
    near = known[np.argsort(known["depth"])[:3]]
    less = fl.flakes(scene(**fields, hide=near["id"].tolist()), 8)
    np.testing.assert_array_equal(less, known[np.isin(known["id"], near["id"], invert=True)])
    own = [(8.0, 0.2, -0.1, 20.0, 0.03), (-5.0, 0.1, -0.3, 1.5, 0.012)]
    for camera in (None, AHEAD):
        given = {**fields, "camera": camera, "amount": 0.01, "wind": (0.3, 0.0, 0.2)}
        shown = scene(**given, place=own)
        for t, *place, diameter in own:
            found, without = fl.flakes(shown, t), fl.flakes(scene(**given), t)
            new = found[np.isin(found["id"], without["id"], invert=True)]
            one = new[np.isclose(new["diameter"], diameter)]
            assert len(one) == 1
            np.testing.assert_allclose(one["place"][0], place, atol=1e-9)
            # It goes on as others of its size do, but for its sway.
            later = fl.flakes(shown, t + 50)
            moved = later["place"][later["id"] == one["id"][0]] - one["place"]
            fall = fl.particles.sizes.snow_speed(np.array([diameter]))[0]
            swing = 0.1 * np.diff(np.sin(4.0 / 25.0 * 0.5 * np.array([t, t + 50])))[0]
            if len(moved):
                want = (0.3 + swing, fall, 0.2 + swing)
                np.testing.assert_allclose(moved[0], want, atol=1e-9)
    layer = scene(density=0.0, place=own).layers(8).layers["snow"]
    assert layer.ids is not None and len(np.unique(layer.ids)) == 3


@pytest.mark.parametrize("size", [0.8, (1.0, 0.5, 0.8)])
def test_flakes_go_around_bodies(size: Any):
    """By the map of the page, of the places without it; streaks and motion planes follow."""
    way = fl.Keys([(0, (-2.0, 0.0, 4.0)), (40, (2.0, 0.0, 4.0))])
    fields: Any = {"handover": 3.0, "camera": AHEAD, "density": 120.0, "sway": (0.0, 1.0)}
    plain, parted = scene(**{**fields, "handover": 9.0}), scene(
        **fields, wakes=[fl.effects.Body(way, size)]
    )  # fmt: skip
    for t in (19.0, 20.0):
        one, other = same_flakes(fl.flakes(plain, t), fl.flakes(parted, t))
        middle = np.array((-2.0 + 0.1 * t, 0.0, 4.0))
        away, half = one["place"] - middle, 0.5 * np.broadcast_to(size, 3)
        part = np.min(half / np.abs(away), axis=1)
        if np.ndim(size) == 0:
            part = half[0] / np.linalg.norm(away, axis=1)
        want = middle + away * np.cbrt(1.0 + part**3)[:, None]
        np.testing.assert_allclose(other["place"], want, atol=1e-8)
        out = np.abs(fl.flakes(parted, t)["place"] - middle) / half
        gone = np.linalg.norm(out, axis=1) if np.ndim(size) == 0 else out.max(axis=1)
        assert gone.min() > 0.999
    lists = (fl.flakes(parted, t) for t in (19.0, 20.0))
    assert_moved(parted.layers(19.0).layers["snow"], *lists, 10)


def test_flakes_sway_by_keys():
    """By the amplitude, and the rate's integral, of the weather's time; at rest none does."""
    keys = fl.Keys([(0, (0.0, 2.0)), (20, (0.12, 6.0))])
    # Phases are those of a sway at an angle of 0, and of a quarter.
    known = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.5 * np.pi * 25.0 / 15.0), keys]
    lists = [fl.flakes(scene(sway=sway, time=0.5), 30.0) for sway in known]
    for n in range(1, 4):
        lists[0], lists[n] = same_flakes(lists[0], lists[n])
    lists[1], lists[2] = (same_flakes(lists[0], one)[1] for one in lists[1:3])
    sines, cosines, got = (one["place"] - lists[0]["place"] for one in lists[1:])
    angle = np.trapezoid([2.0, 5.0], [0.0, 15.0]) / 25.0
    want = 0.09 / 0.1 * (np.cos(angle) * sines + np.sin(angle) * cosines)
    np.testing.assert_allclose(got, want, atol=1e-9)
    assert len(got) > 40 and np.abs(got).max() > 0.08
    hangs, sways = (scene(sway=sway, shutter=0.0) for sway in ((0.0, 0.0), keys))
    assert_moved(sways.layers(14.0).layers["snow"], *(fl.flakes(sways, t) for t in (14, 15)), 40)
    assert np.array_equal(hangs.render(0), sways.render(0))
    assert np.abs(texture(hangs, 14.0) - texture(sways, 14.0)).max() > 1e-3


def test_turbulence_has_a_pace_of_its_own():
    """Flakes are carried by the integral, along their undisturbed way, of waves that change so."""
    pace, wind, size = fl.Keys([(0, 1.0), (20, 0.0), (40, 3.0)]), WINDS["gusts"], (0.007,) * 3
    calm, own, same = (scene(wind=air, fall=1.4, sway=(0.0, 1.0), flake_size=size, turbulence=rate)
                       for air, rate in ((wind.mean, pace), (wind, pace), (wind, 1.0)))  # fmt: skip
    waves, ends, moved = wind.waves, (3.0, 31.0), []
    shared = [set(fl.flakes(one, t)["id"].tolist()) for one in (calm, own) for t in ends]
    ids = sorted(set.intersection(*shared))
    start, places = None, []
    for one in (calm, own):
        for t in ends:
            found = np.sort(fl.flakes(one, t), order="id")
            places.append(found["place"][np.isin(found["id"], ids)])
    start = places[0] - np.array((0.5, 1.4, 0.0)) * ends[0] / 25.0
    at = np.linspace(*ends, 20_001)
    changed = np.array([pace.integral(t) for t in at.tolist()])
    mean = waves.omega - waves.own - waves.k @ (0.5, 1.4, 0.0)
    turns = np.exp(-1j * (mean[:, None] * at + waves.own[:, None] * changed) / 25.0)
    carried = np.exp(1j * start @ waves.k.T) * np.trapezoid(turns, at, axis=1) / 25.0
    moved = (places[3] - places[2]) - (places[1] - places[0])
    np.testing.assert_allclose(moved, (carried @ waves.a).real, atol=1e-6)
    assert len(ids) > 20 and np.abs(moved).max() > 0.05
    shut = own.replace(effects=[replace(own.effects[0], shutter=0.0)])
    assert_moved(shut.layers(14.0).layers["snow"], *(fl.flakes(shut, t) for t in (14, 15)), 40)
    # At its own pace, and where no wind is uneven, it changes nothing.
    assert np.array_equal(scene(wind=wind).render(9), scene(wind=wind, turbulence=1.0).render(9))
    assert np.array_equal(scene(turbulence=pace).render(9), scene().render(9))
    assert np.abs(texture(own, 31.0) - texture(same, 31.0)).max() > 1e-3


def test_notes_are_kept_in_files(tmp_path: Any):
    body = fl.effects.Body(fl.Keys([(0, (0.0, 0.0, 3.0)), (9, (1.0, 0.0, 3.0))]), (1.0, 0.5, 0.5))
    one = scene(
        hide=[4711], place=[(3, 0.0, 0.0, 1.5, 0.02)], wakes=[body], time=SLOW, split=(3, 12),
        sway=fl.Keys([(0, (0.02, 4.0)), (9, (0.1, 2.0))]), turbulence=SLOW, wind=WINDS["gusts"],
    )  # fmt: skip
    assert_kept(one, tmp_path / "scene.toml")
    other = scene(hide=[4711], place=[(3, 0.0, 0.0, 1.5, 0.021)], wakes=[body], time=SLOW)
    assert fingerprint(other) != fingerprint(one)
