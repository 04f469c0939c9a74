"""What can be made in several ways, and how wrong what each of them makes is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Axis:
    """One thing that can be made in several ways: what varies, the error's unit, its reference."""

    make: Callable[[], Iterator[Way]]
    title: str
    unit: str
    reference: str

    @property
    def name(self) -> str:
        """What the command line calls it."""
        return self.make.__name__

    def ways(self) -> list[Way]:
        """Return the ways; makes the reference, which may take seconds."""
        return list(self.make())


# All that can be measured, in the order in which it is defined.
KNOWN: list[Axis] = []


def axis(
    unit: str, reference: str
) -> Callable[[Callable[..., Iterator[Way]]], Callable[..., Iterator[Way]]]:
    """Make an axis of a function that yields ways; its docstring is the title."""

    def listed(make: Callable[..., Iterator[Way]]) -> Callable[..., Iterator[Way]]:
        title = (make.__doc__ or make.__name__).removesuffix(".")
        KNOWN.append(Axis(make, title, unit, reference))
        return make

    return listed


def largest(reference: Array) -> Callable[[Any], float]:
    """Return the largest difference from a reference as an error."""
    return lambda made: float(np.max(np.abs(np.asarray(made, reference.dtype) - reference)))


def rms(reference: Array) -> Callable[[Any], float]:
    """Return the root mean square difference from a reference as an error."""
    return lambda made: float(np.sqrt(np.mean(np.asarray(made - reference, reference.dtype) ** 2)))


def both(setting: str, make: Callable[..., Any], error: Callable[[Any], float]) -> Iterator[Way]:
    """Yield a way in float32 and in float64."""
    for kind in KINDS:
        yield Way(f"{setting}, {kind.__name__}", partial(make, dtype=kind), error)
