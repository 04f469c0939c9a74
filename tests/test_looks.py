"""Looks stay what they are: golden frames of every version."""

import numpy as np
import pytest

from flurries.effects import TentSnow
from flurries.effects.checks import LOOKS
from flurries.io import read_picture
from make_looks import ACROSS, FRAMES, HIGH, WIDE, frame, looks

NAMES = [(version, name) for version in LOOKS for name in looks(version)]

# Another processor's arithmetic, and 16 bits.
CLOSE = 2e-4


@pytest.fixture(scope="module")
def golden() -> dict[str, np.ndarray]:
    sheets = {v: read_picture(FRAMES / f"looks_{v}.png").pixels for v in LOOKS}
    return {v: s[..., 0] if s.ndim == 3 else s for v, s in sheets.items()}


@pytest.mark.parametrize(("version", "name"), NAMES)
def test_a_look_is_as_it_was(version: str, name: str, golden: dict[str, np.ndarray]):
    number = list(looks(version)).index(name)
    top, left = number // ACROSS * HIGH, number % ACROSS * WIDE
    want = golden[version][top : top + HIGH, left : left + WIDE] / 65535.0
    assert np.abs(frame(*looks(version)[name]) - want).max() < CLOSE


def test_golden_frames_tell_looks_apart(golden: dict[str, np.ndarray]):
    """The control: a hair more haze, or some flakes more, is another look."""
    number = list(looks("v1")).index("TentSnow moderate")
    top, left = number // ACROSS * HIGH, number % ACROSS * WIDE
    want = golden["v1"][top : top + HIGH, left : left + WIDE] / 65535.0
    for effect in (TentSnow(haze=0.041), TentSnow(mean=0.051), TentSnow(flakes=8800)):
        assert np.abs(frame(effect, (512, 384)) - want).max() > 2.0 * CLOSE
