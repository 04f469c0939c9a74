"""Random parameters: a pure function of the seed and the index of the call."""

from __future__ import annotations

import secrets
import zlib
from typing import Any, TypeAlias

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64, real

Range: TypeAlias = float | tuple[float, float]

# Samples of a picture that its own index is taken from.
_SAMPLES = 4096


def range_of(
    name: str, value: object, *, low: float = -1e6, high: float = 1e6, above: float = -np.inf
) -> tuple[float, float]:
    """Return (low, high) of a number or of a pair."""
    if isinstance(value, (tuple, list, np.ndarray)):
        if len(value) != 2:
            raise ValueError(f"{name} must be a number or (low, high), got {value!r}")
        first, last = (real(name, v, low=low, high=high, above=above) for v in value)
        if first > last:
            raise ValueError(f"{name} must be (low, high) with low <= high, got {(first, last)}")
        return first, last
    one = real(name, value, low=low, high=high, above=above)
    return one, one


def own_index(seed: int | None, image: Array) -> int:
    """Return the index of a call that names none: of the system, or the picture's own of a seed."""
    if seed is None:
        # Of the system: forked workers never share one.
        return secrets.randbits(62)
    values = image.reshape(-1) if image.flags.c_contiguous else np.ravel(image)
    sample = np.ascontiguousarray(values[:: max(values.size // _SAMPLES, 1)])
    head = zlib.crc32(repr((image.shape, image.dtype.name)).encode())
    content = sample.tobytes()
    return (zlib.crc32(content, head) & 0x7FFF_FFFF) << 32 | zlib.adler32(content, head)


def uniforms(seed: int, stream: int, count: int) -> Float64:
    """Return numbers in [0, 1) that belong to a seed and a stream."""
    numbers = np.empty(count)
    _core.uniform(numbers, seed, stream)
    return numbers


def between(limits: Any, u: float) -> float:
    """Return the number at a share of a range."""
    low, high = limits
    return float(low + (high - low) * u)
