"""Measuring: ways are called in turn, so that a busy moment meets all of them."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from flurries._contract import choice, integer
from flurries.accuracy import layers, look, texture
from flurries.accuracy.ways import Axis, Way

# In the order of the page.
AXES: dict[str, Axis] = {
    axis.name: axis
    for axis in (
        texture.precision, texture.shutter, texture.film,
        look.octaves, look.tile, look.blend,
        layers.flakes, layers.composite, layers.footprint, layers.stop, layers.cone, layers.depth,
    )
}  # fmt: skip

# Fewer runs say little about a median.
FEWEST_RUNS = 20


@dataclass(frozen=True)
class Point:
    """One measured way: its error in the axis' unit, milliseconds a frame, and runs.

    It is `best` where nothing else is both faster, by the fastest run, and as right.
    """

    setting: str
    error: float
    median: float
    fastest: float
    runs: int
    best: bool = False


@dataclass(frozen=True)
class Study:
    """The points of one axis."""

    axis: Axis
    points: tuple[Point, ...]


def study(
    names: Sequence[str] | str | None = None,
    *,
    runs: int = FEWEST_RUNS,
    progress: Callable[[Iterable[Axis]], Iterable[Axis]] = iter,
) -> list[Study]:
    """Measure error against time.

    Parameters
    ----------
    names : str or sequence of str, optional
        Of `AXES`; all of them if not given, in about a minute.
    runs : int
        How often each way is timed, 20 or more.
    progress : callable, optional
        Wraps the axes while they are worked on, as `tqdm` does.

    Returns
    -------
    list of Study

    Raises
    ------
    ValueError, TypeError
        For a name that is none, or too few runs.

    Examples
    --------
    >>> import flurries as fl
    >>> found = fl.accuracy.study("blend")[0]
    >>> min(found.points, key=lambda point: point.error).setting
    'power, overlap 32'
    """
    count = integer("runs", runs, low=FEWEST_RUNS, high=100_000)
    if names is None or isinstance(names, str):
        names = list(AXES) if names is None else [names]
    axes = [AXES[choice("names", name, tuple(AXES))] for name in names]
    return [Study(axis, tuple(measure(list(axis.ways()), count))) for axis in progress(axes)]


def measure(ways: Sequence[Way], runs: int) -> list[Point]:
    """Return the error and the times of each way."""
    # The first call of each is not timed: it plans, allocates and warms up.
    errors = [way.error(way.make()) for way in ways]
    times: list[list[float]] = [[] for _ in ways]
    for _ in range(runs):
        for way, spent in zip(ways, times, strict=True):
            began = time.perf_counter()
            way.make()
            spent.append(1e3 * (time.perf_counter() - began) / way.per)
    best = unbeaten([(error, min(spent)) for error, spent in zip(errors, times, strict=True)])
    return [
        Point(way.setting, error, statistics.median(spent), min(spent), runs, front)
        for way, error, spent, front in zip(ways, errors, times, best, strict=True)
    ]


def unbeaten(costs: Sequence[tuple[float, float]]) -> list[bool]:
    """Return for each (error, time) whether no other is at most as large in both, and not equal."""
    return [
        not any(e <= error and t <= spent and (e, t) != (error, spent) for e, t in costs)
        for error, spent in costs
    ]
