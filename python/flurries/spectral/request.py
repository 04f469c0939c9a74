"""A frame of the field as the kernel reads it: every argument of `field`, checked."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries._contract import (
    LARGEST,
    Float64,
    bounded,
    choice,
    flag,
    real,
    seed_of,
    shape_of,
    table,
    tile_of,
)
from flurries.spectral.tables import ALIAS, Aliasing, band_of, warn_far, warn_long
from flurries.spectral.tiles import BLEND, Blend


class Request(NamedTuple):
    """A frame of the field as the kernel reads it: every argument settled and checked."""

    shape: tuple[int, int]
    tile: tuple[int, int]
    overlap: int
    blend: str
    wavelengths: tuple[float, float]
    exponent: float
    seed: int
    jitter: bool
    ring_edges: Float64
    ring_gains: Float64
    drift: Float64
    shift: Float64
    velocity: Float64
    shift_rate: Float64
    alias: Aliasing
    soft_from: float
    shutter: float
    shortest: Float64 | None
    window: tuple[int, int, int, int]
    # Of a film that begins again: drift and shift over all of it, and how much of it has passed.
    lap: tuple[Float64, Float64, float] | None = None

    def arrays(self) -> list[Float64]:
        """Return the values that are arrays, and perhaps the caller's own."""
        return [value for value in self if isinstance(value, np.ndarray)]


# The default of displacements that are not given.
NOWHERE = (0.0, 0.0)
_ZERO = np.zeros((1, 1, 1, 2))


def _vectors(name: str, value: object, rings: int | None) -> Float64:
    """Return (rows or 1, cols or 1, rings or 1, 2) from any of the shapes that api.md allows."""
    if value is NOWHERE:
        return _ZERO
    array = bounded(name, value)
    ringed = rings is not None
    if array.ndim == 1 and array.shape == (2,):
        return array.reshape(1, 1, 1, 2)
    if array.ndim == 2 and ringed and array.shape == (rings, 2):
        return array.reshape(1, 1, -1, 2)
    if array.ndim == 3 and array.shape[2] == 2:
        return array.reshape(array.shape[0], array.shape[1], 1, 2)
    if array.ndim == 4 and ringed and array.shape[2:] == (rings, 2):
        return array
    wanted = "(2,) or (rows, cols, 2)"
    if name in ("drift", "velocity"):
        wanted += (
            f", or ({rings}, 2) or (rows, cols, {rings}, 2) for the rings of ring_edges"
            if ringed
            else "; rings need ring_edges"
        )
    raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")


def request(
    shape: tuple[int, int],
    *,
    drift: npt.ArrayLike,
    shift: npt.ArrayLike,
    seed: int,
    tile: int | tuple[int, int],
    overlap: int,
    wavelengths: tuple[float, float],
    exponent: float,
    velocity: npt.ArrayLike | None,
    shift_rate: npt.ArrayLike | None,
    alias: Aliasing,
    soft_from: float,
    shutter: float,
    jitter: bool,
    shortest: npt.ArrayLike | None,
    ring_edges: npt.ArrayLike | None,
    ring_gains: npt.ArrayLike | None,
    blend: Blend,
    enveloped: bool,
) -> Request:
    """Settle the arguments of `field`; with `enveloped` its waves are not those of the band."""
    size = shape_of("shape", shape)
    tile_size, shared = tile_of(tile, overlap)
    band = band_of(wavelengths)
    rings: int | None = None
    edges = np.empty(0)
    if ring_edges is not None:
        edges = table("ring_edges", ring_edges, ndim=1)
        if len(edges) < 2 or not (np.diff(edges) > 0).all():
            came = edges.tolist() if len(edges) < 10 else f"{len(edges)} that do not increase"
            raise ValueError(f"ring_edges must be at least two increasing wavelengths, got {came}")
        rings = len(edges) - 1
    gains = np.empty(0)
    if ring_gains is not None:
        gains = table("ring_gains", ring_gains, ndim=1)
        if rings is None or len(gains) != rings:
            raise ValueError(
                f"ring_gains must be one number for each ring of ring_edges "
                f"({'none' if rings is None else rings}), got {len(gains)}"
            )
    choice("alias", alias, ALIAS)
    exposure = real("shutter", shutter, low=0.0, high=LARGEST)
    if velocity is None and (alias != "keep" or exposure > 0.0):
        raise ValueError(
            f"velocity is needed for alias={alias!r} and shutter={exposure:g}, got None"
        )
    limits = None if shortest is None else table("shortest", shortest)
    if not enveloped:
        warn_long(tile_size, band, stacklevel=4)
    offsets = _vectors("drift", drift, rings)
    if offsets is not _ZERO and band[1] > 0.0:
        warn_far(float(np.abs(offsets).max(initial=0.0)) / band[1], stacklevel=4)
    return Request(
        shape=size,
        tile=tile_size,
        overlap=shared,
        blend=choice("blend", blend, BLEND),
        wavelengths=band,
        exponent=real("exponent", exponent),
        seed=seed_of(seed),
        jitter=flag("jitter", jitter),
        ring_edges=edges,
        ring_gains=gains,
        drift=offsets,
        shift=_vectors("shift", shift, None),
        velocity=_ZERO if velocity is None else _vectors("velocity", velocity, rings),
        shift_rate=_ZERO if shift_rate is None else _vectors("shift_rate", shift_rate, None),
        alias=alias,
        soft_from=real("soft_from", soft_from),
        shutter=exposure,
        shortest=limits,
        window=(0, size[0], 0, size[1]),
    )
