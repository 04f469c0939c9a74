"""The reproducible mode: what the same bits on every processor cost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flurries import spectral
from flurries._contract import Array
from flurries._threads import reproducible, set_reproducible
from flurries.accuracy import reference
from flurries.accuracy.ways import Way, largest

DRIFT = np.array([37.25, 411.5])


def modes() -> list[Way]:
    """Return both modes for the two transforms and the two precisions."""
    shape = (512, 512)
    # Few waves are summed, many transformed.
    kinds = {
        "4 to 32 px": {"tile": 64, "overlap": 10, "band": (4.0, 32.0)},
        "2 to 64 px": {"tile": 256, "overlap": 20, "band": (2.0, 64.0)},
    }
    ways = []
    for name, kind in kinds.items():
        off = largest(reference.field(shape, drift=DRIFT, seed=7, **kind))  # type: ignore[arg-type]
        for dtype in (np.float32, np.float64):
            for on in (False, True):
                way = f"{name}, {np.dtype(dtype).name}{', reproducible' if on else ''}"
                ways.append(Way(way, _frame(shape, on, dtype, kind), off))
    return ways


def _frame(
    shape: tuple[int, int], on: bool, dtype: Any, kind: dict[str, Any]
) -> Callable[[], Array]:
    out = np.empty(shape, dtype)
    tile, overlap, band = kind["tile"], kind["overlap"], kind["band"]

    def make() -> Array:
        before = reproducible()
        set_reproducible(on)
        try:
            return spectral.field(
                shape, drift=DRIFT, seed=7, tile=tile, overlap=overlap, wavelengths=band,
                dtype=dtype, out=out,
            )  # fmt: skip
        finally:
            set_reproducible(before)

    return make
