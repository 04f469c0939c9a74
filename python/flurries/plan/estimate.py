"""From a scene's program to a plan: its steps over the frames of a film, their times and bytes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries._threads import threads
from flurries.costs import nanoseconds
from flurries.effects.needs import Cost, LeftOut, Needs, needs_of
from flurries.plan.calibration import scales
from flurries.plan.report import Plan, PlannedStep
from flurries.timeline import Keys

if TYPE_CHECKING:
    from flurries.effects.layer import Frame
    from flurries.effects.visible import Window
    from flurries.plan.program import Asked
    from flurries.scene import Scene

# Frames that stand for a film, spread over it, beside those where something is keyed.
LOOKED_AT = 9
MOST_KEYED = 32

_PIXEL_KIND = {1: "byte pixel", 2: "word pixel", 4: "float pixel"}


@dataclass
class _Row:
    """A step over the frames that were looked at."""

    size: str = ""
    once: bool = False
    times: list[float] = field(default_factory=list)
    bytes: int = 0


def plan_of(scene: Scene, frames: str | int | Iterable[int] | None = None) -> Plan:
    """Return the plan of a scene's frames; see :meth:`flurries.Scene.plan`."""
    from flurries.render import frames_of

    wanted = frames_of(scene, frames)
    looked = _looked_at(scene, wanted)
    factors = scales()
    rows: dict[str, _Row] = {}
    gone: dict[str, list[LeftOut]] = {}
    totals, peak = [], 0
    for t in looked:
        costs, left_out, most = _frame(scene, float(t))
        peak = max(peak, most)
        total = 0.0
        for name, (cost, once) in costs.items():
            row = rows.setdefault(name, _Row(cost.size, once))
            time = 1e-6 * nanoseconds(cost.work, factors)
            row.times.append(time)
            row.bytes = max(row.bytes, cost.kept + cost.scratch)
            total += 0.0 if once else time
        totals.append(total)
        for one in left_out:
            gone.setdefault(one.what, []).append(one)
    steps = tuple(
        PlannedStep(
            name,
            row.size,
            float(np.mean(row.times)) if row.once else sum(row.times) / len(looked),
            row.bytes,
            len(row.times) / len(looked),
            row.once,
        )
        for name, row in rows.items()
    )
    parts = tuple(
        same[-1]
        if len(same) >= len(looked)
        else LeftOut(what, f"{same[-1].why}, in {100.0 * len(same) / len(looked):.0f} % of frames")
        for what, same in gone.items()
    )
    assert scene.size is not None
    return Plan(
        size=scene.size,
        frames=(wanted[0], wanted[-1], len(wanted)),
        steps=steps,
        left_out=(*scene.program.left_out, *parts),
        milliseconds=float(np.mean(totals)),
        bytes=peak,
        threads=threads(),
    )


def _looked_at(scene: Scene, wanted: list[int]) -> list[int]:
    """Return the frames that stand for a film: evenly spread, and around every key."""
    spread = {wanted[i] for i in np.linspace(0, len(wanted) - 1, LOOKED_AT).astype(int)}
    keyed = {
        round(frame)
        for effect in scene.effects
        for value in getattr(effect, "__dict__", {}).values()
        if isinstance(value, Keys)
        for frame, _ in value.keys
    }
    near = sorted(set(wanted) & keyed)[:MOST_KEYED]
    return sorted(spread | set(near))


