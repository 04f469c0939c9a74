"""What `fl.match` finds in clips of the float64 twin; 40 of them: `python docs/make_match.py`."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import flurries as fl
from films import snowfall, write
from flurries.matching.candidate import Peaks, nearer
from flurries.matching.match import Match, Unmatched
from flurries.matching.streaks import Way, found_again
from plates_with_snow import MOST, Case, case, clip, errors_of, noisy, plate
from test_cli import Run, here, run


def tint(found: Match, one: Case) -> float:
    """Return how far a match's channels are off, apart from their mean."""
    off = fl.io.linear_to_srgb(np.array(found.light.snow)) - one.color
    return float(np.abs(off - off.mean()).max())


def test_the_numbers_of_a_clip_of_the_twin_are_found(tmp_path: Path):
    one = case(8, (400, 224), 16)  # One of few flakes that is told well.
    found = fl.match(clip(one, tmp_path), camera=fl.Camera(one.view.focal))
    off = errors_of(found, one)
    assert found.fps == one.view.fps and all(abs(off[name]) <= MOST[name] for name in MOST), off
    other = found.scene("#203040", size=(96, 64))
    assert other.effects[0] == found.snow and other.light is None
    assert tint(found, one) < 0.04, found.light
    picture = fl.io.open_background(clip(one, tmp_path)).frame(3).pixels
    found = fl.match(picture, noisy(plate(one, 0.0), 0), fl.Camera(one.view.focal), one.view.fps)
    assert abs(math.degrees(found.direction) - one.direction) < 10.0 and tint(found, one) < 0.04
    assert abs(found.snow.density / one.law.density - 1.0) < 3.0 * found.errors["density"]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"count": 1}, "clean"), ({"count": 4}, "needs 8"), ({"count": 0}, "frames"),
        ({"frames": [np.zeros(3)] * 9}, "frames"), ({"fps": -1.0}, "fps"),
        ({"clean": np.zeros((9, 9, 3))}, "clean"), ({"camera": 2}, "camera"),
    ],
)  # fmt: skip
def test_what_is_no_film_of_a_camera_is_refused(given: dict, words: str):
    frames = snowfall(given.pop("count", 9))
    with pytest.raises((TypeError, ValueError), match=words):
        fl.match(**{"frames": frames, **given})


@pytest.mark.parametrize("what", ["noise", "shaking", "something that moves", "rain"])
def test_what_is_no_snow_is_refused_with_a_sentence(what: str):
    still = plate(case(0), 0.0)[:192, :320]
    rain = fl.Scene((255.0 * still).astype(np.uint8), effects=[fl.Rain(rate=20.0)], fps=25)
    frames = []
    for t in range(16):
        picture = rain.render(t) / 255.0 if what == "rain" else still.copy()
        if what == "shaking":
            shift = np.random.default_rng(t).integers(-3, 4, 2).tolist()
            picture = np.roll(still, shift, axis=(0, 1))
        if what == "something that moves":
            picture[60:120, 20 + 10 * t : 60 + 10 * t] = 0.9
        frames.append(noisy(picture, t))
    with pytest.raises(Unmatched, match=r"no snow|not like falling snow|no fall|light of flakes"):
        fl.match(frames, fps=25)


def test_the_scene_of_a_clip_is_the_clip_again_also_by_the_command(run: Run, here: Path):
    frames = snowfall()
    write("snow.mp4", frames, 25)
    words = "match", "snow.mp4", "--focal", "384", "-o", "fall.toml", "--report", "fit.png"
    code, out, err = run(*words)
    assert code == 0 and "flakes per m3" in out and Path("fit.png").exists(), err
    again = fl.open("fall.toml")
    real, made = (
        np.std(film, axis=0).mean() for film in (frames, [again.render(t) for t in range(24)])
    )
    assert made == pytest.approx(real, rel=0.35)
    assert run(*words)[0] == 2


def test_what_shows_the_same_snow_asks_on_average_for_no_change():
    chance = np.random.default_rng(3)
    many = chance.poisson(900.0, 60).tolist()
    shown = [
        Peaks(10**6, 1, 0.016 + 0.016 * chance.pareto(1.5, n), *chance.random((1, n)),
              chance.integers(0, 3, n), chance.random(9))
        for n in many
    ]  # fmt: skip
    pairs = [*pairwise(shown), *pairwise(shown[::-1])]
    changes = [nearer(*pair, 1.2, np.zeros(3), 1e-3 * np.eye(3))[0] for pair in pairs]
    assert np.abs(np.mean(changes, axis=0)).max() < 0.03


def test_a_streak_is_as_long_as_the_part_of_its_way_that_it_covers():
    def streak(x: float, y: float) -> np.ndarray:
        rows, columns = np.mgrid[:90, :90]
        return np.exp(-0.02 * ((columns - x) ** 2 + (rows - y) ** 2))

    frames, place = (streak(30.0, 30.0), streak(42.0, 46.0)), np.array([[30, 30]])
    far, long = found_again(*frames, place, Way(0.6, 0.8, 0.0))
    assert far == [20.0] and long == pytest.approx(5.0 * math.sqrt(2.0 * math.pi) / 20.0, rel=0.03)
    far, long = found_again(*frames[::-1], np.array([[46, 42]]), Way(0.6, 0.8, 0.0).back())
    assert far == [20.0] and found_again(*frames, place, Way(0.8, 0.6, 0.0))[0] == [0.0]


def test_the_command_leaves_the_camera_of_a_wide_plate_as_it_is(run: Run, here: Path):
    wide = [frame.repeat(3, 0).repeat(3, 1) for frame in snowfall(4)]
    fl.io.write_picture("plate.png", fl.io.fit(fl.io.photograph("coffee"), (960, 540)))
    fl.io.write_picture("snow.png", wide[3])
    words = "match", "snow.png", "--clean", "plate.png", "--focal", "1152", "-o", "a.toml"
    code, _, err = run(*words)
    assert code == 0 and fl.open("a.toml").camera.camera.focal == 1152.0, err
