"""The table of axes, and measuring: ways are called in turn, so that a busy moment meets all."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from flurries._contract import choice, integer
from flurries.accuracy import layers, look, texture
from flurries.accuracy.ways import Way

# Fewer runs say little about a median.
FEWEST_RUNS = 20


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

    def plain(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        about = {name: getattr(self.axis, name) for name in ("name", "title", "unit", "reference")}
        return {**about, "points": [asdict(point) for point in self.points]}


EXTENDED = "phases and transform in extended precision"
TABLE = (
    Axis(texture.precision, "Precision and kernels of the texture, 512 x 512", "in sigma, largest",
         EXTENDED),
    Axis(texture.transform, "Transforms of one tile", "in sigma, largest",
         "the inverse transform in extended precision, of the same tile"),
    Axis(texture.modes, "The same bits on every processor, texture of 512 x 512",
         "in sigma, largest", EXTENDED),
    Axis(texture.phase, "Ways to advance 392 phases, after 10^5 frames", "in cycles, largest",
         "rate times time in extended precision"),
    Axis(texture.film, "2-D method against 3-D method, 64 x 64", "in sigma, rms",
         "the 2-D sum with unrounded rates, in extended precision"),
    Axis(look.octaves, "Octaves of waves, 512 x 512", "of the autocorrelation, rms",
         "the four-octave 1/f band in the continuum: an integral of J0"),
    Axis(look.tile, "Size of the tile, 512 x 512", "of the autocorrelation, rms",
         "the same band in the continuum"),
    Axis(look.blend, "Overlap and blend law, 512 x 512", "of the contrast",
         "contrast 1 everywhere, from the weights; and no waves finer than the band"),
    Axis(look.shutter, "Shutter by sinc or by sub-frames, 256 x 256", "in sigma, rms",
         "16 Gauss-Legendre nodes over the exposure"),
    Axis(layers.flakes, "2,000 flakes of 0.3 to 2 px, 512 x 512", "of opacity, rms",
         "each flake's Gaussian integrated over the pixels, float64"),
    Axis(layers.composite, "Six layers in 8 bits or in floats, 512 x 512", "of 255, largest",
         "the same layers in float64, one after the other"),
    Axis(layers.footprint, "Footprints of gas, 300 particles, 320 x 240", "of opacity, mean",
         "the line integral through every particle at every pixel, float64"),
    Axis(layers.stop, "Stopping early in gas, 2,000 particles, 320 x 240", "of opacity, largest",
         "no early stop, float64"),
    Axis(layers.cone, "Filter of the double cone, 240 x 180", "of opacity, rms",
         "16 x 16 samples in each pixel, nearest texels"),
    Axis(layers.depth, "Depth by tile or by pixel, 320 x 240", "of opacity, rms",
         "96 pictures of walls at one depth each, taken pixel by pixel"),
)  # fmt: skip

AXES: dict[str, Axis] = {axis.name: axis for axis in TABLE}


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
    if names is None or isinstance(names, str):
        names = list(AXES) if names is None else [names]
    axes = [AXES[choice("names", name, tuple(AXES))] for name in names]
    return [Study(axis, tuple(measure(axis.ways(), count))) for axis in progress(axes)]


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
