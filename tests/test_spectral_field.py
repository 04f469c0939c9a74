"""One frame of the field: equal to the twin, equal to the composition of its steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flurries as fl
import twin
from every import every

LIMIT = {np.float64: 1e-12, np.float32: 2e-6}

# (shape, tile, overlap): powers of two, odd, prime and tiny tiles; overlap 0, 1, 10, M/2, M - 1;
# pictures that are not square, and smaller than a tile.
LAYOUTS = [
    ((21, 30), 8, 0),
    ((20, 17), 8, 4),
    ((10, 11), 8, 7),
    ((25, 31), 9, 1),
    ((11, 10), 9, 8),
    ((40, 33), 16, 10),
    ((5, 40), 16, 8),
    ((19, 18), 16, 15),
    ((33, 40), 17, 1),
    ((12, 9), 17, 10),
    ((70, 45), 31, 10),
    ((34, 33), 31, 30),
    ((100, 60), 48, 24),
    ((50, 120), 48, 0),
    ((130, 200), 64, 10),
    ((90, 70), 64, 32),
    ((66, 65), 64, 63),
    ((30, 20), 64, 10),
    ((1, 1), 64, 10),
]


def wavelengths_for(tile: int) -> tuple[float, float]:
    """A band that the tile holds without a warning."""
    return (2.0, float(tile)) if tile < 16 else (3.0, min(32.0, float(tile)))


def grid(shape: twin.Shape, tile: int, overlap: int) -> tuple[int, int]:
    rows, cols = (len(twin.tile_starts(n, tile=tile, overlap=overlap)) for n in shape)
    return rows, cols


def per_tile(rows: int, cols: int, *rings: int) -> np.ndarray:
    """A different vector for every tile, up to 20 px."""
    return np.random.default_rng(3).uniform(-20.0, 20.0, (rows, cols, *rings, 2))


# What a frame can be asked for, each as a function of the number of tiles.
OPTIONS: dict[str, Callable[[int, int], dict[str, Any]]] = {
    "plain": lambda r, c: {},
    "drift per tile": lambda r, c: {"drift": per_tile(r, c)},
    "shift": lambda r, c: {"shift": (3.7, -12.1)},
    "shift per tile": lambda r, c: {"shift": per_tile(r, c)},
    "velocity changes nothing": lambda r, c: {"velocity": (40.0, 3.0)},
    "cut": lambda r, c: {"alias": "cut", "velocity": (9.0, 14.0)},
    "cut per tile": lambda r, c: {"alias": "cut", "velocity": per_tile(r, c)},
    "cut with pan": lambda r, c: {
        "alias": "cut", "velocity": (9.0, 14.0), "shift_rate": (1.5, -0.8)
    },
    "cut with pan per tile": lambda r, c: {
        "alias": "cut", "velocity": (2.0, 4.0), "shift_rate": per_tile(r, c) / 5
    },
    "soft": lambda r, c: {"alias": "soft", "velocity": (9.0, 10.0), "soft_from": 0.25},
    "shutter": lambda r, c: {"velocity": (9.0, 14.0), "shutter": 0.7},
    "shutter with pan": lambda r, c: {
        "velocity": per_tile(r, c), "shift_rate": (1.0, 2.0), "shutter": 1.3
    },
    "cut and shutter": lambda r, c: {"alias": "cut", "velocity": (20.0, 1.0), "shutter": 1.0},
    "jitter": lambda r, c: {"jitter": True},
    "jitter and cut": lambda r, c: {
        "jitter": True, "alias": "cut", "velocity": (12.0, 11.0), "shutter": 0.5
    },
    "linear": lambda r, c: {"blend": "linear"},
    "exponent": lambda r, c: {"exponent": 0.4},
    "shortest": lambda r, c: {
        "shortest": np.random.default_rng(1).uniform(2.0, 7.5, (r, c))
    },
    "sky beside walls": lambda r, c: {"shortest": 8.0 * (np.indices((r, c)).sum(0) % 2)},
    "far wall and no snow": lambda r, c: {"shortest": np.where(np.eye(r, c), 64.0, 4.0)},
    "rings": lambda r, c: {
        "drift": [(8.0, 1.0), (-3.0, 5.0), (0.0, 30.0)], "ring_edges": [2.0, 4.0, 7.0, 32.0]
    },
    "rings inside the band": lambda r, c: {
        "drift": [(8.0, 1.0), (-3.0, 5.0)], "ring_edges": [3.5, 5.0, 6.0]
    },
    "rings per tile": lambda r, c: {
        "drift": per_tile(r, c, 3), "ring_edges": [2.0, 4.0, 7.0, 32.0], "jitter": True
    },
    "ring gains": lambda r, c: {
        "ring_edges": [2.0, 4.0, 7.0, 32.0], "ring_gains": [0.2, 3.0, 1.0], "exponent": 0.5
    },
    "gains that silence a ring": lambda r, c: {
        "drift": [(8.0, 1.0), (-3.0, 5.0)], "ring_edges": [2.0, 4.0, 32.0], "ring_gains": [0, 1]
    },
    "rings cut": lambda r, c: {
        "drift": per_tile(r, c, 2), "velocity": [(30.0, 0.0), (5.0, 9.0)],
        "ring_edges": [2.0, 5.0, 32.0], "alias": "cut", "shutter": 0.5
    },
}  # fmt: skip


@every("dtype", [np.float64, np.float32])
@every("option", OPTIONS)
@every(("shape", "tile", "overlap"), [((33, 20), 17, 1), ((20, 25), 9, 4)])
def test_field_is_the_cosine_sum(shape, tile: int, overlap: int, option: str, dtype: type):
    # Every option, against the direct sum.
    options = {"drift": (5.0, -11.0), **OPTIONS[option](*grid(shape, tile, overlap))}
    options |= {"seed": -7, "tile": tile, "overlap": overlap, "wavelengths": wavelengths_for(tile)}
    got = fl.spectral.field(shape, **options, dtype=dtype)
    assert got.dtype == dtype and got.shape == shape and got.flags.c_contiguous
    assert np.abs(got - twin.field(shape, **options, direct=True)).max() <= LIMIT[dtype]


@every("dtype", [np.float64, np.float32])
@every("blend", ["power", "linear"])
@every(("shape", "tile", "overlap"), LAYOUTS)
def test_every_layout_is_the_twins(shape, tile: int, overlap: int, blend: str, dtype: type):
    rows, cols = grid(shape, tile, overlap)
    options = {"drift": per_tile(rows, cols), "shift": (2.5, 6.5), "seed": 2**63 - 1}
    options |= {"tile": tile, "overlap": overlap, "wavelengths": wavelengths_for(tile)}
    got = fl.spectral.field(shape, **options, blend=blend, dtype=dtype)
    want = twin.field(shape, **options, blend=blend, direct=tile <= 17)
    assert np.abs(got - want).max() <= LIMIT[dtype]


def test_shortest_keeps_the_normaliser():
    # The kept variance is log(Z_bg/Z_near)/log 8, here one octave of three, and the
    # waves that stay are the same: a near wall shows less snow, not other snow.
    options = {"drift": (0.0, 0.0), "seed": 5, "tile": 256, "overlap": 0, "dtype": np.float64}
    cut = fl.spectral.field((256, 256), **options, shortest=[[16.0]])
    assert cut.var() == pytest.approx(1 / 3, abs=0.01)
    full = fl.spectral.field((256, 256), **options)
    assert np.mean(cut * full) == pytest.approx(cut.var(), abs=1e-12)


def test_gains_are_not_taken_from_the_call_before():
    # Plans are kept from call to call; edges that end like another's gains must not be mistaken.
    options = {"drift": (5.0, -3.0), "seed": 3, "tile": 64, "dtype": np.float64}
    calls = [
        {"ring_edges": (2.0, 4.0, 8.0, 16.0, 32.0)},
        {"ring_edges": (2.0, 4.0, 8.0), "ring_gains": (16.0, 32.0)},
        {"ring_edges": (2.0, 4.0, 8.0), "ring_gains": (1.0, 32.0)},
        {"ring_edges": (2.0, 4.0, 8.0)},
    ]
    for _ in range(2):
        for call in calls:
            got = fl.spectral.field((64, 64), **options, **call)
            assert (
                np.abs(
                    got
                    - twin.field(
                        (64, 64), **{k: v for k, v in options.items() if k != "dtype"}, **call
                    )
                ).max()
                < 1e-12
            )
