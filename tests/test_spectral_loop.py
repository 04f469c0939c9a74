"""Loops: a film that repeats exactly, in time and space, and moves as it should."""

import numpy as np
import pytest

import flurries as fl
import twin
import twin_volume

VELOCITY = (1.8, 3.6)
FRAMES = 60
SHAPE = (48, 64)
STILL = {"seed": 3, "dtype": np.float64}


def loop(**options) -> np.ndarray:
    return fl.spectral.loop(FRAMES, SHAPE, VELOCITY, **{**STILL, **options})


def test_rates_of_a_loop_are_whole_turns():
    for shape in (SHAPE, (9, 15), (8, 8)):
        plain = fl.spectral.tent_rate(shape, VELOCITY)
        rounded = fl.spectral.tent_rate(shape, VELOCITY, loop=FRAMES)
        assert np.array_equal(rounded, twin_volume.nearest(plain, FRAMES) / FRAMES)
        assert np.abs(rounded - plain).max() <= 0.5 / FRAMES
        # Odd, so that the film is real.
        assert np.array_equal(rounded, -twin.mirror(rounded))


def test_frames_are_the_2d_method_with_these_rates():
    film = loop()
    amplitude = fl.spectral.band_amplitude(SHAPE)
    phase = fl.spectral.random_phase(SHAPE, seed=3)
    rate = fl.spectral.tent_rate(SHAPE, VELOCITY, loop=FRAMES)
    for t in (0, 1, 17, 59):
        want = twin.inverse_transform(amplitude, phase + t * rate)
        assert np.abs(film[t] - want).max() < 1e-12


@pytest.mark.parametrize("periods", [1, -1, 1000, -(10**9)])
def test_the_loop_is_exact(periods: int):
    film = loop()
    again = loop(time=np.arange(FRAMES) + periods * FRAMES)
    assert np.array_equal(film, again)
    assert np.array_equal(loop(time=3), film[3])
    # Between frames, too, as far as the time itself can say it.
    assert np.abs(loop(time=3.25) - loop(time=3.25 + periods * FRAMES)).max() < 1e-12


def test_shutter_cut_and_jitter_act_on_the_rounded_rates():
    speed = (20.0, 30.0)
    options = {"alias": "cut", "shutter": 0.5}
    film = fl.spectral.loop(FRAMES, (64, 64), speed, time=[7.0], **STILL, **options)
    rate = fl.spectral.tent_rate((64, 64), speed, loop=FRAMES)
    amplitude = twin.without_aliases(twin.band_amplitude((64, 64)), rate, "cut", 0.4)
    amplitude = amplitude * np.sinc(0.5 * rate)
    phase = twin.random_phase((64, 64), seed=3)
    assert film.shape == (1, 64, 64)
    assert np.abs(film[0] - twin.inverse_transform(amplitude, phase + 7 * rate)).max() < 1e-12
    where = twin.jittered_directions((64, 64), 3, (0, 0))
    rate = -(where[1] * VELOCITY[0] + where[0] * VELOCITY[1]) / 32.0
    turned = phase + 7 * np.rint(rate * FRAMES) / FRAMES
    want = twin.inverse_transform(twin.band_amplitude((64, 64)), turned)
    got = fl.spectral.loop(FRAMES, (64, 64), VELOCITY, time=7, jitter=True, **STILL)
    assert np.abs(got - want).max() < 1e-12


def test_the_middle_of_an_exposure_is_the_mean_of_its_moments():
    # The box shutter is the mean of 256 sub-frames to 3e-5.
    moments = 5.0 + 0.8 * ((np.arange(256) + 0.5) / 256 - 0.5)
    blurred = loop(time=5, shutter=0.8)
    assert np.abs(loop(time=moments).mean(axis=0) - blurred).max() < 3e-5
