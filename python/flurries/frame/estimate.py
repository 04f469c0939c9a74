"""What a scene's frames take: the costs of their steps by the fixed model, added up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flurries._threads import threads
from flurries.frame.bands import area, common, whole
from flurries.frame.calibration import scales
from flurries.frame.costs import nanoseconds
from flurries.frame.mixing import CHUNK, free_name
from flurries.frame.needs import Cost, LeftOut, needs_of
from flurries.frame.picture import bands_in
from flurries.frame.program import Ask, Program
from flurries.frame.report import Plan, PlannedStep
from flurries.frame.tolerance import Choice
from flurries.motion.keys import Keys

# Frames that stand for a film, spread over it, beside those where something is keyed.
LOOKED_AT = 9
MOST_KEYED = 32

_PIXEL_KIND = {1: "byte pixel", 2: "word pixel", 4: "float pixel"}

# Bytes that a value takes on the way to another encoding, in arrays of float32 that come and go.
_TURNED = 20

# Bytes of the tables and objects that a frame is described by.
_TABLES = 20 << 10


def seconds(program: Program, numbers: Sequence[int], tolerance: float = 0.0) -> float:
    """Return what a frame takes by the fixed model, on one thread: the same on all machines."""
    sample = _sample(program, numbers)
    rows = [row for t in sample for row in _Frame(program, t, program.choice(t, tolerance)).rows]
    return 1e-9 * sum(nanoseconds(c.work) for _, c, once in rows if not once) / len(sample)


def plan_of(program: Program, numbers: Sequence[int], tolerance: float = 0.0) -> Plan:
    """Return the plan of a scene's frames; see :meth:`flurries.Scene.plan`."""
    sample, factors = _sample(program, numbers), scales()
    count = len(sample)
    choices = [program.choice(t, tolerance) for t in sample]
    frames = [_Frame(program, t, choice) for t, choice in zip(sample, choices, strict=True)]
    runs: dict[str, list[tuple[Cost, bool]]] = {}
    gone: dict[str, list[str]] = {}
    for frame in frames:
        for name, cost, once in frame.rows:
            runs.setdefault(name, []).append((cost, once))
        for one in frame.left_out:
            gone.setdefault(one.what, []).append(one.why)
    # Effects that come in later stand before it all the same.
    runs["composite"] = runs.pop("composite")
    steps = []
    for name, costs in runs.items():
        cost, once = costs[0]
        ms = 1e-6 * sum(nanoseconds(cost.work, factors) for cost, _ in costs)
        most = max(cost.kept + cost.scratch for cost, _ in costs)
        mean = ms / (len(costs) if once else count)
        steps.append(PlannedStep(name, cost.size, mean, most, len(costs) / count, once))
    left_out = list(program.left_out)
    for what, whys in gone.items():
        rare = f", in {100.0 * len(whys) / count:.0f} % of frames" if len(whys) < count else ""
        left_out.append(LeftOut(what, whys[-1] + rare))
    return Plan(
        size=program.shape[::-1],
        frames=(numbers[0], numbers[-1], len(numbers)),
        steps=tuple(steps),
        left_out=tuple(left_out),
        milliseconds=sum(step.milliseconds for step in steps if not step.once),
        bytes=max(frame.bytes for frame in frames),
        threads=threads(),
        tolerance=tolerance,
        error=max(choice.error for choice in choices),
        spent=tuple({one.what: one for choice in choices for one in choice.spent}.values()),
    )


def _sample(program: Program, numbers: Sequence[int]) -> list[float]:
    """Return the frames that stand for a film: evenly spread, and around every key."""
    spread = {numbers[i] for i in np.linspace(0, len(numbers) - 1, LOOKED_AT).astype(int)}
    keyed = {
        round(frame)
        for effect in program.effects
        for value in getattr(effect, "__dict__", {}).values()
        if isinstance(value, Keys)
        for frame, _ in value.keys
    }
    near = sorted(set(numbers) & keyed)[:MOST_KEYED]
    return [float(number) for number in sorted(spread | set(near))]


