"""One frame of the field: equal to the twin, equal to the composition of its steps."""

import warnings
from typing import Any

import numpy as np

import textured
import twin
from every import every

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
    """A random picture size and the arguments of a frame."""
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
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # some bands are longer than the tile
            got = textured.field(shape, **options, dtype=dtype)
        assert got.dtype == dtype
        assert np.abs(got - want).max() <= limit
