"""Error against time, both logarithmic; what nothing beats is joined by a line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flurries.accuracy.study import Point, Study

INK, QUIET, FRONT = "#1d2b3a", "#8fa3b5", "#d2691e"

# An error of 0 has no logarithm.
LEAST = 1e-17

# What a reader of the README sees first.
MAIN = ("precision", "shutter", "flakes", "composite", "footprint", "octaves")


def draw(ax: Any, study: Study, *, small: bool = False) -> None:
    """Draw a study into axes."""
    points = sorted(study.points, key=lambda point: point.fastest)
    best = [point for point in points if point.best]
    ax.plot([p.fastest for p in best], [max(p.error, LEAST) for p in best], "-", color=FRONT,
            linewidth=1.2, zorder=1)  # fmt: skip
    for point in points:
        error = max(point.error, LEAST)
        ax.plot([point.fastest, point.median], [error, error], "-", color=QUIET, linewidth=0.8)
        ax.plot(point.fastest, error, "o", markersize=5, zorder=3,
                color=FRONT if point.best else QUIET)  # fmt: skip
    _scale(ax)
    _label(ax, points, 6.5 if small else 7.5)
    ax.set_title(study.axis.title, fontsize=8.5 if small else 10, color=INK, loc="left")
    size = 7 if small else 8
    ax.set_xlabel("ms a frame: fastest, and line to the median", fontsize=size, color=INK)
    ax.set_ylabel(f"error {study.axis.unit}", fontsize=size, color=INK)
    ax.tick_params(labelsize=size, colors=INK)
    ax.grid(True, which="major", color="#e4eaf0", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def _scale(ax: Any) -> None:
    """Make both axes logarithmic, with room for words above, below, and right of the slowest."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ax.set(xscale="log", yscale="log")
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    room = (high / low) ** 0.1
    ax.set_ylim(low / room, high * room)
    ax.set_xlim(left / 1.1, right * (right / left) ** 0.5 * 1.4)
    left, right = ax.get_xlim()
    for axis, narrow in ((ax.xaxis, right / left < 100.0), (ax.yaxis, high / low < 100.0)):
        if narrow or axis is ax.xaxis:
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
        axis.set_minor_formatter(NullFormatter())


def _label(ax: Any, points: list[Point], size: float) -> None:
    """Write the settings beside the points, moved up or down where they would overlap."""
    from matplotlib.patheffects import withStroke

    pixel = ax.figure.dpi / 72.0
    height = 1.15 * size * pixel
    floor, ceiling = ax.transAxes.transform([(0, 0), (1, 1)])[:, 1]
    taken: list[tuple[float, float, float]] = []
    for point in points:
        place = (point.fastest, max(point.error, LEAST))
        x, y = ax.transData.transform(place)
        x += 5.0 * pixel
        end = x + 0.56 * size * pixel * len(point.setting)
        # Beside it, then ever farther above and below.
        for step in sorted((0.25 * height * n for n in range(-40, 41)), key=abs):
            at = y + step
            free = all(abs(at - other) >= height or end < start or x > stop
                       for other, start, stop in taken)  # fmt: skip
            if free and floor + 0.5 * height < at < ceiling + height:
                break
        taken.append((at, x, end))
        ax.annotate(point.setting, place, textcoords="offset pixels", fontsize=size, va="center",
                    zorder=2, xytext=(5.0 * pixel, at - y), color=INK if point.best else "#61758a",
                    path_effects=[withStroke(linewidth=2.0, foreground="white")])  # fmt: skip


def save(studies: list[Study], folder: Path) -> list[Path]:
    """Write a plot for each study, and one of the first six to look at; return the files."""
    try:
        import matplotlib
    except ImportError:
        raise ImportError("plots need matplotlib: pip install 'flurries[plots]'") from None
    matplotlib.use("Agg", force=False)
    found = {study.axis.name: study for study in studies}
    first = list(dict.fromkeys(name for name in (*MAIN, *found) if name in found))[:6]
    sheets = {name: [study] for name, study in found.items()}
    return [
        _sheet(drawn, folder / f"{name}.png", small=name == "accuracy")
        for name, drawn in {**sheets, "accuracy": [found[name] for name in first]}.items()
    ]


def _sheet(studies: list[Study], file: Path, *, small: bool) -> Path:
    """Write plots side by side, three in a row."""
    from matplotlib import pyplot as plt

    columns = min(3, len(studies))
    rows = -(-len(studies) // columns)
    width, height = (4.6, 3.4) if small else (6.4, 4.0)
    figure, grid = plt.subplots(rows, columns, figsize=(width * columns, height * rows), dpi=110,
                                squeeze=False)  # fmt: skip
    for ax in grid.flat[len(studies) :]:
        ax.set_visible(False)
    for ax, study in zip(grid.flat, studies, strict=False):
        draw(ax, study, small=small)
    figure.tight_layout()
    figure.savefig(file, metadata={"Software": None})
    plt.close(figure)
    return file
