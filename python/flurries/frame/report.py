"""The plan of a scene for people and programs: a table, JSON, and a picture in a notebook."""

from __future__ import annotations

import html
import json
from dataclasses import asdict, dataclass
from typing import Any

from flurries.frame.needs import LeftOut, Spent

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
        first, last, count = self.frames
        return {
            "size": list(self.size),
            "frames": {"first": first, "last": last, "count": count},
            "threads": self.threads,
            "milliseconds": self.milliseconds,
            "bytes": self.bytes,
            "steps": [asdict(step) for step in self.steps],
            "left_out": [asdict(one) for one in self.left_out],
            "tolerance": self.tolerance,
            "error": self.error,
            "spent": [asdict(one) for one in self.spent],
        }

    def to_json(self) -> str:
        """Return the plan as JSON."""
        return json.dumps(self.to_dict(), indent=2)

    def __str__(self) -> str:
        width, height = self.size
        rows = [("step", "what", "ms", "MiB", "")]
        rows += [
            (
                step.name,
                step.size,
                f"{step.milliseconds:.3g}",
                f"{step.bytes / MIB:.1f}",
                _when(step),
            )
            for step in self.steps
        ]
        total = f"{self.milliseconds:.3g}"
        rows.append(("a frame", self._film(), total, f"{self.bytes / MIB:.1f}", ""))
        wide = [max(len(row[i]) for row in rows) for i in range(5)]
        lines = [f"{width} x {height} px, {self.threads} thread{'s' * (self.threads > 1)}"]
        for name, what, ms, mib, when in rows:
            line = f"{name:<{wide[0]}}  {what:<{wide[1]}}  {ms:>{wide[2]}}  {mib:>{wide[3]}}"
            lines.append(f"{line}  {when}".rstrip())
        if self.left_out:
            lines += ["", "left out"]
            most = max(len(one.what) for one in self.left_out)
            lines += [f"{one.what:<{most}}  {one.why}" for one in self.left_out]
        if self.tolerance > 0.0:
            lines += ["", self._spending()]
            most = max((len(one.what) for one in self.spent), default=0)
            lines += [
                f"{one.what:<{most}}  opacity off by {one.error:.2g}, "
                f"{one.milliseconds:.3g} ms saved"
                for one in self.spent
            ]
        return "\n".join(lines)

    def _spending(self) -> str:
        if not self.spent:
            return f"tolerance {self.tolerance:.3g}: nothing to be saved, no error"
        return f"tolerance {self.tolerance:.3g}: error at most {self.error:.3g}"

    def _film(self) -> str:
        first, last, count = self.frames
        if count == 1:
            return f"frame {first}"
        return f"frames {first} to {last}: {1e-3 * self.milliseconds * count:.3g} s"

    def _repr_html_(self) -> str:
        """Return a table with a bar for each step's share of the time."""
        longest = max((step.milliseconds for step in self.steps), default=0.0) or 1.0
        cell = "padding:2px 10px;text-align:"
        rows = []
        for step in self.steps:
            part = 100.0 * step.milliseconds / longest
            bar = f"<div style='background:#4a7ba6;height:10px;width:{part:.1f}%'></div>"
            rows.append(
                f"<tr><td style='{cell}left'>{html.escape(step.name)}</td>"
                f"<td style='{cell}left'>{html.escape(step.size)}</td>"
                f"<td style='{cell}right'>{step.milliseconds:.3g} ms</td>"
                f"<td style='{cell}right'>{step.bytes / MIB:.1f} MiB</td>"
                f"<td style='{cell}left;width:12em'>{bar}</td>"
                f"<td style='{cell}left'>{_when(step)}</td></tr>"
            )
        width, height = self.size
        out = "".join(
            f"<tr style='color:#888'><td style='{cell}left'>{html.escape(one.what)}</td>"
            f"<td style='{cell}left' colspan='5'>{html.escape(one.why)}</td></tr>"
            for one in self.left_out
        )
        spent = "".join(
            f"<tr><td style='{cell}left'>{html.escape(one.what)}</td>"
            f"<td style='{cell}left'>opacity off by {one.error:.2g}</td>"
            f"<td style='{cell}right'>{one.milliseconds:.3g} ms saved</td></tr>"
            for one in self.spent
        )
        total = f"{self.milliseconds:.3g} ms a frame, {self.bytes / MIB:.1f} MiB"
        return (
            f"<div><b>{width} x {height} px: {total}</b> ({html.escape(self._film())})"
            f"<table>{''.join(rows)}</table>"
            + (f"<b>left out</b><table>{out}</table>" if out else "")
            + (f"<b>{self._spending()}</b>" if self.tolerance > 0.0 else "")
            + (f"<table>{spent}</table>" if spent else "")
            + "</div>"
        )


def _when(step: PlannedStep) -> str:
    if step.once:
        return "once"
    return "" if step.share == 1.0 else f"in {100.0 * step.share:.0f} % of the frames"
