"""What the effect asks of the texture of flakes: windows, bands, masks, generations, amounts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flurries as fl
import twin
import twin_flakes
from flurries import _core
from flurries.spectral import flake_frames as frames
from flurries.spectral import flakes

SHAPE, TILE, OVERLAP, SHEAR, LAYERS, NUMBER = (83, 97), 24, 7, 0.382, 2, 3
LAW: dict[str, Any] = {
    "counts": [40, 90], "diameters": [[1.5, 2.5], [0.8, 1.5]], "shear": SHEAR, "seed": 2,
    "patterns": NUMBER, "dtype": np.complex128,
}  # fmt: skip
SPECTRA = flakes.patterns_of(TILE, **LAW)
ROWS, COLS = (len(twin.tile_starts(n, tile=TILE, overlap=OVERLAP)) for n in SHAPE)
TILES = (ROWS, COLS)
RNG = np.random.default_rng(5)
DRIFT = RNG.normal(0.0, 30.0, (ROWS, COLS, LAYERS, 2))
MEANS = SPECTRA[:, 0, 0, 0].real / TILE**2


def ready(spectra: np.ndarray = SPECTRA, dtype: Any = np.float64) -> _core.PreparedFlakes:
    return frames.prepare(spectra, shear=SHEAR, dtype=dtype)


def request(**changes: Any) -> frames.Request:
    chosen = frames.choices(4, TILES, layers=LAYERS, patterns=NUMBER, tile=TILE)
    return frames.Request(
        shape=SHAPE, overlap=OVERLAP, pattern=chosen.pattern, gain=np.ones((1, 1, LAYERS)),
        shift=chosen.shift + DRIFT, streak=None,
        mean=np.array([[MEANS.sum()]]), window=(0, SHAPE[0], 0, SHAPE[1]),
    )._replace(**changes)  # fmt: skip


def depth(asked: frames.Request, **options: Any) -> np.ndarray:
    return frames.frame_of(ready(), asked, opacity=False, dtype=np.float64, **options)


def slow(asked: frames.Request, spectra: np.ndarray = SPECTRA) -> np.ndarray:
    """The request by the twin: tile by tile, term by term."""
    flat = spectra.reshape(-1, *spectra.shape[2:]).copy()
    flat[:, 0, 0] = 0.0
    terms = asked.pattern.shape[2]
    each = {
        name: np.broadcast_to(value, (ROWS, COLS, *value.shape[2:]))
        for name, value in asked._asdict().items()
        if isinstance(value, np.ndarray)
    }
    tiles, means = np.empty((2, ROWS, COLS, TILE, TILE))
    for at in np.ndindex(TILES):
        numbers = each["pattern"][at]
        streak = each["streak"][at] if asked.streak is not None else np.zeros((terms, 2))
        gains = np.where(numbers >= 0, each["gain"][at], 0.0)
        tiles[at] = twin_flakes.tile_of(flat[numbers], each["shift"][at], streak, gains, SHEAR)
        means[at] = each["mean"][at]
    # Means mix by weights that sum to 1: the squares of those of the power law.
    down, across = (twin.axis_weights(n, TILE, OVERLAP, "power") for n in SHAPE)
    share = down[:, None, :, None] * across[None, :, None, :]
    mean = twin.blend_tiles(means * share, SHAPE, overlap=OVERLAP, blend="power")
    return np.maximum(0.0, mean + twin.blend_tiles(tiles, SHAPE, overlap=OVERLAP))


REQUESTS: dict[str, dict[str, Any]] = {
    "plain": {},
    "streaks": {"streak": RNG.normal(0.0, 4.0, (ROWS, COLS, LAYERS, 2))},
    "gains of tiles": {"gain": RNG.uniform(0.5, 1.5, (ROWS, COLS, LAYERS))},
    "gains of rows": {"gain": RNG.uniform(0.5, 1.5, (ROWS, 1, LAYERS))},
    "means of tiles": {"mean": RNG.uniform(0.0, 0.3, TILES)},
    "a wall": {
        "pattern": np.where(
            RNG.random((ROWS, COLS, LAYERS)) < 0.4, -1, request().pattern
        ).astype(np.int32),
        "mean": RNG.uniform(0.0, 0.3, TILES),
    },
    "nothing at all": {"pattern": np.full((1, 1, LAYERS), -1, np.int32), "mean": np.zeros((1, 1))},
}  # fmt: skip


@pytest.mark.parametrize("name", REQUESTS)
def test_requests_are_the_direct_sum(name: str):
    asked = request(**REQUESTS[name])
    want = slow(asked)
    assert np.abs(depth(asked) - want).max() < 1e-10
    opacity = frames.frame_of(ready(), asked, opacity=True, dtype=np.float64)
    assert np.abs(opacity - (1.0 - np.exp(-want))).max() < 1e-10
    single = frames.frame_of(ready(dtype=np.float32), asked, opacity=True)
    assert np.abs(single - opacity).max() < 2e-5


def test_two_generations_share_a_layer():
    # Four terms: each layer's old and new patterns, the squares of whose weights sum to 1.
    old = RNG.integers(-5, 1000, (ROWS, COLS, LAYERS))
    frac = RNG.random((ROWS, COLS, LAYERS))
    parts = [
        frames.choices(4, TILES, layers=LAYERS, patterns=NUMBER, tile=TILE, generation=old + which)
        for which in (0, 1)
    ]
    assert not np.array_equal(parts[0].shift, parts[1].shift)
    asked = request(
        pattern=np.concatenate([part.pattern for part in parts], 2),
        shift=np.concatenate([part.shift + DRIFT for part in parts], 2),
        gain=np.concatenate([np.cos(np.pi / 2 * frac), np.sin(np.pi / 2 * frac)], 2),
    )
    assert np.abs(depth(asked) - slow(asked)).max() < 1e-10
    # The next generation of one is the first of the other.
    later = frames.choices(4, TILES, layers=LAYERS, patterns=NUMBER, tile=TILE, generation=old + 1)
    assert np.array_equal(later.pattern, parts[1].pattern)
    # Terms that name their layers are those of the layers.
    again = frames.choices(
        4, TILES, layers=LAYERS, patterns=NUMBER, tile=TILE, terms=[LAYERS - 1, 0, 0],
        generation=np.repeat(old[..., :1], 3, axis=2),
    )  # fmt: skip
    assert np.array_equal(again.pattern[..., 1], parts[0].pattern[..., 0])
    assert np.array_equal(again.shift[..., 2, :], parts[0].shift[..., 0, :])
    assert np.array_equal(again.pattern[..., 0] // NUMBER, np.full((ROWS, COLS), LAYERS - 1))


def test_the_public_function_is_a_thin_case():
    public = fl.spectral.optical_depth(
        SHAPE, SPECTRA, drift=DRIFT, shear=SHEAR, seed=4, overlap=OVERLAP, dtype=np.float64
    )
    assert np.array_equal(public, depth(request()))


@pytest.mark.parametrize("name", ["plain", "streaks", "means of tiles"])
def test_windows_and_bands_have_the_bits_of_the_whole(name: str, threads: Callable[[int], None]):
    asked = request(**REQUESTS[name])
    whole = depth(asked)
    for count in (1, 2, 5):
        threads(count)
        for window in [(0, 83, 0, 97), (13, 60, 8, 96), (40, 41, 70, 71)]:
            top, bottom, left, right = window
            part = asked._replace(window=window)
            want = whole[top:bottom, left:right]
            assert np.array_equal(depth(part), want)
            bands = frames.bands_of(ready(), part, opacity=False)
            for first in range(top, bottom, 5):
                out = np.full((min(5, bottom - first), right - left), np.nan)
                _core.flake_take(bands, out, first)
                assert np.array_equal(out, want[first - top : first - top + 5])


def test_groups_of_layers_before_a_wall():
    # Near layers and far ones with masks of their own make the opacity of their sum.
    near, far = (
        request(
            pattern=np.where(np.arange(LAYERS) == layer, request().pattern, -1).astype(np.int32),
            mean=np.array([[MEANS[layer]]]),
        )
        for layer in (0, 1)
    )
    masks = RNG.random((2, *SHAPE))
    out = depth(near, mask=masks[0])
    assert np.abs(out - masks[0] * slow(near)).max() < 1e-10
    frames.frame_of(ready(), far, opacity=True, mask=masks[1], dtype=np.float64, out=out, add=True)
    want = 1.0 - np.exp(-masks[0] * slow(near) - masks[1] * slow(far))
    assert np.abs(out - want).max() < 1e-10


def test_layers_before_a_scene_that_cuts_them():
    # Each group by itself, weighed pixel by pixel; of means so large nothing is below 0.
    mean = np.array([3.0, 4.0]) + RNG.random((ROWS, COLS, LAYERS))
    edges, shares = np.array([2.0, 5.0, 9.0]), np.array([[0.0, 1.0, 1.0], [0.0, 0.25, 1.0]])
    far = RNG.uniform(1.0, 10.0, SHAPE).astype(np.float32)
    # Tiles before which all is seen, and behind which nothing is.
    far[:40, :50], far[40:, 50:] = np.inf, 1.5
    before = frames.Before(far, np.array([0, 1], np.int32), edges, shares, mean)
    asked = request(before=before)
    want = np.zeros(SHAPE)
    for group, share in enumerate(shares):
        alone = np.where(np.arange(LAYERS) == group, asked.pattern, -1).astype(np.int32)
        part = slow(request(pattern=alone, mean=mean[..., group], before=None))
        want += np.interp(far, edges, share) * part
    assert np.abs(depth(asked) - want).max() < 1e-6
    part = depth(asked._replace(window=(13, 60, 8, 96)))
    assert np.array_equal(part, depth(asked)[13:60, 8:96])
    open_air = before._replace(depth=np.full(SHAPE, np.inf, np.float32), mean=MEANS[None, None])
    assert np.abs(depth(request(before=open_air)) - depth(request())).max() < 1e-12
    walled = before._replace(depth=np.full(SHAPE, 1.0, np.float32))
    assert not depth(request(before=walled)).any()


def test_an_amount_between_two_rungs():
    half = flakes.patterns_of(TILE, **LAW, amount=0.5)
    mixed = _core.flake_mix(ready(half), ready(), 0.6)
    asked = request(mean=np.array([[0.8 * MEANS.sum()]]))
    got = frames.frame_of(mixed, asked, opacity=False, dtype=np.float64)
    want = slow(asked, 0.4 * half + 0.6 * SPECTRA)
    assert np.abs(got - want).max() < 1e-10
    assert np.allclose(mixed.means, 0.8 * SPECTRA[..., 0, 0].real.ravel())
    with pytest.raises(ValueError, match="second"):
        _core.flake_mix(ready(), ready(dtype=np.float32), 0.5)


BAD: dict[str, dict[str, Any]] = {
    "pattern": {"pattern": np.full((ROWS, COLS, LAYERS), LAYERS * NUMBER, np.int32)},
    "gain": {"gain": np.ones((1, 1, LAYERS + 1))},
    "shift": {"shift": DRIFT[:-1]},
    "streak": {"streak": np.zeros((1, 1, LAYERS, 3))},
    "mean": {"mean": np.zeros((ROWS, COLS + 1))},
    "window": {"window": (0, 84, 0, 97)},
    "overlap": {"overlap": TILE},
    **{
        name: {"before": frames.Before(
            np.ones(SHAPE, np.float32), np.zeros(LAYERS, np.int32), np.array([1.0, 2.0]),
            np.array([[0.0, 1.0]]), np.ones((1, 1, 1)),
        )._replace(**{name: value})}
        for name, value in {
            "depth": np.ones((83, 96), np.float32), "group": np.ones(LAYERS, np.int32),
            "edges": np.array([2.0, 1.0]), "shares": np.ones((1, 3)),
        }.items()
    },
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_requests_that_do_not_fit_are_refused(name: str):
    with pytest.raises(ValueError, match=name):
        depth(request(**BAD[name]), out=np.zeros((84, 97)) if name == "window" else None)


def test_the_dtype_is_that_of_the_prepared():
    with pytest.raises(ValueError, match="out"):
        frames.frame_of(ready(), request(), opacity=False, dtype=np.float32)
