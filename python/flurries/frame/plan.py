"""The plan of a scene: the steps that its effects name, and a trace of a few of its frames."""

import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import reduce
from operator import or_
from typing import Any

import numpy as np

from flurries._threads import threads
from flurries._trace import Span, Trace, tracing
from flurries.frame import planes
from flurries.frame.mixing import free_name
from flurries.frame.needs import LeftOut, needs_of
from flurries.frame.picture import images, shown_type
from flurries.frame.program import Program
from flurries.frame.show import listing
from flurries.motion.keys import Keys

# Frames of a film whose steps are asked for, spread over it, beside those where something is keyed.
LOOKED_AT = 9
MOST_KEYED = 32

PROBED = 5  # Frames that are rendered.

# An effect, -1 for the scene's own, and a step: as in a trace.
_Key = tuple[int, str]
_COMPOSITE: _Key = (-1, "composite")


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
    bent: tuple[str, ...] = ()  # What is changed so that a scene with a `loop` begins again.

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
        def row(name: str, what: str, time: float | None, size: int | None, when: str = "") -> Any:
            taken = "" if time is None else f"{time:8.3g}"
            return name, what, taken, "" if size is None else f"{size / 2.0**20:8.1f}", when

        rows = [("step", "what", f"{'ms':>8}", f"{'MiB':>8}", "")]
        for step in self.steps:
            rare = f"in {100.0 * step.share:.0f} % of the frames" if step.share < 1.0 else ""
            when = "once" if step.once else rare
            rows.append(row(step.name, step.size, step.milliseconds, step.bytes, when))
        size = f"{self.size[0]} x {self.size[1]} px"
        title = f"{size}, without times"
        if self.milliseconds is not None:
            first, last, count = self.frames
            film = f"frames {first} to {last}: {1e-3 * self.milliseconds * count:.3g} s"
            film = f"frame {first}" if count == 1 else film
            rows.append(row("between the steps", "", self.rest, None))
            rows.append(row("the first frame", "with what is kept", self.first, None))
            rows.append(row("a frame", film, self.milliseconds, self.bytes))
            title = f"{size}, {self.threads} thread{'s' * (self.threads > 1)}"
            title += f", measured in frame{'s' * (len(self.probed) > 1)} "
            title += ", ".join(map(str, self.probed))
        tables: dict[str, list[tuple[str, ...]]] = {
            title: [*rows],
            "strength": [(name, f"frame {frame}", str(one)) for name, frame, one in self.strengths],
            "changed for the loop": [(line,) for line in self.bent],
            "left out": [(one.what, one.why) for one in self.left_out],
        }
        found = self.accuracy
        if found is not None and found.settings:
            tables[f"accuracy, frame {found.frame}"] = [
                ("setting", f"{'ms':>8}", f"{'RMS':>8}", f"{'Euler':>8}"),
                *((one.setting, f"{one.milliseconds:8.3g}", f"{one.rms:8.4f}", f"{one.euler:8d}")
                  for one in found.settings),
            ]  # fmt: skip
        if found is not None and found.why:
            tables["accuracy"] = [(found.why,)]
        return [(title, cells) for title, cells in tables.items() if cells]


@dataclass(frozen=True)
class _Look:
    """The steps of a frame, each with whether all frames share it, and what it goes without."""

    t: int
    steps: dict[_Key, bool]
    sizes: dict[_Key, str]
    left_out: list[LeftOut]


