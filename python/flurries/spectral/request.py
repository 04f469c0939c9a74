"""A frame of the field as the kernel reads it: every argument of `field`, checked."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64, bounded, seed_of, shape_of, table
from flurries.spectral.tables import Aliasing, warn_far, warn_long
from flurries.spectral.texture import Texture


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
_NONE = np.empty(0)


def _vectors(name: str, value: object, rings: int | None) -> Float64:
    """Return (rows or 1, cols or 1, rings or 1, 2) from any of the shapes that api.md allows."""
    if value is NOWHERE:
        return _ZERO
    array = bounded(name, value)
    if array.shape == (2,) or (array.ndim == 3 and array.shape[2] == 2):
        return array.reshape(*(array.shape[:-1] or (1, 1)), 1, 2)
    if array.ndim in (2, 4) and array.shape[-2:] == (rings, 2):
        return array.reshape(*(array.shape[:-2] or (1, 1)), -1, 2)
    wanted = "(2,) or (rows, cols, 2)"
    if name in ("drift", "velocity"):
        wanted += ", and with ring_edges also (rings, 2) or (rows, cols, rings, 2)"
    raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")


def request(
    shape: tuple[int, int], texture: Texture, *, seed: int, drift: npt.ArrayLike = NOWHERE,
    shift: npt.ArrayLike = NOWHERE, velocity: npt.ArrayLike | None = None,
    shift_rate: npt.ArrayLike | None = None, shortest: npt.ArrayLike | None = None,
) -> Request:  # fmt: skip
    """Settle the arguments of `field`."""
    size = shape_of("shape", shape)
    if not isinstance(texture, Texture):
        raise TypeError(f"texture must be a flurries.spectral.Texture, got {texture!r:.60}")
    band, edges = texture.wavelengths, texture.ring_edges
    if velocity is None and texture.rate is not None and drift is NOWHERE:
        # The rate alone moves the waves.
        velocity = NOWHERE
    if velocity is None and (texture.alias != "keep" or texture.shutter > 0.0):
        raise ValueError(
            f"velocity is needed for alias={texture.alias!r} and shutter={texture.shutter:g}, "
            "got None"
        )
    if texture.envelope is None:
        warn_long(texture.sides, band)
    rings = None if edges is None else len(np.asarray(edges)) - 1
    offsets = _vectors("drift", drift, rings)
    if offsets is not _ZERO and band[1] > 0.0:
        warn_far(float(np.abs(offsets).max(initial=0.0)) / band[1])
    return request_of(
        texture, size, seed_of(seed), drift=offsets, shift=_vectors("shift", shift, None),
        velocity=_ZERO if velocity is None else _vectors("velocity", velocity, rings),
        shift_rate=_ZERO if shift_rate is None else _vectors("shift_rate", shift_rate, None),
        shortest=None if shortest is None else table("shortest", shortest),
        window=(0, size[0], 0, size[1]),
    )  # fmt: skip


def request_of(texture: Texture, shape: tuple[int, int], seed: int, **motion: Any) -> Request:
    """Return what the kernel reads of a texture and of a motion that is settled already."""
    edges, gains = (
        _NONE if part is None else np.asarray(part)
        for part in (texture.ring_edges, texture.ring_gains)
    )
    return Request(
        shape=shape, seed=seed, tile=texture.sides, overlap=texture.overlap, blend=texture.blend,
        wavelengths=texture.wavelengths, exponent=texture.exponent, jitter=texture.jitter,
        alias=texture.alias, soft_from=texture.soft_from, shutter=texture.shutter,
        ring_edges=edges, ring_gains=gains, **motion,
    )  # fmt: skip
