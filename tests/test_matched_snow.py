"""MatchedSnow in scenes: the hybrid and the simulation look alike, before walls and in flight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flurries as fl

SIZE = (384, 256)  # width, height
FOCAL = 460.0
SNOW = fl.MatchedSnow(density=300.0, radius=(0.004, 0.01), depth=(1.0, 12.0), color=1.0)
BLACK = np.zeros((256, 384, 3), np.float32)


def scene(snow: fl.MatchedSnow = SNOW, **about) -> fl.Scene:
    about = {"camera": fl.CameraPath(fl.Camera(FOCAL)), **about}
    return fl.Scene(background=BLACK, effects=[snow], **about)


def picture(snow: fl.MatchedSnow, t: float = 20.0, **about) -> np.ndarray:
    return scene(snow, **about).render(t)[..., 0].astype(np.float64)


def both(shutter: float = 0.5, **about) -> list[np.ndarray]:
    """A few pictures of either method, stacked."""
    snow = replace(SNOW, shutter=shutter)
    return [
        np.stack([picture(replace(snow, method=method), seed=seed, **about) for seed in range(4)])
        for method in ("simulated", "hybrid")
    ]


@pytest.mark.parametrize(("shutter", "least", "most"), [(0.0, 0.95, 1.03), (0.5, 0.72, 0.95)])
def test_both_methods_have_one_opacity_and_contrast(shutter: float, least: float, most: float):
    # While the shutter is open a texture's waves of one length blur alike, flakes of many depths do
    # not: docs/matching.md.
    simulated, hybrid = both(shutter)
    assert simulated.mean() > 0.05
    assert hybrid.mean() == pytest.approx(simulated.mean(), rel=0.03)
    assert least < hybrid.std() / simulated.std() < most


def test_dropping_fast_waves_would_show():
    soft = picture(replace(SNOW, shutter=0.0, alias="soft"))
    assert soft.std() < 0.6 * picture(replace(SNOW, shutter=0.0)).std()


def test_a_flight_keeps_them_alike():
    path = fl.CameraPath(fl.Camera(FOCAL), velocity=(0.3, -0.2, 3.0))
    simulated, hybrid = both(camera=path)
    assert hybrid.mean() == pytest.approx(simulated.mean(), rel=0.05)


def test_walls_hide_what_is_behind():
    depth = np.full((256, 384), np.inf, np.float32)
    depth[:, :128] = 4.0
    depth[:, 128:192] = 0.5  # nearer than any snow
    simulated, hybrid = both(depth=depth)
    for part in (np.s_[:, :, :128], np.s_[:, :, 192:]):
        assert hybrid[part].mean() == pytest.approx(simulated[part].mean(), rel=0.06)
    assert simulated[:, :, :128].mean() < 0.6 * simulated[:, :, 192:].mean()
    assert simulated[:, :, 128:192].max() == hybrid[:, :, 128:192].max() == 0.0


def test_two_eyes_see_one_air():
    # An eye aside sees what a camera there would.
    snow = replace(SNOW, fall=0.0, wind=(0.0, 0.0, 0.0), shutter=0.0, alias="keep")
    shown = scene(snow)
    eye = shown.render(3, eye=fl.Camera(FOCAL, offset=(0.08, 0.0, 0.0)))
    path = fl.CameraPath(fl.Camera(FOCAL), velocity=(0.8, 0.0, 0.0))
    assert np.abs(eye - scene(snow, camera=path, fps=30.0).render(3)).max() < 1e-4
    assert np.abs(eye - shown.render(3)).max() > 0.1


def test_frames_are_pure():
    whole = scene().render(7)
    part = scene().render(7, region=np.s_[40:100, 30:200])
    assert np.array_equal(part, whole[40:100, 30:200])
    film = scene()
    later = [film.render(t) for t in (9, 7)]
    assert np.array_equal(later[1], whole)
    assert not np.array_equal(later[0], whole)


def test_it_goes_through_a_scene_file(tmp_path: Path):
    snow = replace(SNOW, handover=(0.5, 0.9), fall=fl.Keys([(0, 1.0), (9, 2.0)]))
    shown = fl.Scene((96, 64), "#102030", fl.CameraPath(fl.Camera(120.0)), [snow])
    shown.save(tmp_path / "scene.toml")
    again = fl.Scene.load(tmp_path / "scene.toml")
    assert again.effects == shown.effects
    assert np.array_equal(again.render(4), shown.render(4))


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("density", 0.0), ("radius", (0.2, 0.1)), ("opacity", 2.0), ("depth", (5.0, 1.0)),
        ("fall", np.nan), ("wind", (1.0, 2.0)), ("color", "red"), ("shutter", -1.0),
        ("method", "all"), ("handover", (2.0, 1.0)), ("tile", 2), ("overlap", -1),
        ("alias", "no"), ("jitter", 1), ("seed", 1.5),
    ],
)  # fmt: skip
def test_refusals_name_the_argument(name: str, bad):
    with pytest.raises((TypeError, ValueError), match=name):
        replace(SNOW, **{name: bad})


def test_a_camera_that_turns_is_refused():
    path = fl.CameraPath(
        fl.Camera(FOCAL), orientation=fl.Keys([(0, (0.0, 0.0, 0.0)), (10, (0.0, 1.0, 0.0))])
    )
    with pytest.raises(ValueError, match="does not turn"):
        scene(camera=path).render(3)