def plan_of(program: Program, numbers: Sequence[int], *, probe: bool = True) -> Plan:
    """Return the plan of a scene's frames; see :meth:`flurries.Scene.plan`."""
    holders = [*program.effects, *program.base.lights, program.base.lens]
    values = [value for one in holders for value in getattr(one, "__dict__", {}).values()]
    times = {round(t) for keys in values if isinstance(keys, Keys) for t, _ in keys.keys}
    keyed = times.intersection(numbers)
    spread = [numbers[i] for i in np.linspace(0, len(numbers) - 1, LOOKED_AT).astype(int)]
    looks = [_look(program, t) for t in sorted({*sorted(keyed)[:MOST_KEYED], *spread})]
    middle = numbers[(len(numbers) - 1) // 2]
    probed = _probed(looks, middle, keyed) if probe else ()
    cold, warm = _traces(program, probed)
    steps = _steps(program, looks, cold, warm)
    first = rest = total = None
    if warm:
        first = 1e3 * (sum(cold[0].sums("seconds").values()) + cold[0].outside.seconds)
        rest = 1e3 * float(np.mean([trace.outside.seconds for trace in warm]))
        total = rest + sum(s.share * (s.milliseconds or 0.0) for s in steps if not s.once)
    return Plan(
        size=program.base.shape[::-1], frames=(numbers[0], numbers[-1], len(numbers)),
        steps=tuple(steps), strengths=tuple(_strengths(program, (numbers[0], middle, numbers[-1]))),
        left_out=(*program.left_out, *_left_out(looks)), probed=probed, milliseconds=total,
        first=first, rest=rest, bytes=max((trace.bytes for trace in cold), default=None),
        threads=threads(),
    )  # fmt: skip


def _steps(
    program: Program, looks: Sequence[_Look], cold: Sequence[Trace], warm: Sequence[Trace]
) -> list[PlannedStep]:
    """Return the steps of all frames: what happens once has the times of the first traces."""
    keys = dict.fromkeys(key for look in looks for key in look.steps)
    names, found = _names(program), []
    for key in sorted(keys, key=lambda key: (key == _COMPOSITE, key[0])):
        name, step = names.get(key[0], ""), key[1]
        label = step if name in ("", step) else f"{name}: {step}"
        there = [look for look in looks if key in look.steps]
        once, size = there[0].steps[key], there[0].sizes.get(key, "")
        first, runs = (
            [trace.spans[key] for trace in traces if key in trace.spans]
            for traces in (cold, cold if once else warm)
        )
        time = 1e3 * float(np.mean([span.seconds for span in runs])) if runs else None
        most = max((span.bytes for span in first), default=None)
        share = len(there) / len(looks)
        found.append(PlannedStep(label, size or _counted(runs), time, most, share, once))
    return found


def _names(program: Program) -> dict[int, str]:
    """Return the names of the effects by their places; the second of one name is "name2"."""
    found: dict[int, str] = {}
    for part in program.parts:
        found[part.place] = free_name(part.name, found.values())
    return found


def _strengths(program: Program, frames: Sequence[int]) -> Iterator[tuple[str, int, Any]]:
    names = _names(program)
    for part in program.parts:
        before = None
        for frame in frames if hasattr(part.effect, "strength") else ():
            strength = part.effect.strength(_time(program, frame))
            if math.isfinite(strength.visibility) and strength != before:
                yield names[part.place], frame, strength
            before = strength


def _time(program: Program, number: int) -> float:
    lap = program.base.lap
    return float(number) if lap is None else lap.place(float(number))


def _look(program: Program, number: int) -> _Look:
    t = _time(program, number)
    plate, camera = program.backdrop.frame(t), program.camera(None, t)
    window = program.open_part(program.base.window, program.front(t))
    left_out: list[LeftOut] = []
    if window is None and program.parts:
        left_out.append(LeftOut("all effects", "they are behind what stands in front"))
    asks = (window and program.asks(t, camera, window, shown_type(plate), read=False)) or []
    shown = {ask.part.place for ask in asks}
    for part in program.parts:
        if window is not None and part.place not in shown:
            needs = part.needs or needs_of(part.effect, program.frame(t, camera, window))
            faint = LeftOut(part.name, f"it changes a value by {needs.most:.2g} at most: no step")
            left_out += [faint] if needs.steps else needs.left_out
    reads = frozenset[str]().union(*(ask.needs.reads for ask in asks))
    if program.distance is not None and "depth" not in reads:
        left_out.append(LeftOut("depth", "nothing reads it"))
    given = {"background": True, "depth": program.distance is not None and "depth" in reads}
    given |= {"ambient": "ambient" in reads, "plate light": "plate" in reads}
    steps: dict[_Key, bool] = {(-1, name): False for name, made in given.items() if made}
    for ask in asks:
        # Asked again: what was said for the whole film knows neither this time nor this window.
        needs = needs_of(ask.part.effect, ask.frame)
        left_out += needs.left_out
        for step in needs.steps:
            steps[ask.part.place, step.name] = step.once and ask.frame.settled
    steps[_COMPOSITE] = False
    height, width = program.base.shape
    layers = f"{len(asks)} layer{'s' * (len(asks) != 1)}"
    sizes = {(-1, "background"): f"{width} x {height} px, {plate.dtype}", _COMPOSITE: layers}
    return _Look(number, steps, sizes, left_out)


def _left_out(looks: Sequence[_Look]) -> list[LeftOut]:
    """Return what frames go without, with the share of the frames where it is not all."""
    whys: dict[str, list[str]] = {}
    for look in looks:
        for one in dict.fromkeys(look.left_out):
            whys.setdefault(one.what, []).append(one.why)
    found = []
    for what, said in whys.items():
        share = len(said) / len(looks)
        rare = f", in {100.0 * share:.0f} % of frames" if share < 1.0 else ""
        found.append(LeftOut(what, said[-1] + rare))
    return found


def _probed(looks: Sequence[_Look], middle: int, keyed: set[int]) -> tuple[int, ...]:
    """Return the first frame, the middle and the last, those with steps of their own, and keys."""
    ends = looks[0].t, middle, looks[-1].t
    chosen = {look.t: look for look in looks if look.t in ends}
    while len(chosen) < PROBED:
        known = {key for look in chosen.values() for key in look.steps}
        rest = [look for look in looks if look.t not in chosen]
        new = max(
            rest, key=lambda look: (len(look.steps.keys() - known), look.t in keyed), default=None
        )
        if new is None or not (new.steps.keys() - known or new.t in keyed):
            break
        chosen[new.t] = new
    return tuple(sorted(chosen))


def _traces(program: Program, probed: Sequence[int]) -> tuple[list[Trace], list[Trace]]:
    """Return traces of the frames: first with their memory, then with times alone."""
    # Of a program of its own, which has kept nothing yet and leaves the scene's alone.
    own = replace(program, found={})

    def traced(number: int, *, memory: bool) -> Trace:
        if memory:
            # Memory that is there already would not be seen.
            planes.forget()
        with tracing(memory=memory) as trace:
            images(own, _time(own, number), [None], own.base.window)
        return trace

    cold = [traced(number, memory=True) for number in probed]
    return cold, [traced(number, memory=False) for number in probed]


def _counted(runs: Sequence[Span]) -> str:
    """Return what the runs of a step have counted, at most: "361 tiles"."""
    most = reduce(or_, (Counter(span.counts) for span in runs), Counter[str]())
    return ", ".join(f"{number} {name}" for name, number in most.items())
