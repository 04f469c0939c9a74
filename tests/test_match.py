"""What `fl.match` finds in clips whose flakes the float64 twin has drawn, and what it refuses.

The whole loop of 40 clips is `python docs/make_match.py`.
"""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest

import flurries as fl
from films import snowfall
from flurries.matching.match import Unmatched
from plates_with_snow import case, clip, misses, noisy, plate


def decoded(file: Path) -> list[np.ndarray]:
    with av.open(str(file)) as film:
        return [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]


def test_the_numbers_of_a_clip_of_the_twin_are_found(tmp_path: Path):
    one = case(8, frames=16)  # It takes little to draw.
    found = fl.match(clip(one, tmp_path), camera=fl.Camera(one.view.focal))
    assert found.fps == one.view.fps and not misses(found, one), (found, one)


def test_a_still_without_a_plate_and_too_few_frames_are_refused():
    frames = snowfall(24)
    with pytest.raises(ValueError, match="clean"):
        fl.match(frames[:1])
    with pytest.raises(ValueError, match="needs 8"):
        fl.match(frames[:4])
    for bad, words in (([], "frames"), ([np.zeros(3)] * 9, "frames"), (frames, "fps")):
        with pytest.raises((TypeError, ValueError), match=words):
            fl.match(bad, fps=-1.0)
    with pytest.raises((TypeError, ValueError), match="camera"):
        fl.match(frames[:9], camera=2)  # type: ignore[arg-type]


def shaken(picture: np.ndarray, seed: int) -> np.ndarray:
    """A picture moved by some pixels: a shaking hand's."""
    down, right = np.random.default_rng(seed).integers(-3, 4, 2)
    return np.roll(picture, (down, right), axis=(0, 1))


@pytest.mark.parametrize("what", ["noise", "shaking", "something that moves"])
def test_what_is_no_snow_is_refused_with_a_sentence(what: str):
    still = plate(case(0), 0.0)[:192, :320]
    frames = []
    for t in range(16):
        picture = shaken(still, t) if what == "shaking" else still.copy()
        if what == "something that moves":
            picture[60:120, 20 + 10 * t : 60 + 10 * t] = 0.9
        frames.append(noisy(picture, t))
    with pytest.raises(Unmatched, match=r"no snow|not like falling snow|no fall|light of flakes"):
        fl.match(frames, fps=25)


def test_the_scene_of_a_match_is_the_clip_again_and_another_shot_has_its_own_light():
    frames = snowfall()
    found = fl.match(frames, camera=fl.Camera(384.0), fps=25.0)
    again = found.scene()
    films = frames, [again.render(t) for t in range(24)]
    real, made = (np.std(film, axis=0).mean() for film in films)
    assert made == pytest.approx(real, rel=0.35) and found.report().shape == (180, 640, 3)
    other = found.scene("#203040", size=(96, 64))
    assert other.effects[0] == found.snow and other.light is None
