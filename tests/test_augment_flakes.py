"""Flakes of the weather for data sets: sheets that are kept, and what flakes cover."""

import math
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries import _core
from flurries.augment import falling, sheets
from flurries.augment.air import Here

EACH = pytest.mark.parametrize("kind", ["Snowfall", "Rainfall"])


def here_of(weather: Any, shape: tuple[int, int], index: int = 0) -> Here:
    one = [np.empty(shape)], [weather.record(index=index)], None, [0.0], None
    return next(weather._airs(*one))


@pytest.mark.parametrize("gain, ratio", [
    (0.3, 0.01), (1.0, 0.01), (4.0, 0.4), (1.5, 0.9), (2.0, 2.5), (30.0, 25.0),
])  # fmt: skip
def test_flakes_cover_what_their_images_do(gain: float, ratio: float):
    """A ball of diameter 1 at places along its way, each opacity a mean over times."""
    x, s = (np.arange(60) + 0.5) / 120, (np.arange(1200) + 0.5) / 1200 * (0.5 * ratio + 0.5)
    times = ((np.arange(2000) + 0.5) / 2000 - 0.5) * ratio
    total = 0.0
    for across in x:
        inside = 1.0 - 4.0 * (across**2 + (s[:, None] - times) ** 2)
        opacity = -np.expm1(-falling.MIDDLE * np.sqrt(np.maximum(inside, 0.0)))
        total += (1.0 - (1.0 - opacity.mean(axis=1)) ** gain).mean()
    area = 4.0 * total / len(x) * 0.5 * (0.5 * ratio + 0.5)
    got = falling._covered((1.0, 1.0, 1.0), gain, max(ratio, falling._REST))
    assert got == pytest.approx(area / (0.25 * math.pi), rel=0.02)


@EACH
@pytest.mark.parametrize("amount", [0.05, 0.33, 0.6, 1.0])
def test_each_layer_hides_its_share(kind: str, amount: float):
    """Over all of a sheet, whatever the amount differs by from its rung."""
    weather = getattr(fl.augment, kind)(amount=amount, seed=1)
    here = here_of(weather, (200, 220))
    assert here.falling is not None and here.sheets is not None and here.request() is None
    total = 0.0
    for layer, (near, far) in zip(here.layers, here.sheets.edges, strict=True):
        sheet, (x, y), *rest = layer
        columns, rows = here.sheets.periods[here.layers.index(layer)].astype(int).tolist()
        plane = np.empty((rows, columns), np.float32)
        _core.sheet_read(plane, (0, 0), [(sheet, (x, y), *rest)], None, True)
        taken = -math.log(1.0 - plane.mean(dtype=np.float64))
        total += taken
        if near > 1.1 * here.falling.near:
            assert taken == pytest.approx(here.falling.thickness * (far - near), rel=0.02)
    assert total == pytest.approx(here.falling.depth, rel=0.01)


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
