"""Films that repeat: the 3-D method, and loops that repeat exactly in time and space."""

from __future__ import annotations

import numpy as np
import pytest

import flurries as fl
import twin
import twin_volume
from every import every

C = 0.2  # cycles per frame
FRAMES = 64


def drift(c: float, degrees: float = 63.0, longest: float = 32.0) -> np.ndarray:
    angle = np.radians(degrees)
    return c * longest * np.array([np.cos(angle), np.sin(angle)])


def volume(frames: int = FRAMES, size: int = 64, c: float = C, **options) -> np.ndarray:
    options = {"seed": 1, "dtype": np.float64, **options}
    longest = options.get("wavelengths", (4.0, 32.0))[1]
    return fl.spectral.volume(frames, size, drift(c, longest=longest), **options)


SIZES = [(16, 16, (2.0, 8.0)), (15, 15, (2.0, 8.0)), (9, 14, (3.0, 9.0)), (24, 13, (4.0, 13.0))]


@every("cells", ["one", "overlap"])
@every(("frames", "size", "band"), SIZES)
def test_the_film_is_numpys_inverse_transform(frames: int, size: int, band, cells: str):
    cube = twin_volume.spectrum(
        frames, (size, size), drift(C, longest=band[1]), seed=4, wavelengths=band, cells=cells
    )
    want = twin_volume.film(cube)
    got = volume(frames, size, seed=4, wavelengths=band, cells=cells)
    assert np.abs(got - want).max() < 1e-13
    single = volume(frames, size, seed=4, wavelengths=band, cells=cells, dtype=np.float32)
    assert single.dtype == np.float32
    assert np.abs(single - want).max() < 4e-6


OCTAVES = [(16.0, 32.0), (8.0, 16.0), (4.0, 8.0)]  # coarse first


def octave_powers(film: np.ndarray) -> np.ndarray:
    power = np.mean(np.abs(np.fft.fft2(film)) ** 2, axis=0)
    size = film.shape[1]
    return np.array([power[twin.band((size, size), octave)].sum() for octave in OCTAVES])


def cells_per_column(film: np.ndarray) -> list[float]:
    cube = np.abs(np.fft.fftn(film, norm="forward"))
    size = film.shape[1]
    held = (cube > 1e-9 * cube.max()).sum(axis=0)
    return [float(held[twin.band((size, size), octave)].mean()) for octave in OCTAVES]


@pytest.mark.parametrize(
    ("turns", "most", "least", "powers"),
    [(2.0, 1.6, 1.1, (1.69, 1.19, 1.0)), (32.0, 10.6, 3.2, (3.8, 1.8, 1.0))],
)
def test_overlap_breaks_equal_octaves(turns: float, most: float, least: float, powers):
    # With one cell per column octaves hold what the lattice gives them, 1.139 : 1.048 : 1.019.
    frames = 128
    one = octave_powers(volume(frames, c=turns / frames))
    assert one / one[2] == pytest.approx([1.118, 1.028, 1.0], abs=2e-3)
    film = volume(frames, c=turns / frames, cells="overlap")
    count = cells_per_column(film)
    assert (count[0], count[2]) == pytest.approx((most, least), abs=0.05)
    measured = octave_powers(film)
    assert measured / measured[2] == pytest.approx(powers, abs=0.02)


def test_warnings_say_what_would_disappoint():
    with pytest.warns(UserWarning, match="backwards"):
        volume(16, c=0.6)
    with pytest.warns(UserWarning, match="to rest"):
        volume(4, c=0.1)
    with pytest.warns(UserWarning, match="32 % of the waves to rest"):
        fl.spectral.loop(30, (64, 64), (0.0, 1.1), seed=1)
    with pytest.warns(UserWarning, match="holds none longer"):
        volume(16, 24)
    volume(16, c=0.0)  # still snow is asked for


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_cells_on_the_tent_turn_less_than_a_cycle_a_frame():
    with pytest.raises(ValueError, match="velocity"):
        fl.spectral.volume(8, 64, (40.0, 0.0), seed=1, cells="overlap")


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_tile_too_small_for_its_waves_is_refused():
    with pytest.raises(ValueError, match="wavelengths"):
        fl.spectral.volume(8, 3, (8.0, 8.0), seed=1)


VELOCITY = (1.8, 3.6)
LENGTH = 60
SHAPE = (48, 64)
STILL = {"seed": 3, "dtype": np.float64}


def loop(**options) -> np.ndarray:
    return fl.spectral.loop(LENGTH, SHAPE, VELOCITY, **{**STILL, **options})


def test_rates_of_a_loop_are_whole_turns():
    for shape in (SHAPE, (9, 15), (8, 8)):
        plain = fl.spectral.tent_rate(shape, VELOCITY)
        rounded = fl.spectral.tent_rate(shape, VELOCITY, loop=LENGTH)
        assert np.array_equal(rounded, twin_volume.nearest(plain, LENGTH) / LENGTH)
        assert np.abs(rounded - plain).max() <= 0.5 / LENGTH
        # Odd, so that the film is real.
        assert np.array_equal(rounded, -twin.mirror(rounded))


def test_frames_are_the_2d_method_with_these_rates():
    film = loop()
    amplitude = fl.spectral.band_amplitude(SHAPE)
    phase = fl.spectral.random_phase(SHAPE, seed=3)
    rate = fl.spectral.tent_rate(SHAPE, VELOCITY, loop=LENGTH)
    for t in (0, 1, 17, 59):
        want = twin.inverse_transform(amplitude, phase + t * rate)
        assert np.abs(film[t] - want).max() < 1e-12


@pytest.mark.parametrize("periods", [1, -1, 1000, -(10**9)])
def test_the_loop_is_exact(periods: int):
    film = loop()
    again = loop(time=np.arange(LENGTH) + periods * LENGTH)
    assert np.array_equal(film, again)
    assert np.array_equal(loop(time=3), film[3])
    # Between frames, too, as far as the time itself can say it.
    assert np.abs(loop(time=3.25) - loop(time=3.25 + periods * LENGTH)).max() < 1e-12


def test_shutter_cut_and_jitter_act_on_the_rounded_rates():
    speed = (20.0, 30.0)
    options = {"alias": "cut", "shutter": 0.5}
    film = fl.spectral.loop(LENGTH, (64, 64), speed, time=[7.0], **STILL, **options)
    rate = fl.spectral.tent_rate((64, 64), speed, loop=LENGTH)
    amplitude = twin.without_aliases(twin.band_amplitude((64, 64)), rate, "cut", 0.4)
    amplitude = amplitude * np.sinc(0.5 * rate)
    phase = twin.random_phase((64, 64), seed=3)
    assert film.shape == (1, 64, 64)
    assert np.abs(film[0] - twin.inverse_transform(amplitude, phase + 7 * rate)).max() < 1e-12
    where = twin.jittered_directions((64, 64), 3, (0, 0))
    rate = -(where[1] * VELOCITY[0] + where[0] * VELOCITY[1]) / 32.0
    turned = phase + 7 * np.rint(rate * LENGTH) / LENGTH
    want = twin.inverse_transform(twin.band_amplitude((64, 64)), turned)
    got = fl.spectral.loop(LENGTH, (64, 64), VELOCITY, time=7, jitter=True, **STILL)
    assert np.abs(got - want).max() < 1e-12
