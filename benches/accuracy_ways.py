"""What can be made in several ways, and how wrong what each of them makes is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


class Way(NamedTuple):
    """One way: its name, what is timed, the error of what that makes, and frames of one call."""

    setting: str
    make: Callable[[], Any]
    error: Callable[[Any], float]
    per: int = 1


@dataclass(frozen=True)
class Axis:
    """One thing that can be made in several ways: what varies, the error's unit, its reference."""

    name: str
    title: str
    unit: str
    reference: str
    ways: Callable[[], Iterator[Way]] = field(repr=False)


def axis(unit: str, reference: str) -> Callable[[Callable[[], Iterator[Way]]], Axis]:
    """Make an axis of a function that yields ways; its docstring is the title."""

    def made(ways: Callable[[], Iterator[Way]]) -> Axis:
        title = (ways.__doc__ or ways.__name__).removesuffix(".")
        return Axis(ways.__name__, title, unit, reference, ways)

    return made


def largest(reference: Array) -> Callable[[Any], float]:
    """Return the largest difference from a reference as an error."""
    return lambda made: float(np.max(np.abs(np.asarray(made, reference.dtype) - reference)))


def rms(reference: Array) -> Callable[[Any], float]:
    """Return the root mean square difference from a reference as an error."""
    return lambda made: float(np.sqrt(np.mean(np.asarray(made - reference, reference.dtype) ** 2)))


def both(setting: str, make: Callable[..., Any], error: Callable[[Any], float]) -> Iterator[Way]:
    """Yield a way in float32 and in float64."""
    for kind in (np.float32, np.float64):
        yield Way(f"{setting}, {kind.__name__}", partial(make, dtype=kind), error)
