"""Error against time of every approximation: ``python benches/accuracy.py [AXIS...]``.

References are slow and independent: sums in extended precision, brute force, closed forms.
``--write`` makes docs/internals/accuracy.md with its plots.
"""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import accuracy_axes
import matplotlib
from accuracy_axes import Axis, Way
from timing import timed

import flurries as fl

matplotlib.use("Agg")
from matplotlib import pyplot as plt

# In the order of the page.
AXES = {found.name: found for found in vars(accuracy_axes).values() if isinstance(found, Axis)}

DOCS, RUNS = Path(__file__).parents[1] / "docs", 20


class Point(NamedTuple):
    """One measured way; `best` where nothing else is both faster and as right."""

    setting: str
    error: float
    median: float
    fastest: float
    best: bool


def measure(ways: Sequence[Way], runs: int) -> list[Point]:
    """Return the error and the times of ways, called in turn: a busy moment meets all of them."""
    errors = [way.error(way.make()) for way in ways]
    times = list(timed({way.setting: way.make for way in ways}, runs, warm=0).values())
    best = unbeaten([(e, least) for e, (least, _) in zip(errors, times, strict=True)])
    return [
        Point(way.setting, error, median, least, front)
        for way, error, (least, median), front in zip(ways, errors, times, best, strict=True)
    ]


def unbeaten(costs: Sequence[tuple[float, float]]) -> list[bool]:
    """Return for each (error, time) whether no other is at most as large in both."""
    return [
        not any(e <= error and t <= spent and (e, t) != (error, spent) for e, t in costs)
        for error, spent in costs
    ]


_HEAD = """# What accuracy costs

Made by `make accuracy` ({machine}, {threads} threads). For every approximation: its error against
an independent reference, and the time of a frame. Times belong to that machine and moment: read
them as ratios within a table. On the orange line lies what nothing else beats in both.
`python benches/accuracy.py` measures yours, `flurries plan --accuracy` the snow of a scene.

![Error against time](../images/accuracy/accuracy.png)
"""

_AXIS = """
## {axis.title}

`python benches/accuracy.py {axis.name}`. Error {axis.unit}. Against: {axis.reference}.

| setting | error | fastest of {runs}, ms | median, ms | unbeaten |
| --- | --- | --- | --- | --- |
"""


def table(axis: Axis, points: Sequence[Point], runs: int) -> str:
    """Return the points of an axis, the most accurate first."""
    return _AXIS.format(axis=axis, runs=runs) + "".join(
        f"| {p.setting} | {p.error:.2g} | {p.fastest:.3g} | {p.median:.3g} | "
        f"{'yes' if p.best else ''} |\n"
        for p in sorted(points, key=lambda p: p.error)
    )


INK, QUIET, FRONT = "#1d2b3a", "#8fa3b5", "#d2691e"
# An error of 0 has no logarithm.
LEAST = 1e-17


def plot(studies: Sequence[tuple[Axis, list[Point]]], file: Path) -> None:
    rows = -(-len(studies) // 2)
    figure, grid = plt.subplots(rows, 2, figsize=(16.0, 3.6 * rows), dpi=90, squeeze=False)
    for ax, (axis, points) in zip(grid.flat, studies, strict=False):
        draw(ax, axis, points)
    figure.tight_layout()
    figure.savefig(file, metadata={"Software": None})
    plt.close(figure)


def draw(ax: Any, axis: Axis, points: Sequence[Point]) -> None:
    points = sorted(points, key=lambda point: point.error)
    best = [point for point in points if point.best]
    ax.plot([p.fastest for p in best], [max(p.error, LEAST) for p in best], "-", color=FRONT)
    for number, point in enumerate(points):
        error, color = max(point.error, LEAST), FRONT if point.best else QUIET
        ax.plot([point.fastest, point.median], [error, error], "-", color=QUIET)
        ax.plot(point.fastest, error, "o", color=color, zorder=3)
        ax.annotate(
            point.setting, (point.fastest, error), xytext=(1.04, (number + 0.5) / len(points)),
            textcoords="axes fraction", va="center", fontsize=8,
            color=INK if point.best else "#61758a",
            arrowprops={"arrowstyle": "-", "color": color, "lw": 0.4, "relpos": (0.0, 0.5)},
        )  # fmt: skip
    ax.set(xscale="log", yscale="log")
    ax.set_title(axis.title, fontsize=10, color=INK, loc="left")
    ax.set_xlabel("ms a frame: fastest, and line to the median", fontsize=8, color=INK)
    ax.set_ylabel(f"error {axis.unit}", fontsize=8, color=INK)
    ax.tick_params(labelsize=8, colors=INK)
    ax.grid(True, color="#e4eaf0", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("axes", nargs="*", metavar="AXIS", help=f"of {', '.join(AXES)}")
    parser.add_argument("--write", action="store_true", help="make the page of all axes")
    given = parser.parse_args()
    studies = []
    machine = f"{platform.machine()}, {os.cpu_count()} cores"
    parts = [_HEAD.format(machine=machine, threads=fl.settings().threads)]
    for axis in (AXES[name] for name in given.axes or AXES):
        studies.append((axis, measure(list(axis.ways()), RUNS)))
        parts.append(table(*studies[-1], RUNS))
        print(parts[-1])
    if given.write:
        plot(studies, DOCS / "images/accuracy/accuracy.png")
        (DOCS / "internals/accuracy.md").write_text("".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main()