class _Frame:
    """The steps of one frame as rows of (name, Cost, once), what is left out, and its bytes."""

    def __init__(self, program: Program, t: float, choice: Choice) -> None:
        self.program, self.choice = program, choice
        self.left_out: list[LeftOut] = []
        height, width = program.shape
        pixels = float(height * width)
        self.dtype = program.backdrop.frame(t).dtype
        self.front = program.front(t)
        self.window = program.open_part(whole(program.shape), self.front, choice.hidden)
        asks = self._asks(t)
        reads = frozenset[str]().union(*(ask.needs.reads for ask in asks))
        film = {} if program.backdrop.count is None else {"decoded pixel": pixels}
        size = f"{width} x {height} px, {self.dtype.name}"
        self.rows = [
            ("frame", Cost({"frame": 1.0}), False),
            ("background", Cost(film, size), False),
        ]
        if program.distance is not None and "depth" not in reads:
            self.left_out.append(LeftOut("depth", "nothing reads it"))
        elif program.distance is not None and not program.settled:
            self.rows.append(("depth", Cost({"decoded pixel": pixels}), False))
        if "ambient" in reads:
            self.rows.append(("ambient", Cost({"encoded pixel": 1.5 * pixels}), False))
        bands = bands_in(whole(program.shape), asks, program.mix(), self.front)
        # The one that has most of the weather.
        self.band = max(bands, key=lambda band: area(common(band, self.window or band)))
        self.banded = len(bands) > 1
        names: list[str] = []
        made = []
        for ask in asks:
            names.append(free_name(ask.part.name, names))
            made.append(self._effect(names[-1], ask))
        fused = 0 if self.banded or self.front else sum(a.needs.in_one_pass for a in asks)
        self.rows.append(("composite", self._composite(len(asks), fused), False))
        self.bytes = self._peak(made)

    def _asks(self, t: float) -> list[Ask]:
        """Return the effects that run, and note why others do not."""
        program, choice = self.program, self.choice
        if self.window is None:
            if program.parts:
                why = "they are behind what stands in front"
                self.left_out.append(LeftOut("all effects", why))
            return []
        camera = program.camera(None, t)
        asks = program.asks(t, camera, self.window, self.dtype, choice, read=False)
        shown = {ask.part.place for ask in asks}
        for part in program.parts:
            if part.place in shown:
                continue
            needs = part.needs or needs_of(part.effect, program.frame(t, camera, self.window))
            if choice.without.get(part.place):
                self.left_out.append(LeftOut(part.name, "within the tolerance"))
            elif needs.steps:
                why = f"it changes a value by {needs.most:.2g} at most: no step"
                self.left_out.append(LeftOut(part.name, why))
            else:
                self.left_out += needs.left_out
        return asks

    def _effect(self, name: str, ask: Ask) -> tuple[int, int]:
        """Add an effect's steps; return the bytes that it leaves, and the most while it ran."""
        frame, run = ask.frame, ask.frame.run
        assert run is not None
        # Asked again: what was said for the whole film knows neither this time nor this window.
        needs = needs_of(ask.part.effect, frame)
        gone = frozenset(step.name for step in needs.steps) - set(run.steps)
        self.left_out += [LeftOut(f"{name}: {s}", "within the tolerance") for s in sorted(gone)]
        one_pass = ask.needs.in_one_pass and not self.banded and self.front is None
        part = common(self.band, frame.window) if self.banded and ask.needs.by_rows else None
        own = needs if part is None else needs_of(ask.part.effect, replace(frame, window=part))
        sizes = {step.name: step for step in own.steps}
        most = now = last = 0
        for step in needs.without(gone).steps:
            if one_pass and step.name == "join":
                continue
            cost = step.cost()
            if part is not None:
                of_band = sizes[step.name].cost()
                cost = replace(cost, kept=of_band.kept, scratch=of_band.scratch)
            if one_pass:
                # No plane is kept. What lists of flakes take is told beyond their plane.
                plane = cost.kept if step.name == "flakes" and cost.scratch else 0
                cost = replace(cost, kept=0, scratch=cost.scratch + plane)
            once = step.once and frame.settled
            self.rows.append((name if step.name == name else f"{name}: {step.name}", cost, once))
            self.left_out += [LeftOut(f"{name}: {one.what}", one.why) for one in cost.left_out]
            if not once:
                most = max(most, now + cost.kept + cost.scratch)
                now, last = now + cost.kept, cost.kept
        self.left_out += needs.left_out
        # Planes of single steps go; the last one is the layer.
        return last, most

    def _composite(self, layers: int, fused: int) -> Cost:
        """Return what mixing the layers costs."""
        program, inner = self.program, area(self.window)
        same, pixels = program.mix().same, area(whole(program.shape))
        item = self.dtype.itemsize if same else 4
        work: dict[str, float] = {"layer": layers, "fused pixel": fused * inner}
        work[_PIXEL_KIND[item]] = layers * inner
        if layers == 0 or inner < pixels:
            work["copied byte"] = 3.0 * item * (pixels + (2 * inner if layers else 0))
        if self.front is not None and layers:
            work["array pixel"] = 2.0 * layers * inner
        if self.choice.table:
            work.update({"looked up value": 3.0 * pixels, "decoded value": 3.0 * pixels})
        elif not same:
            work["encoded pixel"] = 2.0 * pixels
        return Cost(work, f"{layers} layer{'s' * (layers != 1)}", 3 * item * pixels)

    def _peak(self, made: list[tuple[int, int]]) -> int:
        """Return the most bytes that are held at one time, of effects' layers and planes.

        Of a frame that is made in bands it is those of a band, and the frame itself.
        """
        program, band = self.program, self.band
        part = None if self.window is None else common(band, self.window)
        same, matte = program.mix().same, self.front is not None
        item = self.dtype.itemsize if same else 4
        picture, inside = 3 * item * area(band), 3 * item * area(part)
        result = 3 * self.dtype.itemsize * area(whole(program.shape))
        turning = 0 if same else _TURNED * min(CHUNK, 3 * area(band))
        # A matte makes two planes: of what it leaves, which goes, and of the layer behind it.
        plane = 4 * area(part) if matte else 0
        # What lies behind the next effect, beyond the scene's own picture: whole rows are no copy.
        base = 0 if same else picture
        behind = inside if part is not None and part[3] - part[2] < program.shape[1] else 0
        peak = base + turning
        for number, (layer, most) in enumerate(made, 1):
            # The last layer of a band lies over the rest in the frame itself.
            straight = number == len(made) and self.banded and same and not matte
            over = 0 if straight else inside
            peak = max(peak, base + behind + max(most, layer + max(2 * plane, plane + over)))
            behind, base = over, base if matte else 0
        cut = 0 < inside < picture and same
        end = base + behind + (picture if cut else 0)
        if not self.banded:
            end = max(end, picture) if same else end + result
        return (result if self.banded else 0) + max(peak, end + turning) + _TABLES
