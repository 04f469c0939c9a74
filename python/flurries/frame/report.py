"""The plan of a scene for people and programs: a table, JSON, and a picture in a notebook."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from flurries.frame.needs import LeftOut
from flurries.frame.show import listing
from flurries.frame.tolerance import Spent

_NOTHING = "nothing to be saved, no error"


@dataclass(frozen=True)
class PlannedStep:
    """A step of rendering a frame."""

    name: str  # "snow: texture"; steps of the scene itself have no effect's name.
    size: str  # Of what it makes.
    milliseconds: float  # Estimated, a mean over the frames.
    bytes: int  # Allocated by it at its height, at most.
    share: float = 1.0  # Of the frames in which it runs.
    once: bool = False  # Whether it runs for the first frame alone; its time is that one's.

    def words(self) -> tuple[str, str, str, str, str]:
        """Return name, size, milliseconds, MiB, and when it runs."""
        rare = f"in {100.0 * self.share:.0f} % of the frames" if self.share < 1.0 else ""
        return self.name, self.size, *_figures(self), "once" if self.once else rare


@dataclass(frozen=True)
class Plan:
    """What rendering a scene takes; printing it gives a table.

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
        rows = [("step", "what", "ms", "MiB", ""), *(step.words() for step in self.steps)]
        rows.append(("a frame", self._film(), *_figures(self), ""))
        lines = [f"{self._pixels()}, {self.threads} thread{'s' * (self.threads > 1)}"]
        lines += _columns(rows, right=(2, 3))
        for title, notes in self._notes():
            lines += ["", title, *_columns(notes)]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return tables, with a bar for each step's share of the time."""
        longest = max((step.milliseconds for step in self.steps), default=0.0) or 1.0
        rows = []
        for step in self.steps:
            name, what, ms, mib, when = map(html.escape, step.words())
            bar = f"width:{12.0 * step.milliseconds / longest:.2f}em;height:10px;background:#4a7ba6"
            cells = "</td><td style='padding:2px 10px'>".join(
                (name, what, f"{ms} ms", f"{mib} MiB", f"<div style='{bar}'></div>", when)
            )
            rows.append(f"<tr><td>{cells}</td></tr>")
        ms, mib = _figures(self)
        page = f"<b>{self._pixels()}: {ms} ms a frame, {mib} MiB</b> ({html.escape(self._film())})"
        page += f"<table>{''.join(rows)}</table>"
        for title, notes in self._notes():
            page += f"<b>{title}</b>" + (listing(notes) if notes else "")
        return f"<div>{page}</div>"

    def _pixels(self) -> str:
        return f"{self.size[0]} x {self.size[1]} px"

    def _notes(self) -> list[tuple[str, list[tuple[str, str]]]]:
        """Return what is left out, and what a tolerance is spent on, each under its title."""
        notes: list[tuple[str, list[tuple[str, str]]]] = []
        if self.left_out:
            notes.append(("left out", [(one.what, one.why) for one in self.left_out]))
        if self.tolerance > 0.0:
            found = f"error at most {self.error:.3g}" if self.spent else _NOTHING
            saved = [
                (one.what, f"opacity off by {one.error:.2g}, {one.milliseconds:.3g} ms saved")
                for one in self.spent
            ]
            notes.append((f"tolerance {self.tolerance:.3g}: {found}", saved))
        return notes

    def _film(self) -> str:
        first, last, count = self.frames
        if count == 1:
            return f"frame {first}"
        return f"frames {first} to {last}: {1e-3 * self.milliseconds * count:.3g} s"


def _figures(one: Plan | PlannedStep) -> tuple[str, str]:
    """Return milliseconds and MiB as text."""
    return f"{one.milliseconds:.3g}", f"{one.bytes / 2.0**20:.1f}"


def _columns(rows: Sequence[tuple[str, ...]], right: tuple[int, ...] = ()) -> list[str]:
    """Return rows of text as lines with aligned columns, some of them to the right."""
    wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = [">" if place in right else "<" for place in range(len(wide))]
    form = "  ".join(f"{{:{side}{width}}}" for side, width in zip(sides, wide, strict=True))
    return [form.format(*row).rstrip() for row in rows]
