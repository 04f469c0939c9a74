"""Tiles without seams, the same in a larger picture; spectra and motions of the caller's own."""

from typing import Any

import numpy as np
import pytest

import flurries as fl
import textured
import twin
from every import every
from flurries.spectral.tiles import power_shares


@every("blend", ["power", "linear"])
@every("overlap", [0, 10, 40])
@every(("old", "new"), [((100, 150), (170, 150)), ((128, 64), (128, 300)),
                                          ((90, 90), (91, 92)), ((64, 64), (65, 65))])  # fmt: skip
def test_growing_the_picture_keeps_old_pixels(old, new, overlap: int, blend: str):
    # Tiles that stick out count whole, so a pixel changes only where a new tile reaches it.
    arguments = {"drift": (4.0, 9.0), "seed": 21, "overlap": overlap, "blend": blend}
    before = textured.field(old, **arguments)
    after = textured.field(new, **arguments)
    counts = [len(twin.tile_starts(n, overlap=overlap)) for n in old]
    kept = tuple(slice(0, min(n, c * (64 - overlap))) for n, c in zip(old, counts, strict=True))
    assert before[kept].size > 0
    assert np.array_equal(before[kept], after[kept])


CASES = (
    (100, 32, 8), (70, 16, 0), (95, 24, 12), (20, 32, 5), (90, 20, 19), (61, 60, 59), (118, 64, 10),
)  # fmt: skip


@pytest.mark.parametrize("blend", ["power", "linear"])
@pytest.mark.parametrize(("length", "tile", "overlap"), CASES)
def test_power_is_that_of_independent_tiles(length: int, tile: int, overlap: int, blend: str):
    shares, power = power_shares(length, tile=tile, overlap=overlap, blend=blend)
    count = len(fl.spectral.tile_starts(length, tile=tile, overlap=overlap))
    assert shares.shape == (length, count)
    # Of independent tiles the variances add up: the squares of what the blend makes of each alone.
    for number in range(count):
        tiles = np.zeros((count, 1, tile, tile))
        tiles[number] = 1.0
        alone = fl.spectral.blend_tiles(tiles, (length, 1), overlap=overlap, blend=blend)[:, 0]
        # Across there is one tile, whose weight is 1.
        assert np.abs(alone**2 - shares[:, number] * power).max() < 1e-14
    assert shares.sum(axis=1) == pytest.approx(1.0, abs=1e-14)
    if blend == "power":
        assert power == pytest.approx(1.0, abs=1e-14)
    elif overlap == 10:
        # A half at the edges and a quarter at the corners, where two tiles count alike but for .1.
        assert power.min() == pytest.approx(0.45**2 + 0.55**2)
    elif overlap > 0 and count > 1:
        assert power.min() < 0.76


SHAPE, TILE, OVERLAP = (26, 31), (16, 12), 4
SIZES: dict[str, Any] = {"tile": TILE, "overlap": OVERLAP, "dtype": np.float64}

FY, FX = np.meshgrid(*map(np.fft.fftfreq, TILE), indexing="ij")
# An envelope of one half of the plane, as a Gabor's, and waves of deep water that run to the right,
# odd in k but where k is its own mirror.
BLOB = np.exp(-((FX - 0.2) ** 2 + (FY - 0.1) ** 2) / (2 * 0.06**2))
RATES = -0.4 * np.sign(FX) * np.sqrt(np.hypot(FX, FY))


def summed(envelope: np.ndarray, rate: np.ndarray, time: float, seed: int) -> np.ndarray:
    """The frame by the twin's cosines: no kernel and no transform."""
    even = envelope + twin.mirror(envelope)
    even[0, 0] = 0.0
    even /= np.sqrt((even**2).sum())
    odd = 0.5 * (rate - twin.mirror(rate))
    rows, cols = (
        len(twin.tile_starts(n, tile=m, overlap=OVERLAP)) for n, m in zip(SHAPE, TILE, strict=True)
    )
    tiles = np.zeros((rows, cols, *TILE))
    for place in np.ndindex(rows, cols):
        phase = twin.random_phase(TILE, seed=seed, tile=(place[0], place[1]))
        tiles[place] = twin.direct_sum(even, phase + odd * time)
    return twin.blend_tiles(tiles, SHAPE, overlap=OVERLAP)


