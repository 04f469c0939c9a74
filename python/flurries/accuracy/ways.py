"""What a study is made of: ways to make one thing, and how wrong each is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries._contract import Array


@dataclass(frozen=True)
class Way:
    """One way to make something.

    Attributes
    ----------
    setting : str
        What distinguishes it.
    make : callable
        What is timed; returns the thing.
    error : callable
        The thing -> its error, in the axis' unit.
    per : int
        How many frames one call makes; the time is for one of them.
    """

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
        np.sqrt(np.mean(np.square(np.asarray(made, reference.dtype) - reference)))
    )


def known(error: float) -> Callable[[Any], float]:
    """Return an error that does not depend on what was made: it was derived."""
    return lambda made: error
