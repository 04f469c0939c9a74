"""From a scene's program to a plan: its steps over the frames of a film, their times and bytes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries._contract import real
from flurries._threads import threads
from flurries.frame.bands import Ask, bands_in, common, shape_of
from flurries.frame.calibration import scales
from flurries.frame.costs import nanoseconds
from flurries.frame.mixing import CHUNK, Mix
from flurries.frame.needs import Cost, LeftOut, Needs, Spent, Step, needs_of
from flurries.frame.report import Plan, PlannedStep
from flurries.motion.keys import Keys

if TYPE_CHECKING:
    from flurries.frame.layer import Frame
    from flurries.frame.program import Asked
    from flurries.frame.tolerance import Choice
    from flurries.frame.visible import Window
    from flurries.scene.scene import Scene

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


def plan_of(
    scene: Scene, frames: str | int | Iterable[int] | None = None, tolerance: float = 0.0
) -> Plan:
    """Return the plan of a scene's frames; see :meth:`flurries.Scene.plan`."""
    from flurries.scene.numbers import frames_of
    from flurries.scene.scene import expect_scene

    expect_scene(scene)
    tolerance = real("tolerance", tolerance, low=0.0)
    wanted = frames_of(scene, frames)
    looked = _looked_at(scene, wanted)
    factors = scales()
    rows: dict[str, _Row] = {}
    gone: dict[str, list[LeftOut]] = {}
    totals, peak = [], 0
    spent: dict[str, Spent] = {}
    error = 0.0
    for t in looked:
        dtype = scene._backdrop.frame(float(t)).dtype
        choice = scene.program.choice(float(t), dtype, tolerance)
        for one_spent in choice.spent:
            spent[one_spent.what] = one_spent
        error = max(error, choice.error)
        costs, left_out, most = _frame(scene, float(t), choice)
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
    # Effects that come in later stand before it all the same.
    rows["composite"] = rows.pop("composite")
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
        tolerance=tolerance,
        error=error,
        spent=tuple(spent.values()),
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


def _frame(
    scene: Scene, t: float, choice: Choice
) -> tuple[dict[str, tuple[Cost, bool]], list[LeftOut], int]:
    """Return the costs of a frame's steps by name, what is left out, and the most bytes held."""
    program = scene.program
    dtype = scene._backdrop.frame(t).dtype
    height, width = scene.shape
    window = program.seen((0, height, 0, width), choice.hidden)
    asked: list[Asked] = []
    left_out: list[LeftOut] = []
    if window is None and program.parts:
        left_out.append(LeftOut("all effects", "they are behind what stands in front"))
    elif window is not None:
        asked = list(program.frames(t, None, window, dtype=dtype, choice=choice))
        shown = {id(effect) for effect, _, _ in asked}
        for part in program.parts:
            if part.index in choice.without and id(part.effect) not in shown:
                left_out.append(LeftOut(part.name, "within the tolerance"))
            elif id(part.effect) not in shown:
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
    names, fused = _names(asked), 0
    bands = _bands(scene, asked, window)
    # The one that has most of the weather.
    band = max(bands, key=lambda band: _area(common(band, window or band)))
    held = _Held(scene, dtype, window, band, banded=len(bands) > 1)
    for number, (name, (effect, frame, _)) in enumerate(zip(names, asked, strict=True)):
        # Asked again: what was said for the whole film knows neither this time nor this window.
        needs = needs_of(effect, frame)
        assert frame.run is not None
        gone = frozenset(step.name for step in needs.steps) - set(frame.run.steps)
        if gone:
            needs = needs.without(gone)
            left_out += [
                LeftOut(f"{name}: {step}", "within the tolerance") for step in sorted(gone)
            ]
        if scene._foreground is None and needs.in_one_pass and len(bands) == 1:
            needs = _in_one_pass(needs)
            fused += 1
        elif len(bands) > 1 and needs.by_rows:
            needs = _of_band(needs, effect, frame, band)
        last = number + 1 == len(asked)
        held.add(*_effect(name, frame, needs, costs, left_out), last=last)
    cost = _composite(scene, dtype, asked, window, fused)
    if choice.table:
        work = {**cost.work, "encoded pixel": 0.0, "array pixel": cost.work.get("array pixel", 0.0)}
        work["looked up value"] = 3.0 * pixels
        work["decoded value"] = 3.0 * pixels
        cost = replace(cost, work=work)
    costs["composite"] = (cost, False)
    return costs, left_out, held.most()


# Bytes that a value takes on the way to another encoding, in arrays of float32 that come and go.
_TURNED = 20

# Bytes of the tables and objects that a frame is described by.
_TABLES = 20 << 10


