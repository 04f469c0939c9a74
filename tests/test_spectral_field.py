"""The field and its opacity: twin, steps, limits, motion; seams of tiles; spectra of one's own."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flurries as fl
import textured
import twin
from every import every
from flurries.spectral.tiles import power_shares

LIMIT = {np.float64: 1e-12, np.float32: 2e-6}


def test_gains_are_not_taken_from_the_call_before():
    # Plans are kept from call to call; edges that end like another's gains must not be mistaken.
    options = {"drift": (5.0, -3.0), "seed": 3, "tile": 64}
    calls = [
        {"ring_edges": (2.0, 4.0, 8.0, 16.0, 32.0)},
        {"ring_edges": (2.0, 4.0, 8.0), "ring_gains": (16.0, 32.0)},
        {"ring_edges": (2.0, 4.0, 8.0), "ring_gains": (1.0, 32.0)},
        {"ring_edges": (2.0, 4.0, 8.0)},
    ]
    for _ in range(2):
        for call in calls:
            got = textured.field((64, 64), **options, **call, dtype=np.float64)
            assert np.abs(got - twin.field((64, 64), **options, **call)).max() < 1e-12


# Wavelengths that lattice waves meet exactly in some tile sizes, where a band's edge is decided.
EDGES = [2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 12.8, 16.0, 20.0, 32.0]


def asked(seed: int) -> tuple[twin.Shape, dict[str, Any]]:
    random = np.random.default_rng(seed)

    def maybe(share: float) -> bool:
        return bool(random.random() < share)

    tile = tuple(int(m) for m in random.integers(9, 66, 2))
    tile = tile if maybe(0.4) else (tile[0], tile[0])
    overlap = int(random.integers(0, min(tile) - 2))
    shape = tuple(int(random.integers(1, 2 * m - overlap)) for m in tile)
    rows, cols = (
        len(twin.tile_starts(n, tile=m, overlap=overlap)) for n, m in zip(shape, tile, strict=True)
    )
    rings = int(random.integers(1, 4)) if maybe(0.4) else 0

    def vectors(size: float, by_ring: bool = False) -> np.ndarray:
        """One vector for all tiles or one for each, and for each ring on request."""
        shape = ((rows, cols) if maybe(0.5) else ()) + ((rings,) if by_ring and rings else ())
        return random.uniform(-size, size, (*shape, 2))

    options: dict[str, Any] = {
        "seed": int(random.integers(-(2**63), 2**63 - 1)), "tile": tile, "overlap": overlap,
        "wavelengths": (float(random.choice(EDGES[:4])), float(random.choice(EDGES[5:]))),
        "exponent": float(random.choice([-0.5, 0.0, 0.5, 1.0, 2.0])), "jitter": maybe(0.4),
        "blend": str(random.choice(["power", "linear"])), "drift": vectors(30.0, by_ring=True),
    }  # fmt: skip
    if rings:
        options["ring_edges"] = np.sort(random.choice(EDGES, rings + 1, replace=False)).tolist()
    if maybe(0.5):
        options["shift"] = vectors(30.0)
    if maybe(0.6):
        options["velocity"] = vectors(30.0, by_ring=True)
        options["alias"] = str(random.choice(["cut", "soft", "keep"]))
        options["soft_from"] = float(random.uniform(0.0, 0.49))
        options["shutter"] = float(random.choice([0.0, 0.5, 1.0, 2.2]))
        if maybe(0.5):
            options["shift_rate"] = vectors(3.0)
    if maybe(0.3):
        options["shortest"] = random.choice(EDGES, (rows, cols))
    return shape, options


@every("seed", range(100))
def test_a_random_frame_is_the_twins(seed: int):
    shape, options = asked(seed)
    want = twin.field(shape, **options)
    for dtype, limit in LIMIT.items():
        with warnings.catch_warnings(), fl.settings(reproducible=seed % 2 == 1):
            warnings.simplefilter("ignore", UserWarning)  # some bands are longer than the tile
            got = textured.field(shape, **options, dtype=dtype)
        assert got.dtype == dtype
        assert np.abs(got - want).max() <= limit


MAPPED = {"mean": 0.4, "spread": 2.5, "amount": 0.9}
FIELD = {"drift": (3.0, 8.0), "seed": 17, "tile": 31, "overlap": 10, "wavelengths": (3.0, 30.0)}
FIELD |= {"velocity": (5.0, 20.0), "shutter": 0.5, "alias": "soft", "shift": (1.0, 0.5)}


@every("power", [1.0, 2.0, 2.5])
@every(("dtype", "limit"), [(np.float64, 1e-12), (np.float32, 2e-6)])
def test_alpha_is_opacity_of_field(dtype: type, limit: float, power: float):
    got = textured.alpha((70, 45), **FIELD, **MAPPED, power=power, dtype=dtype)
    steps = textured.field((70, 45), **FIELD, dtype=dtype)
    assert got.dtype == dtype and got.shape == (70, 45)
    want = fl.spectral.opacity(steps, **MAPPED, power=power)
    assert np.abs(got - want).max() <= limit
    slow = twin.opacity(twin.field((70, 45), **FIELD), **MAPPED, power=power)
    assert np.abs(got - slow).max() <= limit


def blurred(c: float, shutter: float, seed: int, **options) -> np.ndarray:
    """One torus of opacity, falling at c cycles per frame at 70 degrees."""
    velocity = (32.0 * c * np.cos(1.22), 32.0 * c * np.sin(1.22))
    return textured.alpha(
        (64, 64), drift=options.pop("drift", (0.0, 0.0)), seed=seed, overlap=0, velocity=velocity,
        shutter=shutter, dtype=np.float64, **options,
    )  # fmt: skip


@pytest.mark.parametrize("c", [0.3, 0.9, 2.0])
def test_preserve_mean(c: float):
    # Blurring the field and then squaring loses mean opacity; sigma^2 (1 - kappa) gives
    # it back, to 1e-3. Without it at least 0.003 is missing, and 0.0175 for fast snow.
    sharp = np.mean([blurred(c, 0.0, seed) for seed in range(40)])
    without = np.mean([blurred(c, 1.0, seed) for seed in range(40)])
    kept = np.mean([blurred(c, 1.0, seed, preserve_mean=True) for seed in range(40)])
    assert sharp == pytest.approx(0.2776, abs=5e-4)
    assert kept == pytest.approx(sharp, abs=1e-3)
    assert without < sharp - {0.3: 0.003, 0.9: 0.012, 2.0: 0.0175}[c]


S = fl.spectral
ONES = np.ones((16, 16))
PLAIN: dict[str, Any] = {"drift": (1.0, 1.0), "seed": 1, "tile": 32}


@every("size", [1, 2, 3, 4])
@every("name", ["band_amplitude", "field", "alpha"])
def test_a_band_without_waves_is_refused(name: str, size: int):
    """The message names the size of the tile and the argument to change."""
    with warnings.catch_warnings(), pytest.raises(ValueError, match="wavelengths") as refusal:
        warnings.simplefilter("ignore", UserWarning)
        if name == "band_amplitude":
            S.band_amplitude((size, size))
        else:
            getattr(textured, name)((40, 30), drift=(1.0, 2.0), seed=1, tile=size, overlap=0)
    assert str(size) in str(refusal.value)


@pytest.mark.parametrize("name", ["field", "alpha"])
def test_a_band_longer_than_the_tile_warns(name: str):
    with pytest.warns(UserWarning, match="wavelengths") as warned:
        getattr(S, name)((40, 30), drift=(1.0, 2.0), seed=1, texture=S.Texture(tile=24))
    # Shown at the caller's line, not somewhere inside.
    assert [w.filename for w in warned] == [__file__]


HUGE = 1.7e308
EXTREME: dict[str, Callable[[], Any]] = {
    **{f"drift {v}": lambda v=v: textured.field((40, 30), **{**PLAIN, "drift": (v, -v)})
       for v in (1e-310, 1e15, 1e100, HUGE)},
    "velocity, cut": lambda: textured.field((40, 30), **PLAIN, velocity=(HUGE, HUGE), alias="cut"),
    "velocity": lambda: textured.field((40, 30), **PLAIN, velocity=(HUGE, HUGE), shutter=1.0),
    "shift_rate": lambda: textured.field((40, 30), **PLAIN, velocity=(1.0, 1.0),
                                  shift_rate=(HUGE, -HUGE), shutter=1.0),
    "tent_rate": lambda: S.tent_rate((16, 16), (HUGE, HUGE), wavelength_max=1e-300),
    "tent_rate, tiny": lambda: S.tent_rate((16, 16), (1.0, 1.0), wavelength_max=5e-324),
    "advance_phase": lambda: S.advance_phase(ONES, (1e300, 1.0), wavelength_max=1e-10),
    "advance_phase of many turns": lambda: S.advance_phase(1e308 * ONES, (1.0, 1.0)),
    "temporal_filter": lambda: S.temporal_filter(1e200 * ONES, (9.0, 9.0), renormalise=True),
    "inverse_transform": lambda: S.inverse_transform(1e39 * ONES, 0 * ONES),
    "velocity_from_paper": lambda: S.velocity_from_paper(1e308, 0.0, period=1e-10),
    "exponent": lambda: S.band_amplitude((32, 32), exponent=1e308),
    "volume": lambda: S.volume(4, 16, (1e100, -1e99), seed=1, wavelengths=(2.0, 8.0)),
    "opacity": lambda: S.opacity(np.array([[HUGE, -HUGE]]), spread=1e-300),
    "tile_drift": lambda: fl.camera.tile_drift(
        (64, 64), (1e308, 0.0, 1e308), fl.camera.Camera(600.0), near_depth=1e-10
    ),
}  # fmt: skip


@every("name", EXTREME)
def test_extreme_but_finite_numbers_never_give_nan(name: str):
    # Where a phase has lost all its digits the picture is another one; where a product leaves the
    # range of the numbers a refusal is as good. NaN in the picture is not.
    with warnings.catch_warnings():
        # That a drift is too far to hold its phases is said by a warning; see the next test.
        warnings.simplefilter("ignore", UserWarning)
        try:
            result = EXTREME[name]()
        except ValueError:
            return
    assert np.isfinite(result).all()


@pytest.mark.parametrize("cycles, warned", [(0.9e12, 0), (1.1e12, 1)])
def test_a_drift_that_loses_its_phases_is_warned_of(cycles: float, warned: int):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        S.field((40, 30), drift=(0.0, cycles * 32.0), seed=1)
        S.advance_phase(ONES, (cycles * 32.0, 0.0))
    assert [w.filename for w in caught] == [__file__] * (2 * warned)


@every("drift", [(3.0, 5.0), (-5.0, 0.0), (0.0, -60.0)])
def test_waves_move_as_the_drift_says(drift: tuple[float, float]):
    # The longest of a tile of 64 px, if no others are in the band, lie on its axes.
    torus = {"seed": 3, "tile": 64, "overlap": 0, "wavelengths": (15.9, 16.0), "dtype": np.float64}
    start, later = (textured.field((64, 64), drift=d, **torus) for d in ((0.0, 0.0), drift))
    moved = [np.roll(start, (int(s * drift[1]), int(s * drift[0])), (0, 1)) for s in (1, -1)]
    assert np.abs(later - moved[0]).max() < 1e-12
    # The negative control: Eq. 6 as printed moves the snow the other way.
    assert np.abs(later - moved[1]).max() > 1.0


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
