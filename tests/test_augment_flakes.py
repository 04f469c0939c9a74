"""Flakes of the weather for data sets: sheets that are kept, and what flakes cover."""

import math
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries import _core
from flurries.augment import sheets
from flurries.augment.air import Here

EACH = pytest.mark.parametrize("kind", ["Snowfall", "Rainfall"])


def here_of(weather: Any, shape: tuple[int, int], index: int = 0) -> Here:
    one = [np.empty(shape)], [weather.record(index=index)], None, [0.0], None
    return next(weather._airs(*one))


@EACH
@pytest.mark.parametrize("amount", [0.05, 0.33, 0.6, 1.0])
@pytest.mark.parametrize("profile", ["natural", "hard"])
def test_each_layer_hides_its_share(kind: str, profile: str, amount: float):
    """Over all of a sheet, whatever the amount differs by from its rung."""
    weather = getattr(fl.augment, kind)(amount=amount, profile=profile, seed=1)
    here = here_of(weather, (200, 220))
    assert here.request() is None
    total = 0.0
    for layer, own in zip(here.layers, here.sheets.layers, strict=True):
        columns, rows = own.period
        plane = np.empty((rows, columns), np.float32)
        _core.sheet_read(plane, (0, 0), [layer], None, True)
        taken = -math.log(1.0 - plane.mean(dtype=np.float64))
        total += taken
        if own.near > 1.1:
            wanted = here.thickness * (layer[4] - layer[3])
            assert taken == pytest.approx(wanted, rel=0.02)
    assert total == pytest.approx(here.thickness * (here.far - here.near), rel=0.01)


@EACH
def test_layers_are_their_product_and_nothing_depends_on_what_is_kept(kind: str):
    weather = getattr(fl.augment, kind)(severity=4, seed=1)
    dark = np.zeros((96, 130))
    first = weather(dark, index=5)
    sheets._SHEETS.clear()
    assert (weather(dark, index=5) == first).all()
    here = here_of(weather, dark.shape, 5)
    whole, left = np.empty(dark.shape, np.float32), np.ones(dark.shape)
    here.write(whole)
    for layer in here.layers:
        plane = np.empty(dark.shape, np.float32)
        _core.sheet_read(plane, (0, 0), [layer], None, True)
        left *= 1.0 - plane
    assert np.abs(whole - (1.0 - left)).max() < 1e-5 < whole.std()


@EACH
def test_pictures_of_one_weather_have_nothing_in_common(kind: str):
    weather = getattr(fl.augment, kind)(severity=3, wind=1.0, fall=5.0, exposure=0.01, seed=3)
    planes = [weather.apply(np.zeros((200, 200)), index=k).alpha for k in range(6)]
    alike = np.corrcoef([plane.ravel() for plane in planes])
    # Streaks make some hundred pixels alike.
    assert np.abs(alike - np.eye(6)).max() < 0.08


def test_a_process_keeps_some_bytes():
    sheets._SHEETS.clear()
    dark = np.zeros((64, 64), np.uint8)
    for size in range(40, 640, 8):
        fl.augment.Rainfall(severity=5, seed=1)(np.zeros((8, size), np.uint8), index=size)
    clip = np.stack([dark] * 20)
    fl.augment.Snowfall(severity=5, seed=1).clip(clip, index=1)
    assert sheets._SHEETS.bytes <= 1.2 * sheets.MOST_BYTES


@pytest.mark.parametrize("wind", [-2.0, 2.0])
def test_streaks_of_sheets_lie_along_the_wind(wind: float):
    """The long axis of how alike a place and those around it are."""
    weather = fl.augment.Rainfall(severity=4, wind=wind, fall=6.0, exposure=0.03, seed=2)
    here = here_of(weather, (256, 256))
    plane = np.empty((256, 256), np.float32)
    _core.sheet_read(plane, (0, 0), here.layers, None, False)
    power = np.abs(np.fft.rfft2(plane - plane.mean(), s=(512, 512))) ** 2
    alike = np.fft.fftshift(np.fft.irfft2(power))[216:297, 216:297]
    alike = np.where(alike > 0.15 * alike.max(), alike, 0.0)
    y, x = np.mgrid[-40:41, -40:41]
    across, down, both = ((alike * part).sum() for part in (x * x, y * y, x * y))
    angle = 0.5 * math.atan2(2.0 * both, down - across)
    # Half of a step of directions, and what sheets of so few streaks differ by.
    assert angle == pytest.approx(math.atan2(wind, 6.0), abs=0.08 + 0.02)
