"""Wind over depth and gusts, measured on frames, in files and in copies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flurries as fl
import measure
from flurries.scene.fingerprint import fingerprint
from measure import FLAKES, FOCAL, LONGEST, NEAR, SIZE, TEXTURE, TORUS, WAVES, picture, scene
from test_wind import GRID, LENS, WINDS, Keys, Snow, Wind

SHEAR = [(NEAR, (1.0, 0.0, 0.0)), (4 * NEAR, (-1.5, 0.4, 0.0))]


def test_measured_on_frames_each_band_has_the_wind_of_its_depth():
    wind = Wind((0.3, 0.0, 0.0), profile=SHEAR)
    shown = scene({**TEXTURE, **TORUS, "wind": wind})
    for t in (3.0, 50.0):
        pair = picture(shown, t), picture(shown, t + 1.0)
        for wavelength in WAVES:
            moved, mean = measure.band_shift([pair], wavelength, 0.04)
            depth = NEAR * LONGEST / mean
            own = [np.interp(depth, [NEAR, 4 * NEAR], [a, b]) for a, b in ((1.0, -1.5), (0.0, 0.4))]
            want = np.array([0.3 + own[0], 1.4 + own[1]]) * FOCAL / 30.0 / depth
            ratio, turn = measure.against(moved, want)
            # Rings are a quarter octave wide, and each stands for one depth.
            assert abs(ratio - 1.0) < 0.05 and abs(turn) < 5.0
        # The calm texture moves otherwise.
        ratio, turn = measure.against(moved, np.array([0.3, 1.4]) * FOCAL / 30.0 / depth)
        assert abs(turn) > 20.0


def undisturbed(shown: fl.Scene, points: np.ndarray) -> np.ndarray:
    """Where the flakes at points would be in the mean wind alone."""
    snow = shown.effects[0]
    # As dense, in a wider view.
    calm = replace(snow, wind=snow.wind.mean, flakes=9 * snow.flakes)
    calm = shown.replace(effects=[calm], camera=fl.Camera(FOCAL / 3.0))
    here, there = (fl.flakes(one, 40.125) for one in (shown, calm))
    nearest = [np.abs(here["place"] - point).sum(axis=1).argmin() for point in points]
    places = dict(zip(there["id"].tolist(), there["place"], strict=True))
    return np.array([places[one] for one in here["id"][nearest].tolist()])


@pytest.mark.parametrize("kind", ["profile", "gusts", "flying"])
def test_measured_on_frames_flakes_have_the_wind_of_their_place(kind: str):
    profile = [(3.0, (2.0, 0.0, 0.0)), (10.0, (-2.0, 0.5, 0.0))]
    path = fl.CameraPath(LENS, velocity=(0.0, 0.0, 2.0)) if kind == "flying" else LENS
    wind = WINDS["both"] if kind == "gusts" else Wind((0.3, 0.0, 0.0), profile=profile)
    # The wind of a depth is that of the depth from where the camera began.
    off, flown = [], 2.0 * 40.125 / 30.0 if kind == "flying" else 0.0
    for seed in range(4):
        shown = scene({**FLAKES, "wind": wind}, camera=path, seed=seed)
        depth, x, y, *moved = measure.flake_shifts(shown, 40.0, 0.25).T
        points = np.stack([x - SIZE / 2.0, y - SIZE / 2.0, np.full_like(x, FOCAL)], axis=1)
        points *= depth[:, None] / FOCAL
        air = np.tile(wind.mean, (len(points), 1))
        if kind == "gusts":
            air = wind.velocity(undisturbed(shown, points), 40.125 / 30.0)
        else:
            for axis in range(3):
                ends = [v[axis] for _, v in profile]
                air[:, axis] += np.interp(points[:, 2] + flown, [3.0, 10.0], ends)
        air[:, 1] += 1.4
        if kind == "flying":
            air[:, 2] -= 2.0
        want = (
            FOCAL / 30.0 * (air[:, :2] - points[:, :2] / points[:, 2:] * air[:, 2:]) / points[:, 2:]
        )
        wrong = np.linalg.norm(np.transpose(moved) / 0.25 - want, axis=1)
        off.append(wrong / np.linalg.norm(want, axis=1).mean())
    off = np.concatenate(off)
    assert len(off) >= 10
    assert np.median(off) < 0.02 and np.quantile(off, 0.8) < 0.06


def test_a_texture_in_a_profile_wants_a_camera_that_does_not_turn():
    path = fl.CameraPath(LENS, orientation=[(0, 0, 0), (0, 0.01, 0)])
    shown = fl.Scene(size=(64, 48), camera=path, effects=[Snow(wind=Wind(profile=SHEAR), flakes=0)])
    with pytest.raises(ValueError, match="wind: a profile"):
        shown.render(3)


SCENES = {
    "gusts": {"wind": Wind((1.0, 0.0, 0.0), gusts=1.5, swirl=0.5)},
    "profile": {"wind": Wind((1.0, 0.0, 0.0), profile=SHEAR)},
    "field": {"wind": Wind((0.5, 0.0, 0.0), field=GRID, spacing=2.0, duration=4.0)},
}


@pytest.mark.parametrize("name", ["gusts", "profile"])
def test_nothing_pops(name: str):
    shown = scene({**FLAKES, "flakes": 1500, **SCENES[name]}, size=256)

    def frame(t: float) -> np.ndarray:
        return picture(shown, t)

    assert measure.smooth(measure.largest_changes(frame, np.array([0.0, 17.3, 55.1])))


@pytest.mark.parametrize("kind", ["gusts", "profile", "keyed profile"])
def test_scene_files_keep_the_wind(kind: str, tmp_path: Path):
    wind = {"gusts": Wind(Keys([(0, (1, 0, 0)), (9, (2, 0, 0))]), gusts=0.5, swirl=0.25, seed=9),
            "profile": Wind(profile=SHEAR),
            "keyed profile": Wind((1, 0, 0), profile=[(1, 0.5), (9, 2)])}  # fmt: skip
    shown = fl.Scene(size=(64, 48), effects=[Snow(wind=wind[kind], flakes=50)])
    shown.save(tmp_path / "scene.toml")
    again = fl.open(tmp_path / "scene.toml")
    assert again.effects == shown.effects and fingerprint(again) == fingerprint(shown)
    assert np.array_equal(again.render(3), shown.render(3))


def test_a_wind_by_hand_and_its_mistakes(tmp_path: Path):
    file = tmp_path / "scene.toml"
    head = "format = 3\n[[effects]]\nkind = 'tent_snow'\n"
    file.write_text(head + "wind = {mean = [1, 0, 0], gusts = 0.5}\n")
    assert fl.open(file).effects[0].wind == Wind((1, 0, 0), gusts=0.5)
    for text, words in (("wind = {mean = [1, 0, 0], gust = 0.5}", "line 4.*'gust'.*'gusts'"),
                        ("wind = {gusts = -1}", "line 4.*gusts"),
                        ("wind = {profile = {keys = [[1, [0, 1]]]}}", "line 4.*profile"),
                        ):  # fmt: skip
        file.write_text(head + text + "\n")
        with pytest.raises(ValueError, match=words):
            fl.open(file)
    with pytest.raises(ValueError, match="wind: a field"):
        fl.Scene(size=(64, 48), effects=[Snow(wind=Wind(field=GRID))]).save(file)
