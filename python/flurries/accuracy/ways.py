"""A way to make something, and how wrong what it makes is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array

KINDS: tuple[Any, ...] = (np.float32, np.float64)


class Way(NamedTuple):
    """One way: its name, what is timed, the error of what that makes, and frames of one call."""

    setting: str
    make: Callable[[], Any]
    error: Callable[[Any], float]
    per: int = 1


def largest(reference: Array) -> Callable[[Any], float]:
    """Return the largest difference from a reference as an error."""
    return lambda made: float(np.max(np.abs(np.asarray(made, reference.dtype) - reference)))


def rms(reference: Array) -> Callable[[Any], float]:
    """Return the root mean square difference from a reference as an error."""
    return lambda made: float(
        np.sqrt(np.mean((np.asarray(made, reference.dtype) - reference) ** 2))
    )


def both(setting: str, make: Callable[..., Any], error: Callable[[Any], float]) -> Iterator[Way]:
    """Yield a way in float32 and in float64."""
    for kind in KINDS:
        yield Way(f"{setting}, {kind.__name__}", partial(make, dtype=kind), error)
