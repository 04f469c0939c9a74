"""Error against time, both logarithmic; what nothing beats is joined by a line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flurries.accuracy.study import Study

INK, QUIET, FRONT = "#1d2b3a", "#8fa3b5", "#d2691e"

# An error of 0 has no logarithm.
LEAST = 1e-17

# What a reader of the README sees first.
MAIN = ("precision", "shutter", "flakes", "composite", "footprint", "octaves")


def save(studies: list[Study], folder: Path) -> list[Path]:
    """Write a plot for each study, and one of six to look at; return the files."""
    try:
        import matplotlib
    except ImportError:
        raise ImportError("plots need matplotlib: pip install 'flurries[plots]'") from None
    matplotlib.use("Agg", force=False)
    first = [study for study in studies if study.axis.name in MAIN] or studies[:6]
    sheets = {study.axis.name: [study] for study in studies} | {"accuracy": first}
    return [_sheet(drawn, folder / f"{name}.png") for name, drawn in sheets.items()]


def _sheet(studies: list[Study], file: Path) -> Path:
    """Write plots side by side, two in a row."""
    from matplotlib import pyplot as plt

    columns = min(2, len(studies))
    rows = -(-len(studies) // columns)
    size = (8.0 * columns, 3.6 * rows)
    figure, grid = plt.subplots(rows, columns, figsize=size, dpi=90, squeeze=False)
    for ax in grid.flat[len(studies) :]:
        ax.set_visible(False)
    for ax, study in zip(grid.flat, studies, strict=False):
        draw(ax, study)
    figure.tight_layout()
    figure.savefig(file, metadata={"Software": None})
    plt.close(figure)
    return file


def draw(ax: Any, study: Study) -> None:
    """Draw a study: dots at the fastest run, and the settings in a list that lines lead to."""
    points = sorted(study.points, key=lambda point: point.error)
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
    ax.set_title(study.axis.title, fontsize=10, color=INK, loc="left")
    ax.set_xlabel("ms a frame: fastest, and line to the median", fontsize=8, color=INK)
    ax.set_ylabel(f"error {study.axis.unit}", fontsize=8, color=INK)
    for ticks, size in (("major", 8), ("minor", 6)):
        ax.tick_params(which=ticks, labelsize=size, colors=INK)
    ax.grid(True, color="#e4eaf0", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
