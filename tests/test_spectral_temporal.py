"""Temporal aliasing, the soft roll-off, the box shutter, and the waves that never move."""

from __future__ import annotations

import numpy as np
import pytest

import flurries as fl
import twin
from every import every
from flurries.spectral.tables import temporal_gain, wave_depth


@every("renormalise", [False, True])
@every("shutter", [0.0, 0.5, 1.0, 3.0])
@every("alias", ["cut", "soft", "keep"])
@every("shape", [(64, 64), (31, 31), (40, 33)])
def test_temporal_filter_is_the_twins(
    shape: twin.Shape, alias: str, shutter: float, renormalise: bool
):
    amplitude = 3.0 * twin.band_amplitude(shape, wavelengths=(3.0, 30.0))
    options = {
        "shift_rate": (0.9, -0.4), "alias": alias, "soft_from": 0.3, "shutter": shutter,
        "renormalise": renormalise, "wavelength_max": 30.0,
    }  # fmt: skip
    got = fl.spectral.temporal_filter(amplitude, (14.0, 9.0), **options)
    want = twin.temporal_filter(amplitude, (14.0, 9.0), **options)
    assert got.dtype == np.float64 and got.shape == shape
    assert np.abs(got - want).max() < 1e-14
    assert np.array_equal(got == 0.0, want == 0.0)


@pytest.mark.parametrize("shutter", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("alias", ["cut", "soft", "keep"])
def test_the_gain_of_a_rate_is_the_equations(alias: str, shutter: float):
    rate = np.linspace(-0.9, 0.9, 1201)[:, None] * np.ones(2)
    speed = np.abs(rate)
    want = np.sinc(rate * shutter)
    if alias != "keep":
        want = want * (speed < 0.5 - 1e-12)
    if alias == "soft":
        want = want * np.cos(0.5 * np.pi * np.clip((speed - 0.3) / 0.2, 0.0, 1.0)) ** 2
    got = temporal_gain(rate, alias=alias, soft_from=0.3, shutter=shutter)
    assert got.shape == rate.shape
    np.testing.assert_allclose(got, want, atol=1e-15)
    # The half cycle itself has no direction.
    half = temporal_gain([0.5, -0.5, 0.5 - 1e-13], alias=alias, soft_from=0.3)
    assert (half == (1.0 if alias == "keep" else 0.0)).all()


def test_a_wave_stands_for_the_depth_at_which_a_flake_moves_as_it_does():
    near, longest, focal = 3.5, 32.0, 400.0
    waves = np.array([4.0, 10.0, 32.0])
    depth = wave_depth(waves, near_depth=near, longest=longest)
    camera, box = fl.Camera(focal), (64, 64)
    drift = fl.camera.tile_drift(box, (0.1, 0.2, 0.0), camera, near_depth=near)[0, 0]
    flakes = np.column_stack([np.zeros((3, 2)), depth])
    moved = fl.camera.project(flakes - np.array([0.1, 0.2, 0.0]), camera, box)[0]
    moved -= fl.camera.project(flakes, camera, box)[0]
    np.testing.assert_allclose(drift * (waves / longest)[:, None], moved, rtol=1e-12)
    back = wave_depth(depth, near_depth=near, longest=longest)
    np.testing.assert_allclose(back, waves, rtol=1e-15)
    assert wave_depth(0.0, near_depth=near, longest=longest) == np.inf
