"""Measuring: ways are called in turn, so that a busy moment of the machine meets all alike."""

from __future__ import annotations

import importlib
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from flurries._contract import choice, integer
from flurries.accuracy.ways import Way

# Fewer runs say little about a median.
FEWEST_RUNS = 20


@dataclass(frozen=True)
class Axis:
    """One thing that can be made in several ways.

    Attributes
    ----------
    name : str
        For the command line.
    title : str
        What is varied.
    unit : str
        Of the error.
    reference : str
        What the error is measured against.
    """

    name: str
    title: str
    unit: str
    reference: str

    def ways(self) -> list[Way]:
        """Return the ways; makes the reference, which may take seconds."""
        found = importlib.import_module(f"flurries.accuracy.{_MODULES[self.name]}")
        ways: list[Way] = getattr(found, self.name)()
        return ways


@dataclass(frozen=True)
class Point:
    """One measured way.

    Attributes
    ----------
    setting : str
    error : float
        In the axis' unit.
    median, fastest : float
        Milliseconds for a frame.
    runs : int
    best : bool
        Whether nothing else is both faster and as right (the Pareto front, by the fastest run).
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

    def plain(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {**asdict(self.axis), "points": [asdict(point) for point in self.points]}


_LIST: tuple[tuple[str, Axis], ...] = (
    ("texture", Axis("precision", "Precision and kernels of the texture, 512 x 512",
                     "in sigma, largest", "phases and transform in extended precision")),
    ("texture", Axis("transform", "Transforms of one tile", "in sigma, largest",
                     "the inverse transform in extended precision, of the same tile")),
    ("modes", Axis("modes", "The same bits on every processor, texture of 512 x 512",
                   "in sigma, largest", "phases and transform in extended precision")),
    ("drift", Axis("phase", "Ways to advance 392 phases, after 10^5 frames", "in cycles, largest",
                   "rate times time in extended precision")),
    ("texture", Axis("film", "2-D method against 3-D method, 64 x 64", "in sigma, rms",
                     "the 2-D sum with unrounded rates, in extended precision")),
    ("look", Axis("octaves", "Octaves of waves, 512 x 512", "of the autocorrelation, rms",
                  "the four-octave 1/f band in the continuum: an integral of J0")),
    ("look", Axis("tile", "Size of the tile, 512 x 512", "of the autocorrelation, rms",
                  "the same band in the continuum")),
    ("look", Axis("blend", "Overlap and blend law, 512 x 512", "of the contrast",
                  "contrast 1 everywhere, from the weights; and no waves finer than the band")),
    ("texture", Axis("shutter", "Shutter by sinc or by sub-frames, 256 x 256", "in sigma, rms",
                     "64 Gauss-Legendre nodes over the exposure")),
    ("air", Axis("flakes", "2,000 flakes of 0.3 to 2 px, 512 x 512", "of opacity, rms",
                 "each flake's Gaussian integrated over the pixels, float64")),
    ("air", Axis("hybrid", "Particles against the hybrid, 192 x 192",
                 "of the power of octaves, rms",
                 "closed-form statistics; 200 frames, so noise of about 0.01")),
    ("light", Axis("composite", "Six layers in 8 bits or in floats, 512 x 512", "of 255, largest",
                   "the same layers in float64, one after the other")),
    ("gas", Axis("footprint", "Footprints of gas, 300 particles, 320 x 240", "of opacity, mean",
                    "the line integral through every particle at every pixel, float64")),
    ("gas", Axis("stop", "Stopping early in gas, 2,000 particles, 320 x 240",
                    "of opacity, largest", "no early stop, float64")),
    ("cone", Axis("cone", "Filter of the double cone, 240 x 180", "of opacity, rms",
                  "16 x 16 samples in each pixel, nearest texels")),
    ("look", Axis("depth", "Depth by tile or by pixel, 320 x 240", "of opacity, rms",
                  "96 pictures of walls at one depth each, taken pixel by pixel")),
)  # fmt: skip
_MODULES = {axis.name: module for module, axis in _LIST}

AXES: dict[str, Axis] = {axis.name: axis for _, axis in _LIST}


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
        Of `AXES`; all of them if not given, in about ten minutes.
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
    if names is None:
        names = list(AXES)
    elif isinstance(names, str):
        names = [names]
    axes = [AXES[choice("names", name, tuple(AXES))] for name in names]
    return [Study(axis, tuple(_measured(axis.ways(), count))) for axis in progress(axes)]


def _measured(ways: list[Way], runs: int) -> list[Point]:
    # The first call of each is not timed: it plans, allocates and warms up.
    errors = [way.error(way.make()) for way in ways]
    times: list[list[float]] = [[] for _ in ways]
    for _ in range(runs):
        for way, spent in zip(ways, times, strict=True):
            began = time.perf_counter()
            way.make()
            spent.append(1e3 * (time.perf_counter() - began) / way.per)
    return [
        Point(way.setting, error, statistics.median(spent), min(spent), runs,
              _is_best(error, min(spent), errors, times))
        for way, error, spent in zip(ways, errors, times, strict=True)
    ]  # fmt: skip


def _is_best(error: float, spent: float, errors: list[float], times: list[list[float]]) -> bool:
    return not any(
        (other <= error and min(t) <= spent) and (other < error or min(t) < spent)
        for other, t in zip(errors, times, strict=True)
    )