@pytest.mark.parametrize("time", [0.0, 12.25, -3e6])
def test_a_field_is_the_sum_of_its_waves(time: float):
    want = summed(BLOB, RATES, time, 5)
    got = textured.field(SHAPE, seed=5, envelope=BLOB, rate=RATES, time=time, **SIZES)
    # Phases of 1e6 cycles keep 1e-10 of one.
    assert np.abs(got - want).max() < 1e-12 + 1e-14 * abs(time)
    single = textured.field(
        SHAPE, seed=5, envelope=3e-9 * BLOB, rate=RATES, time=time, tile=TILE, overlap=OVERLAP
    )
    assert single.dtype == np.float32 and np.abs(single - want).max() < 1e-5


def test_the_paper_is_one_spectrum_and_one_law_of_many():
    v, t = (0.7, 1.9), 9.5
    options = {**SIZES, "wavelengths": (3.0, 12.0), "alias": "soft", "shutter": 0.7, "seed": 2}
    still = {"shift": (1.0, 2.5), "shift_rate": (0.1, -0.3), "shortest": np.full((2, 4), 4.0)}
    want = twin.field(
        SHAPE, drift=np.multiply(v, t), velocity=v,
        **{k: o for k, o in options.items() if k != "dtype"}, **still,
    )  # fmt: skip
    paper = twin.band_amplitude(TILE, wavelengths=(3.0, 12.0))
    law = twin.tent_rate(TILE, v, wavelength_max=12.0)
    got = textured.field(SHAPE, envelope=paper, rate=law, time=t, **options, **still)
    assert np.abs(got - want).max() < 1e-12
    # The spectrum alone, moved by drift and velocity as ever.
    got = textured.field(
        SHAPE, envelope=paper, drift=np.multiply(v, t), velocity=v, **options, **still
    )
    assert np.abs(got - want).max() < 1e-12


CLOUD: dict[str, Any] = {
    "frequency": 0.12, "frequency_bandwidth": 0.3, "orientation": 0.7,
    "orientation_bandwidth": 0.25, "speed_bandwidth": 0.4,
}  # fmt: skip


def test_the_bandwidths_of_a_cloud_are_those_of_its_films_spectrum():
    size, frames, (vx, vy) = 128, 64, (1.0, -0.5)
    cloud = fl.spectral.cloud(size, (vx, vy), seed=3, loop=frames, **CLOUD)
    film = fl.spectral.movie(frames, (size, size), seed=4, texture=cloud, dtype=np.float64)
    power = np.abs(np.fft.fftn(film)) ** 2
    ft, fy, fx = np.meshgrid(*map(np.fft.fftfreq, film.shape), indexing="ij")
    f = np.maximum(np.hypot(fx, fy), 1e-9)
    power /= power.sum()

    def deviation(off: np.ndarray) -> tuple[float, float]:
        middle = float((power * off).sum())
        return middle, float(np.sqrt((power * (off - middle) ** 2).sum()))

    assert deviation(np.log2(f / 0.12)) == pytest.approx((0.0, 0.3), abs=0.01)
    # From -90 to 90 degrees, since a wave and its opposite are one.
    angle = np.arctan(np.tan(np.arctan2(fy, fx) - 0.7))
    assert deviation(angle) == pytest.approx((0.0, 0.25), abs=0.01)
    # Of some 800 waves' speeds; rates are rounded by up to half a bin.
    away = ft + fx * vx + fy * vy
    found = deviation((away - np.round(away)) / f)
    assert found == pytest.approx((0.0, 0.4), abs=0.03)


def test_a_movie_is_its_fields_with_the_contrast_that_is_asked_for():
    cloud = fl.spectral.cloud((32, 48), (1.5, 0.5), seed=3, loop=8, **CLOUD)
    film = fl.spectral.movie(9, (32, 48), seed=4, texture=cloud, contrast=0.2, mean=0.4)
    for t, frame in enumerate(film):
        field = fl.spectral.field((32, 48), seed=4, texture=cloud, time=float(t))
        assert np.abs(frame - 0.4 * (1.0 + 0.2 * field)).max() < 1e-6
        assert frame.std() / frame.mean() == pytest.approx(0.2, abs=1e-5)
    assert np.abs(film[8] - film[0]).max() < 1e-5
    snow = fl.spectral.movie(3, (40, 50), seed=1, velocity=(1.0, 3.0))
    assert np.array_equal(snow[2], fl.spectral.field((40, 50), seed=1, drift=(2.0, 6.0)))
