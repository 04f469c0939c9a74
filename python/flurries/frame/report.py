"""The plan of a scene for people and programs: a table, JSON, and a picture in a notebook."""

from __future__ import annotations

import html
import json
from dataclasses import asdict, dataclass
from typing import Any

from flurries.frame.needs import LeftOut
from flurries.frame.tolerance import Spent

MIB = 2.0**20


@dataclass(frozen=True)
class PlannedStep:
    """A step of rendering a frame.

    Attributes
    ----------
    name : str
        "snow: texture"; steps of the scene itself have no effect's name.
    size : str
        Of what it makes.
    milliseconds : float
        Estimated, a mean over the frames.
    bytes : int
        Allocated by it at its height, at most.
    share : float
        Of the frames in which it runs.
    once : bool
        Whether it runs for the first frame alone; its time is that one's.
    """

    name: str
    size: str
    milliseconds: float
    bytes: int
    share: float = 1.0
    once: bool = False


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
        In their order.
    left_out : tuple of LeftOut
        What is not done, and why.
    milliseconds : float
        Estimated for a frame: the steps together, without what runs once.
    bytes : int
        Most that is allocated at one time while a frame is rendered, with the frame; without what
        the scene holds.
    threads : int
        What the times are for.
    tolerance : float
        That was given, of full scale; 0 without.
    error : float
        To be expected of it at most.
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
        values = {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(self).items()
        }
        return values | {"frames": dict(zip(("first", "last", "count"), self.frames, strict=True))}

    def to_json(self) -> str:
        """Return the plan as JSON."""
        return json.dumps(self.to_dict(), indent=2)

    def __str__(self) -> str:
        width, height = self.size
        lines = [f"{width} x {height} px, {self.threads} thread{'s' * (self.threads > 1)}"]
        total = ("a frame", self._film(), *_figures(self), "")
        lines += _columns([("step", "what", "ms", "MiB", ""), *self._rows(), total], right=(2, 3))
        for title, rows in self._notes():
            lines += ["", title, *_columns(rows)]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return tables, with a bar for each step's share of the time."""
        width, height = self.size
        longest = max((step.milliseconds for step in self.steps), default=0.0) or 1.0
        rows = []
        for step, (name, what, ms, mib, when) in zip(self.steps, self._rows(), strict=True):
            part = 100.0 * step.milliseconds / longest
            bar = f"<div style='background:#4a7ba6;height:10px;width:{part:.1f}%'></div>"
            cells = _cells(name, what, f"{ms} ms", f"{mib} MiB")
            rows.append(f"<tr>{cells}<td style='width:12em'>{bar}</td>{_cells(when)}</tr>")
        ms, mib = _figures(self)
        film = html.escape(self._film())
        page = f"<b>{width} x {height} px: {ms} ms a frame, {mib} MiB</b> ({film})"
        page += f"<table>{''.join(rows)}</table>"
        for title, notes in self._notes():
            lines = "".join(f"<tr>{_cells(*note)}</tr>" for note in notes)
            page += f"<b>{title}</b>" + (f"<table>{lines}</table>" if lines else "")
        return f"<div>{page}</div>"

    def _rows(self) -> list[tuple[str, ...]]:
        """Return the steps as text: name, size, milliseconds, MiB, and when it runs."""
        return [(step.name, step.size, *_figures(step), _when(step)) for step in self.steps]

    def _notes(self) -> list[tuple[str, list[tuple[str, ...]]]]:
        """Return what is left out, and what a tolerance is spent on, each under its title."""
        notes: list[tuple[str, list[tuple[str, ...]]]] = []
        if self.left_out:
            why: list[tuple[str, ...]] = [(one.what, one.why) for one in self.left_out]
            notes.append(("left out", why))
        if self.tolerance > 0.0:
            rest = (
                f"error at most {self.error:.3g}" if self.spent else "nothing to be saved, no error"
            )
            saved: list[tuple[str, ...]] = [
                (one.what, f"opacity off by {one.error:.2g}, {one.milliseconds:.3g} ms saved")
                for one in self.spent
            ]
            notes.append((f"tolerance {self.tolerance:.3g}: {rest}", saved))
        return notes

    def _film(self) -> str:
        first, last, count = self.frames
        if count == 1:
            return f"frame {first}"
        return f"frames {first} to {last}: {1e-3 * self.milliseconds * count:.3g} s"


def _figures(one: Plan | PlannedStep) -> tuple[str, str]:
    """Return milliseconds and MiB as text."""
    return f"{one.milliseconds:.3g}", f"{one.bytes / MIB:.1f}"


def _when(step: PlannedStep) -> str:
    """Return in which frames a step runs, if not in all."""
    if step.once:
        return "once"
    return "" if step.share == 1.0 else f"in {100.0 * step.share:.0f} % of the frames"


def _columns(rows: list[tuple[str, ...]], right: tuple[int, ...] = ()) -> list[str]:
    """Return rows of text as lines with aligned columns, some of them to the right."""
    wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            text.rjust(width) if place in right else text.ljust(width)
            for place, (text, width) in enumerate(zip(row, wide, strict=True))
        ).rstrip()
        for row in rows
    ]


def _cells(*texts: str) -> str:
    """Return the cells of a table's row."""
    return "".join(f"<td style='padding:2px 10px'>{html.escape(text)}</td>" for text in texts)
