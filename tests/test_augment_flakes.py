"""Flakes of the weather for data sets: the kernel against the law it draws from, flake by flake."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries import _core
from flurries.augment import sheets
from flurries.augment.air import Here
from flurries.augment.flakes import NEAREST, Cloud, Flakes, flakes_at
from twin_particles import mix64

ALL = {"near": NEAREST, "reach": 9.0, "far": 9.0}
CLOUD = Cloud(density=1.45, **ALL, sizes=(0.01, 0.3), opacity=0.8, sway=(0.03, 2.0))
SHAPE = (240, 320)


def unit(seed: int, index: int) -> float:
    state = 0
    for key in (seed, 7001, index):
        state = mix64(state ^ (key & (2**64 - 1)))
    return (state >> 11) / 2**53


def found(cloud: Cloud, time: float, velocity: tuple[float, float], **more: Any) -> Flakes:
    flakes = flakes_at(
        cloud, SHAPE, fl.Camera(300.0), seed=-5, velocity=np.array([*velocity, 0.0]), time=time,
        exposure=0.01, **{"eyes": 0.0, **more},
    )  # fmt: skip
    assert flakes is not None
    return flakes


def twin(cloud: Cloud, time: float, velocity: tuple[float, float]) -> list[list[float]]:
    """x, y, z, radius, opacity, cover, angle of each flake, one by one from the description."""
    height, width = SHAPE
    room = 2.0 * cloud.sizes[1] + math.hypot(*velocity) * 0.01 + cloud.sway[0]
    soft = 4.0 * 320 / 1024 + 4.0

    def over(z: float) -> tuple[float, float]:
        margin = 2.0 * (room * 300.0 / z + soft)
        return width + margin, height + margin

    # The volume of the margins' pyramid, by the trapezes of 128 steps that are the law.
    knots = [NEAREST + (cloud.reach - NEAREST) * k / 128 for k in range(129)]
    law = [z * z * over(z)[0] * over(z)[1] for z in knots]
    sums = [0.0]
    for a, b in itertools.pairwise(law):
        sums.append(sums[-1] + 0.5 * (a + b))
    rows = []
    for i in range(round(cloud.density * sums[-1] * (knots[1] - knots[0]) / 300.0**2)):
        u = [unit(-5, 5 * i + k) for k in range(5)]
        wanted = u[0] * sums[-1]
        step = max(k for k in range(128) if sums[k] <= wanted)
        share = (wanted - sums[step]) / (sums[step + 1] - sums[step])
        z = knots[step] + share * (knots[step + 1] - knots[step])
        place = []
        for axis in range(2):
            span = over(z)[axis]
            turns = u[1 + axis] + velocity[axis] * time * 300.0 / z / span
            place.append((turns - math.floor(turns) - 0.5) * span * z / 300.0)
        angle = cloud.sway[1] * time + 2.0 * math.pi * u[4]
        place[0] += cloud.sway[0] * math.sin(angle)
        radius = 0.5 * (cloud.sizes[0] + u[3] * (cloud.sizes[1] - cloud.sizes[0]))
        sigma = 300.0 / z * radius / 3.0
        part = min(max((sigma - 9.0 * 320 / 1024) / (5.0 * 320 / 1024), 0.0), 1.0)
        opacity = cloud.opacity * (1.0 - 3.0 * part**2 + 2.0 * part**3)
        if opacity > 1e-15:
            cover = 2.0 * math.pi * opacity * sigma**2 / math.prod(over(z))
            rows.append([*place, z, radius, opacity, cover, angle])
    return rows


@pytest.mark.parametrize("time", [0.0, 0.7, -1234.5])
def test_flakes_are_those_of_the_description(time: float):
    wanted = np.array(twin(CLOUD, time, (0.4, 1.1)))
    got = found(CLOUD, time, (0.4, 1.1))
    columns = [*got.points.T, got.radius, got.opacity, got.cover, got.angle]
    assert len(wanted) == len(got.points) > 300
    np.testing.assert_allclose(np.stack(columns, 1), wanted, rtol=1e-9, atol=1e-12)
    # Some are so near that they fade.
    assert 0.0 < got.opacity.min() < 0.5 * CLOUD.opacity


def test_a_flake_crosses_at_its_own_speed():
    still = Cloud(density=1.45, **ALL, sizes=(0.01, 0.3), opacity=0.8)
    a, b = (found(still, t, (0.4, 1.1)) for t in (0.0, 0.001))
    moved = b.points - a.points
    near = np.abs(moved[:, :2] - [0.0004, 0.0011]).max(axis=1) < 1e-9
    # All but those that have left on one side and come back on the other.
    assert near.mean() > 0.99 and not moved[:, 2].any()


def test_depths_follow_the_law():
    many = Cloud(density=193.0, **ALL, sizes=(0.001, 0.002), opacity=0.5)
    z = np.sort(found(many, 0.0, (0.0, 1.0)).points[:, 2])
    knots = np.linspace(NEAREST, 9.0, 20_001)
    soft, room = 2.0 * (4.0 * 320 / 1024 + 4.0), 2.0 * (0.004 + 0.01)
    law = (320 + soft + room * 300 / knots) * (240 + soft + room * 300 / knots) * knots**2
    share = np.cumsum(law)
    expected = np.interp(z, knots, share / share[-1])
    rank = (np.arange(len(z)) + 0.5) / len(z)
    # Kolmogorov's distance: above 1.95 / sqrt(n) once in a thousand.
    assert np.abs(expected - rank).max() < 1.95 / math.sqrt(len(z))


def test_sizes_follow_their_quantiles():
    quantiles = (0.001, 0.0012, 0.0016, 0.003)
    many = Cloud(density=193.0, **ALL, sizes=quantiles, opacity=0.5)
    size = np.sort(2.0 * found(many, 0.0, (0.0, 1.0)).radius)
    expected = np.interp(size, quantiles, np.linspace(0.0, 1.0, 4))
    rank = (np.arange(len(size)) + 0.5) / len(size)
    assert np.abs(expected - rank).max() < 1.95 / math.sqrt(len(size))


def test_there_are_none_of_too_few():
    few = Cloud(density=1e-6, **ALL, sizes=(0.01, 0.3), opacity=0.8)
    arguments = {"seed": 1, "velocity": np.zeros(3), "time": 0.0, "exposure": 0.0, "eyes": 0.0}
    assert flakes_at(few, SHAPE, fl.Camera(300.0), **arguments) is None


@pytest.mark.parametrize("kind", ["Snowfall", "Rainfall"])
def test_a_sheet_goes_on_at_its_ends(kind: str):
    """What a row or column differs by from the next is at the ends as it is within."""
    weather = getattr(fl.augment, kind)(severity=4, seed=1, wind=1.0)
    here = Here(weather._air(weather.record(index=0)), view := weather._view((250, 300)),
                weather._distances(None, view), 0.0)  # fmt: skip
    assert here.part is not None
    for layer in (None, 0):
        plane = here.part.sheet(layer).values.astype(float)
        for axis in (0, 1):
            steps = np.abs(plane - np.roll(plane, 1, axis)).mean(1 - axis)
            assert steps[0] < 1.5 * steps[1:].mean(), (layer, axis)


def test_layers_of_sheets_are_their_sum_and_nothing_depends_on_what_is_kept():
    weather = fl.augment.Rainfall(severity=4, seed=1)
    dark = np.zeros((96, 130))
    first = weather(dark, index=5)
    sheets._KEPT.clear()
    assert (weather(dark, index=5) == first).all()
    here = Here(weather._air(weather.record(index=5)), view := weather._view(dark.shape),
                weather._distances(None, view), 0.0)  # fmt: skip
    assert here.part is not None
    planes = [np.empty(dark.shape, np.float32) for _ in range(2)]
    _core.sheet_fall(planes[0], [here.part.read()])
    _core.sheet_fall(planes[1], [here.part.read(k) for k in range(3)])
    # Each is kept in 16 bits.
    assert np.abs(planes[0] - planes[1]).max() < 2e-4 < planes[0].std()


@pytest.mark.parametrize("wind", [-2.0, 2.0])
def test_streaks_of_sheets_lie_along_the_wind(wind: float):
    """The long axis of how alike a place and those around it are."""
    weather = fl.augment.Rainfall(severity=4, wind=wind, fall=6.0, exposure=0.03, seed=2)
    here = Here(weather._air(weather.record(index=0)), view := weather._view((256, 256)),
                weather._distances(None, view), 0.0)  # fmt: skip
    assert here.part is not None
    plane = np.empty((256, 256), np.float32)
    _core.sheet_fall(plane, [here.part.read()])
    power = np.abs(np.fft.rfft2(plane - plane.mean(), s=(512, 512))) ** 2
    alike = np.fft.fftshift(np.fft.irfft2(power))[216:297, 216:297]
    alike = np.where(alike > 0.15 * alike.max(), alike, 0.0)
    y, x = np.mgrid[-40:41, -40:41]
    across, down, both = ((alike * part).sum() for part in (x * x, y * y, x * y))
    angle = 0.5 * math.atan2(2.0 * both, down - across)
    # Half of a step of directions, and what one sheet of so few streaks differs by.
    assert angle == pytest.approx(math.atan2(wind, 6.0), abs=0.05 + 0.02)


def test_streaks_do_not_end_in_lines():
    """Rows where tiles of a sheet meet, against all rows: 2.4 where they share 10 px."""
    weather = fl.augment.Rainfall(severity=4, seed=1)
    here = Here(weather._air(weather.record(index=0)), view := weather._view((600, 900)),
                weather._distances(None, view), 0.0)  # fmt: skip
    assert here.part is not None
    plane = here.part.sheet(None).values.astype(float)
    steps = np.abs(plane - np.roll(plane, 1, 0)).mean(axis=1)
    tiles = steps.reshape(here.part.key[0], -1).mean(axis=0)
    assert tiles.max() < 1.8 * tiles.mean()
