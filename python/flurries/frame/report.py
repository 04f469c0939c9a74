"""The plan of a scene for people and programs: a table, JSON, and a picture in a notebook."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

from flurries.frame.needs import LeftOut
from flurries.frame.show import listing
from flurries.frame.tolerance import Spent


@dataclass(frozen=True)
class PlannedStep:
    """A step of rendering a frame."""

    name: str  # "snow: texture"; steps of the scene itself have no effect's name.
    size: str  # Of what it makes.
    milliseconds: float  # Estimated, a mean over the frames.
    bytes: int  # Allocated by it at its height, at most.
    share: float = 1.0  # Of the frames in which it runs.
    once: bool = False  # Whether it runs for the first frame alone; its time is that one's.


@dataclass(frozen=True)
class Plan:
    """The cost of rendering a scene; printing it gives a table.

    Attributes
    ----------
    size : (width, height)
        Pixels.
    frames : (first, last, count)
        Of the film, or of what was asked for.
    steps : tuple of PlannedStep
        In their order, with a name, milliseconds and bytes.
    left_out : tuple of LeftOut
        What is not done, and why.
    milliseconds : float
        Estimated for a frame: the steps together, without what runs once.
    bytes : int
        Most that is allocated at one time while a frame is rendered, with the frame; without what
        the scene holds.
    threads : int
        What the times are for.
    tolerance, error : float
        That was given, of full scale, and the most that a frame errs by.
    spent : tuple of Spent
        What the tolerance is spent on.
    """

    size: tuple[int, int]
    frames: tuple[int, int, int]
    steps: tuple[PlannedStep, ...]
    left_out: tuple[LeftOut, ...]
    milliseconds: float
    bytes: int
    threads: int
    tolerance: float = 0.0
    error: float = 0.0
    spent: tuple[Spent, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as plain values."""
        values: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return values | {"frames": dict(zip(("first", "last", "count"), self.frames, strict=True))}

    def to_json(self) -> str:
        """Return the plan as JSON."""
        return json.dumps(self.to_dict(), indent=2)

    def __str__(self) -> str:
        lines = []
        for title, rows in self._tables():
            wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
            lines += ["", title]
            for row in rows:
                cells = (cell.ljust(width) for cell, width in zip(row, wide, strict=True))
                lines.append("  ".join(cells).rstrip())
        return "\n".join(lines[1:])

    def _repr_html_(self) -> str:
        """Return tables, with a bar for each step's share of the time."""
        longest = max((step.milliseconds for step in self.steps), default=0.0) or 1.0
        bars = ["█" * round(20.0 * step.milliseconds / longest) for step in self.steps]
        (title, steps), *more = self._tables()
        rows = [(*row, bar) for row, bar in zip(steps, ["", *bars, ""], strict=True)]
        tables = [f"<b>{title}</b>{listing(rows)}" for title, rows in [(title, rows), *more]]
        return f"<div>{''.join(tables)}</div>"

    def _tables(self) -> list[tuple[str, list[tuple[str, ...]]]]:
        """Return the steps, what is left out and what a tolerance is spent on, with titles."""
        rows = [("step", "what", f"{'ms':>8}", f"{'MiB':>8}", "")]
        for step in self.steps:
            rare = f"in {100.0 * step.share:.0f} % of the frames" if step.share < 1.0 else ""
            when = "once" if step.once else rare
            rows.append((step.name, step.size, *_figures(step.milliseconds, step.bytes), when))
        first, last, count = self.frames
        film = f"frames {first} to {last}: {1e-3 * self.milliseconds * count:.3g} s"
        film = f"frame {first}" if count == 1 else film
        rows.append(("a frame", film, *_figures(self.milliseconds, self.bytes), ""))
        size = f"{self.size[0]} x {self.size[1]} px"
        tables: list[tuple[str, list[tuple[str, ...]]]] = [
            (f"{size}, {self.threads} thread{'s' * (self.threads > 1)}", [*rows])
        ]
        if self.left_out:
            tables.append(("left out", [(one.what, one.why) for one in self.left_out]))
        if self.tolerance > 0.0:
            found = f"error at most {self.error:.3g}"
            found = found if self.spent else "nothing to be saved, no error"
            why = "opacity off by {0.error:.2g}, {0.milliseconds:.3g} ms saved"
            saved = [(one.what, why.format(one)) for one in self.spent]
            tables.append((f"tolerance {self.tolerance:.3g}: {found}", [*saved]))
        return tables


def _figures(milliseconds: float, size: float) -> tuple[str, str]:
    return f"{milliseconds:8.3g}", f"{size / 2.0**20:8.1f}"
