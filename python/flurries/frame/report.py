"""The plan of a scene for people and programs: a table, JSON, and a picture in a notebook."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

from flurries.frame.needs import LeftOut
from flurries.frame.show import listing


@dataclass(frozen=True)
class PlannedStep:
    """A step of rendering a frame."""

    name: str  # "snow: texture"; steps of the scene itself have no effect's name.
    size: str  # Of what it makes.
    milliseconds: float | None  # In a frame in which it runs; None where none was probed.
    bytes: int | None  # Allocated at its height beyond what was there when it began, at most.
    share: float = 1.0  # Of the frames in which it runs.
    once: bool = False  # Whether it runs for the first frame alone; its time is that one's.


@dataclass(frozen=True)
class Handover:
    """What a frame of snow or rain costs, and what its weather looks like, in one setting."""

    setting: str  # "hand-over at 3.4 m"
    milliseconds: float
    rms: float  # Root mean square of the weather's opacity from its mean.
    euler: int  # Pieces less holes of the hundredth of the pixels with most weather.


@dataclass(frozen=True)
class Accuracy:
    """What accuracy costs in a scene."""

    frame: int  # That was rendered.
    settings: tuple[Handover, ...]  # From the nearest hand-over to every flake drawn.
    why: str = ""  # Why there are no settings, or fewer.


@dataclass(frozen=True)
class Plan:
    """The steps of rendering a scene; printing it gives a table."""

    size: tuple[int, int]  # (width, height) px.
    frames: tuple[int, int, int]  # (first, last, count) of the film, or of what was asked for.
    steps: tuple[PlannedStep, ...]
    left_out: tuple[LeftOut, ...]
    probed: tuple[int, ...]  # The frames that were rendered to measure; none without a probe.
    # For a frame: the steps by their shares without what runs once, and rest.
    milliseconds: float | None
    first: float | None  # Milliseconds of the first frame, with what is made once and kept.
    rest: float | None  # Milliseconds between the steps.
    bytes: int | None  # Most at one time while a frame is rendered, without what the scene holds.
    threads: int  # What the times are for.
    # (effect, frame, strength): one an effect, more where it changes; see `fl.Snow.strength`.
    strengths: tuple[tuple[str, int, Any], ...] = ()
    accuracy: Accuracy | None = None

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
        times = [step.milliseconds or 0.0 for step in self.steps]
        longest = max(times, default=0.0) or 1.0
        bars = ["", *("█" * round(20.0 * time / longest) for time in times)]
        (title, steps), *more = self._tables()
        bars += [""] * (len(steps) - len(bars))
        rows = [(*row, bar) for row, bar in zip(steps, bars, strict=True)]
        tables = [f"<b>{title}</b>{listing(rows)}" for title, rows in [(title, rows), *more]]
        return f"<div>{''.join(tables)}</div>"

    def _tables(self) -> list[tuple[str, list[tuple[str, ...]]]]:
        rows = [("step", "what", f"{'ms':>8}", f"{'MiB':>8}", "")]
        for step in self.steps:
            rare = f"in {100.0 * step.share:.0f} % of the frames" if step.share < 1.0 else ""
            when = "once" if step.once else rare
            rows.append((step.name, step.size, *_figures(step.milliseconds, step.bytes), when))
        size = f"{self.size[0]} x {self.size[1]} px"
        title = f"{size}, without times"
        if self.milliseconds is not None:
            first, last, count = self.frames
            film = f"frames {first} to {last}: {1e-3 * self.milliseconds * count:.3g} s"
            film = f"frame {first}" if count == 1 else film
            rows.append(("between the steps", "", *_figures(self.rest, None), ""))
            rows.append(("the first frame", "with what is kept", *_figures(self.first, None), ""))
            rows.append(("a frame", film, *_figures(self.milliseconds, self.bytes), ""))
            title = f"{size}, {self.threads} thread{'s' * (self.threads > 1)}"
            title += f", measured in frame{'s' * (len(self.probed) > 1)} "
            title += ", ".join(map(str, self.probed))
        tables: list[tuple[str, list[tuple[str, ...]]]] = [(title, [*rows])]
        if self.strengths:
            said = [(name, f"frame {frame}", str(one)) for name, frame, one in self.strengths]
            tables.append(("strength", [*said]))
        if self.left_out:
            tables.append(("left out", [(one.what, one.why) for one in self.left_out]))
        if self.accuracy is not None:
            tables += _accuracy_tables(self.accuracy)
        return tables


def _figures(milliseconds: float | None, size: float | None) -> tuple[str, str]:
    return (
        "" if milliseconds is None else f"{milliseconds:8.3g}",
        "" if size is None else f"{size / 2.0**20:8.1f}",
    )


def _accuracy_tables(found: Accuracy) -> list[tuple[str, list[tuple[str, ...]]]]:
    rows: list[tuple[str, ...]] = []
    if found.settings:
        rows.append(("setting", f"{'ms':>8}", f"{'RMS':>8}", f"{'Euler':>8}"))
    for one in found.settings:
        numbers = f"{one.milliseconds:8.3g}", f"{one.rms:8.4f}", f"{one.euler:8d}"
        rows.append((one.setting, *numbers))
    tables = [(f"accuracy, frame {found.frame}", rows)] if rows else []
    return tables + ([("accuracy", [(found.why,)])] if found.why else [])