def _frame(scene: Scene, t: float) -> tuple[dict[str, tuple[Cost, bool]], list[LeftOut], int]:
    """Return the costs of a frame's steps by name, what is left out, and the most bytes held."""
    program = scene.program
    dtype = scene._backdrop.frame(t).dtype
    height, width = scene.shape
    window = program.seen((0, height, 0, width))
    asked: list[Asked] = []
    left_out: list[LeftOut] = []
    if window is None and program.parts:
        left_out.append(LeftOut("all effects", "they are behind what stands in front"))
    elif window is not None:
        asked = list(program.frames(t, None, window, dtype=dtype))
        shown = {id(effect) for effect, _, _ in asked}
        for part in program.parts:
            if id(part.effect) not in shown:
                left_out += _silent(program, part, t, window)
    costs: dict[str, tuple[Cost, bool]] = {"frame": (Cost({"frame": 1.0}), False)}
    pixels = float(height * width)
    decoded = {"decoded pixel": pixels} if scene.frames is not None else {}
    size = f"{width} x {height} px, {dtype.name}"
    costs["background"] = (Cost(decoded, size), False)
    reads = frozenset[str]().union(*(needs.reads for _, _, needs in asked))
    if program.deep and "depth" not in reads:
        left_out.append(LeftOut("depth", "nothing reads it"))
    elif program.deep and not program.settled:
        costs["depth"] = (Cost({"decoded pixel": pixels}), False)
    if "ambient" in reads:
        costs["ambient"] = (Cost({"encoded pixel": 1.5 * pixels}), False)
    held, peak, names = 0, 0, _names(asked)
    for name, (effect, frame, _) in zip(names, asked, strict=True):
        # Asked again: what was said for the whole film knows neither this time nor this window.
        held, most = _effect(name, frame, needs_of(effect, frame), held, costs, left_out)
        peak = max(peak, most)
    cost, most = _composite(scene, dtype, asked, window)
    costs["composite"] = (cost, False)
    return costs, left_out, max(peak, held + most)


def _silent(program: Any, part: Any, t: float, window: tuple[int, int, int, int]) -> list[LeftOut]:
    """Return why an effect that may run does not run now."""
    needs = part.needs
    if needs is None:
        needs = needs_of(part.effect, program._frame(t, None, window, seed=part.seed))
    if not needs.steps:
        return list(needs.left_out)
    return [LeftOut(_name(part.effect), f"it changes a value by {needs.most:.2g} at most: no step")]


def _name(effect: Any) -> str:
    return getattr(effect, "NAME", "") or type(effect).__name__.lower()


def _names(asked: list[Asked]) -> list[str]:
    from flurries.mixing import free_name

    names: list[str] = []
    for effect, _, _ in asked:
        names.append(free_name(_name(effect), names))
    return names


def _effect(
    name: str,
    frame: Frame,
    needs: Needs,
    held: int,
    costs: dict[str, tuple[Cost, bool]],
    left_out: list[LeftOut],
) -> tuple[int, int]:
    """Add an effect's steps; return the bytes held after it, and the most while it ran."""
    most, now, last = held, held, 0
    for step in needs.steps:
        cost = step.cost()
        label = name if step.name == name else f"{name}: {step.name}"
        costs[label] = (cost, step.once and frame.settled)
        left_out += [LeftOut(f"{name}: {one.what}", one.why) for one in cost.left_out]
        most = max(most, now + cost.kept + cost.scratch)
        now += cost.kept
        last = cost.kept
    left_out += needs.left_out
    # Planes of single steps go; what the last one made is the layer.
    return held + last, most


def _composite(
    scene: Scene, dtype: np.dtype[Any], asked: list[Asked], window: Window | None
) -> tuple[Cost, int]:
    """Return what mixing the layers costs, and the most bytes it holds with the frame."""
    same = scene.linear == (scene._backdrop.encoding == "linear")
    item = dtype.itemsize if same else 4
    layers = len(asked)
    pixels = scene.shape[0] * scene.shape[1]
    inner = 0 if window is None else (window[1] - window[0]) * (window[3] - window[2])
    whole, part = 3 * item * pixels, 3 * item * inner
    work: dict[str, float] = {_PIXEL_KIND[item]: float(layers * inner), "layer": float(layers)}
    if layers == 0 or inner < pixels:
        work["copied byte"] = float(whole + 2 * part if layers else whole)
    # The one that is made, and the one behind it.
    most = min(layers, 2) * part
    if scene._foreground is not None and layers:
        work["array pixel"] = 2.0 * layers * inner
        most += 8 * inner
    if not same:
        # There and back through the curve; arrays of float32 come and go.
        work["encoded pixel"] = 2.0 * pixels
        most = max(most + whole, (60 if dtype.kind == "u" else 51) * pixels)
    size = f"{layers} layer{'s' * (layers != 1)}"
    most = max(most, whole + (part if inner < pixels else 0))
    return Cost(work, size, whole, most - whole), most