class _Held:
    """The bytes that are held while effects are made and laid over a picture, one after another.

    Of a frame that is made in bands it is those of a band, and the frame itself.
    """

    def __init__(
        self,
        scene: Scene,
        dtype: np.dtype[Any],
        window: Window | None,
        band: Window,
        *,
        banded: bool,
    ) -> None:
        self._same = scene.linear == (scene._backdrop.encoding == "linear")
        self._banded = banded
        part = None if window is None else common(band, window)
        item = dtype.itemsize if self._same else 4
        pixels, self._inner = _area(band), _area(part)
        self._whole, self._part = 3 * item * pixels, 3 * item * self._inner
        self._cut = 0 < self._inner < pixels
        self._matte = scene._foreground is not None
        # What lies behind the next effect, beyond the scene's own picture.
        self._base = 0 if self._same else self._whole
        # Whole rows of it need no copy.
        aside = part is not None and part[3] - part[2] < scene.shape[1]
        self._behind = self._part if aside else 0
        result = 3 * dtype.itemsize * scene.shape[0] * scene.shape[1]
        self._frame = result if self._banded else 0
        self._turning = 0 if self._same else _TURNED * min(CHUNK, 3 * pixels)
        # In its own encoding: the working picture is it, or becomes it.
        self._made = 0 if self._same or self._banded else result
        self._peak = self._base + self._turning

    def add(self, layer: int, most: int, *, last: bool) -> None:
        """Add an effect that takes `most` bytes while it is made, and leaves `layer`."""
        back = self._base + self._behind
        # A matte makes two planes: of what it leaves, which goes, and of the layer behind it.
        plane = 4 * self._inner if self._matte else 0
        # The last layer of a band lies over the rest in the frame itself.
        straight = last and self._banded and self._same and not self._matte
        over = 0 if straight else self._part
        mixed = max(2 * plane, plane + over)
        self._peak = max(self._peak, back + most, back + layer + mixed)
        self._behind = over
        if not self._matte:
            self._base = 0

    def most(self) -> int:
        """Return the most bytes, with those of mixing."""
        end = self._base + self._behind + (self._whole if self._cut and self._same else 0)
        if self._same and not self._banded:
            end = max(end, self._whole)
        return self._frame + max(self._peak, end + self._made + self._turning) + _TABLES


def _area(window: Window | None) -> int:
    if window is None:
        return 0
    height, width = shape_of(window)
    return height * width


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
    from flurries.frame.mixing import free_name

    names: list[str] = []
    for effect, _, _ in asked:
        names.append(free_name(_name(effect), names))
    return names


def _effect(
    name: str,
    frame: Frame,
    needs: Needs,
    costs: dict[str, tuple[Cost, bool]],
    left_out: list[LeftOut],
) -> tuple[int, int]:
    """Add an effect's steps; return the bytes that it leaves, and the most while it ran."""
    most, now, last = 0, 0, 0
    for step in needs.steps:
        cost = step.cost()
        label = name if step.name == name else f"{name}: {step.name}"
        costs[label] = (cost, step.once and frame.settled)
        left_out += [LeftOut(f"{name}: {one.what}", one.why) for one in cost.left_out]
        if step.once and frame.settled:
            # The scene holds it from the first frame on.
            continue
        most = max(most, now + cost.kept + cost.scratch)
        now += cost.kept
        last = cost.kept
    left_out += needs.left_out
    # Planes of single steps go; what the last one made is the layer.
    return last, most


def _in_one_pass(needs: Needs) -> Needs:
    """Return the needs without planes of the texture, of the flakes and of the layer."""

    def thin(step: Step) -> Step:
        cost = step.cost()
        # What lists of flakes take is told beyond a plane that comes after them: here none comes.
        more = cost.kept if step.name == "flakes" and cost.scratch else 0
        scratch = cost.scratch + more
        return replace(step, cost=lambda: replace(cost, kept=0, scratch=scratch))

    return replace(needs, steps=tuple(thin(s) for s in needs.steps if s.name != "join"))


def _bands(scene: Scene, asked: list[Asked], window: Window | None) -> list[Window]:
    """Return the bands that a frame is made in."""
    assert scene.size is not None
    height, width = scene.shape
    mix = Mix(scene.linear, scene._backdrop.encoding)
    asks = [Ask(effect, frame, needs.by_rows, needs.in_one_pass) for effect, frame, needs in asked]
    return bands_in((0, height, 0, width), asks, mix, scene._foreground)


def _of_band(needs: Needs, effect: Any, frame: Frame, band: Window) -> Needs:
    """Return the needs with the bytes of a band in place of those of the whole."""
    part = common(band, frame.window)
    if part is None:
        return needs
    lower = {step.name: step for step in needs_of(effect, replace(frame, window=part)).steps}

    def thin(step: Step) -> Step:
        whole, own = step.cost(), lower[step.name].cost()
        return replace(step, cost=lambda: replace(whole, kept=own.kept, scratch=own.scratch))

    return replace(needs, steps=tuple(thin(step) for step in needs.steps))


def _composite(
    scene: Scene, dtype: np.dtype[Any], asked: list[Asked], window: Window | None, fused: int
) -> Cost:
    """Return what mixing the layers costs."""
    same = scene.linear == (scene._backdrop.encoding == "linear")
    item = dtype.itemsize if same else 4
    layers = len(asked)
    pixels = scene.shape[0] * scene.shape[1]
    inner = 0 if window is None else (window[1] - window[0]) * (window[3] - window[2])
    whole, part = 3 * item * pixels, 3 * item * inner
    work: dict[str, float] = {_PIXEL_KIND[item]: float(layers * inner), "layer": float(layers)}
    work["fused pixel"] = float(fused * inner)
    if layers == 0 or inner < pixels:
        work["copied byte"] = float(whole + 2 * part if layers else whole)
    if scene._foreground is not None and layers:
        work["array pixel"] = 2.0 * layers * inner
    if not same:
        work["encoded pixel"] = 2.0 * pixels
    return Cost(work, f"{layers} layer{'s' * (layers != 1)}", whole)
