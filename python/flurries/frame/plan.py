"""The plan of a scene: the steps that its effects name, and a trace of a few of its frames."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flurries._threads import threads
from flurries._trace import Span, Trace, tracing
from flurries.frame import planes
from flurries.frame.mixing import free_name
from flurries.frame.needs import LeftOut, needs_of
from flurries.frame.picture import images, shown_type
from flurries.frame.program import Ask, Program
from flurries.frame.report import Plan, PlannedStep
from flurries.motion.keys import Keys

# Frames of a film whose steps are asked for, spread over it, beside those where something is keyed.
LOOKED_AT = 9
MOST_KEYED = 32

# Frames that are rendered.
PROBED = 5

# An effect, -1 for the scene's own, and a step: as in a trace.
_Key = tuple[int, str]
_COMPOSITE: _Key = (-1, "composite")


@dataclass(frozen=True)
class _Look:
    """The steps of a frame, each with whether all frames share it, and what it goes without."""

    t: int
    steps: dict[_Key, bool]
    sizes: dict[_Key, str]
    left_out: list[LeftOut]


def plan_of(program: Program, numbers: Sequence[int], *, probe: bool = True) -> Plan:
    """Return the plan of a scene's frames; see :meth:`flurries.Scene.plan`."""
    keyed = _keyed(program).intersection(numbers)
    looks = _looks(program, numbers, keyed)
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
        size=program.base.shape[::-1],
        frames=(numbers[0], numbers[-1], len(numbers)),
        steps=tuple(steps),
        strengths=tuple(_strengths(program, (numbers[0], middle, numbers[-1]))),
        left_out=(*program.left_out, *_left_out(looks)),
        probed=probed,
        milliseconds=total,
        first=first,
        rest=rest,
        bytes=max((trace.bytes for trace in cold), default=None),
        threads=threads(),
    )


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


def _keyed(program: Program) -> set[int]:
    holders = [*program.effects, *program.base.lights, program.base.lens]
    values = [value for one in holders for value in getattr(one, "__dict__", {}).values()]
    return {round(frame) for keys in values if isinstance(keys, Keys) for frame, _ in keys.keys}


def _looks(program: Program, numbers: Sequence[int], keyed: set[int]) -> list[_Look]:
    spread = np.linspace(0, len(numbers) - 1, LOOKED_AT).astype(int)
    near = sorted(keyed)[:MOST_KEYED]
    return [_look(program, t) for t in sorted({*near, *(numbers[i] for i in spread)})]


def _time(program: Program, number: int) -> float:
    lap = program.base.lap
    return float(number) if lap is None else lap.place(float(number))


def _look(program: Program, number: int) -> _Look:
    t, front = _time(program, number), program.front(_time(program, number))
    plate = program.backdrop.frame(t)
    window = program.open_part(program.base.window, front)
    camera, left_out, asks = program.camera(None, t), list[LeftOut](), list[Ask]()
    if window is not None:
        asks = program.asks(t, camera, window, shown_type(plate), read=False)
    elif program.parts:
        left_out.append(LeftOut("all effects", "they are behind what stands in front"))
    shown = {ask.part.place for ask in asks}
    for part in program.parts if window is not None else ():
        if part.place not in shown:
            needs = part.needs or needs_of(part.effect, program.frame(t, camera, window))
            faint = LeftOut(part.name, f"it changes a value by {needs.most:.2g} at most: no step")
            left_out += [faint] if needs.steps else needs.left_out
    reads = frozenset[str]().union(*(ask.needs.reads for ask in asks))
    steps: dict[_Key, bool] = {(-1, "background"): False}
    if program.distance is not None and "depth" in reads:
        steps[-1, "depth"] = False
    elif program.distance is not None:
        left_out.append(LeftOut("depth", "nothing reads it"))
    light = {"ambient": "ambient", "plate": "plate light"}
    steps |= {(-1, name): False for part, name in light.items() if part in reads}
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
        with tracing(memory=memory) as trace:
            images(own, _time(own, number), [None], own.base.window)
        return trace

    cold = []
    for number in probed:
        # Memory that is there already would not be seen.
        planes.forget()
        cold.append(traced(number, memory=True))
    return cold, [traced(number, memory=False) for number in probed]


def _counted(runs: Sequence[Span]) -> str:
    """Return what the runs of a step have counted, at most: "361 tiles"."""
    most: dict[str, int] = {}
    for span in runs:
        for name, number in span.counts.items():
            most[name] = max(most.get(name, 0), number)
    return ", ".join(f"{number} {name}" for name, number in most.items())
