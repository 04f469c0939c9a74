"""What a scene's frames take: the costs of their steps by the fixed model, added up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flurries._threads import threads
from flurries.frame.bands import area, common, whole
from flurries.frame.calibration import scales
from flurries.frame.costs import milliseconds
from flurries.frame.mixing import CHUNK, free_name
from flurries.frame.needs import Cost, LeftOut, needs_of
from flurries.frame.picture import bands_in
from flurries.frame.program import Ask, Program
from flurries.frame.report import Plan, PlannedStep
from flurries.motion.keys import Keys

# Frames that stand for a film, spread over it, beside those where something is keyed.
LOOKED_AT = 9
MOST_KEYED = 32

# Bytes that a value takes on the way to another encoding, in arrays of float32 that come and go.
_TURNED = 20


def seconds(program: Program, numbers: Sequence[int], tolerance: float = 0.0) -> float:
    """Return the time of a frame by the fixed model, on one thread: the same on all machines."""
    frames = _frames(program, numbers, tolerance, {})
    steps = [step for frame in frames for step in frame.steps if not step.once]
    return 1e-3 * sum(step.milliseconds for step in steps) / len(frames)


def plan_of(program: Program, numbers: Sequence[int], tolerance: float = 0.0) -> Plan:
    """Return the plan of a scene's frames; see :meth:`flurries.Scene.plan`."""
    frames = _frames(program, numbers, tolerance, scales())
    count = len(frames)
    runs: dict[str, list[PlannedStep]] = {}
    gone: dict[str, list[str]] = {}
    for frame in frames:
        for step in frame.steps:
            runs.setdefault(step.name, []).append(step)
        for one in frame.left_out:
            gone.setdefault(one.what, []).append(one.why)
    # Effects that come in later stand before it all the same.
    runs["composite"] = runs.pop("composite")
    steps = []
    for same in runs.values():
        mean = sum(step.milliseconds for step in same) / (len(same) if same[0].once else count)
        most, share = max(step.bytes for step in same), len(same) / count
        steps.append(replace(same[0], milliseconds=mean, bytes=most, share=share))
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
        error=max(frame.choice.error for frame in frames),
        spent=tuple({one.what: one for frame in frames for one in frame.choice.spent}.values()),
    )


def _frames(
    program: Program, numbers: Sequence[int], tolerance: float, factors: Mapping[str, float]
) -> list[_Frame]:
    """Return the frames that stand for a film: evenly spread, and around every key."""
    fields = [value for one in program.effects for value in getattr(one, "__dict__", {}).values()]
    keyed = {round(frame) for keys in fields if isinstance(keys, Keys) for frame, _ in keys.keys}
    near = sorted(keyed.intersection(numbers))[:MOST_KEYED]
    spread = np.linspace(0, len(numbers) - 1, LOOKED_AT).astype(int)
    sample = sorted({*near, *(numbers[i] for i in spread)})
    return [_Frame(program, float(t), tolerance, factors) for t in sample]


class _Frame:
    """The cost of one frame: its steps, those left out, and the most bytes held at a time."""

    def __init__(
        self, program: Program, t: float, tolerance: float, factors: Mapping[str, float]
    ) -> None:
        self.program, self.factors, self.mix = program, factors, program.mix()
        self.choice, self.front = program.choice(t, tolerance), program.front(t)
        self.steps: list[PlannedStep] = []
        self.left_out: list[LeftOut] = []
        self.dtype: np.dtype[Any] = program.backdrop.frame(t).dtype
        self.item = self.dtype.itemsize if self.mix.same else 4
        self.window = program.open_part(whole(program.shape), self.front, self.choice.hidden)
        asks = self._asks(t)
        bands = bands_in(whole(program.shape), asks, self.mix, self.front)
        # The one that has most of the weather.
        self.band = max(bands, key=lambda band: area(common(band, self.window or band)))
        self.banded = len(bands) > 1
        self._add_scene(frozenset[str]().union(*(ask.needs.reads for ask in asks)))
        names: list[str] = []
        held = []
        for ask in asks:
            names.append(free_name(ask.part.name, names))
            held.append(self._add_effect(names[-1], ask))
        self._add_composite(asks)
        self.bytes = self._peak(held)

    def _add(self, name: str, cost: Cost, *, once: bool = False) -> None:
        time, size = milliseconds(cost.work, self.factors), cost.kept + cost.scratch
        self.steps.append(PlannedStep(name, cost.size, time, size, once=once))

    def _asks(self, t: float) -> list[Ask]:
        """Return the effects that run, and note why others do not."""
        program, choice = self.program, self.choice
        if self.window is None:
            why = "they are behind what stands in front"
            self.left_out += [LeftOut("all effects", why)] if program.parts else []
            return []
        camera = program.camera(None, t)
        asks = program.asks(t, camera, self.window, self.dtype, choice, read=False)
        shown = {ask.part.place for ask in asks}
        for part in program.parts:
            if part.place in shown:
                continue
            needs = part.needs or needs_of(part.effect, program.frame(t, camera, self.window))
            faint = f"it changes a value by {needs.most:.2g} at most: no step"
            why = "within the tolerance" if choice.gone(part.place) else faint
            self.left_out += [LeftOut(part.name, why)] if needs.steps else needs.left_out
        return asks

    def _add_scene(self, reads: frozenset[str]) -> None:
        """Add the steps that make what effects lie over, and what they read."""
        program, (height, width) = self.program, self.program.shape
        decoded = {"decoded pixel": height * width}
        size = f"{width} x {height} px, {self.dtype.name}"
        self._add("frame", Cost({"frame": 1.0}))
        self._add("background", Cost({} if program.backdrop.count is None else decoded, size))
        if program.distance is not None and "depth" not in reads:
            self.left_out.append(LeftOut("depth", "nothing reads it"))
        elif program.distance is not None and not program.settled:
            self._add("depth", Cost(decoded))
        if "ambient" in reads:
            self._add("ambient", Cost({"decoded pixel": 2.0 * height * width}))

    def _in_one_pass(self, ask: Ask) -> bool:
        return ask.needs.in_one_pass and not self.banded and self.front is None

    def _add_effect(self, name: str, ask: Ask) -> tuple[int, int]:
        """Add an effect's steps; return the bytes that it leaves, and the most while it ran."""
        frame, gone = ask.frame, self.choice.gone(ask.part.place)
        self.left_out += [LeftOut(f"{name}: {s}", "within the tolerance") for s in sorted(gone)]
        # Asked again: what was said for the whole film knows neither this time nor this window.
        part = common(self.band, frame.window) if ask.needs.by_rows else None
        needs, of_band = (
            needs_of(ask.part.effect, replace(frame, window=window)).without(gone)
            for window in (frame.window, part or frame.window)
        )
        most = now = last = 0
        for step, small in zip(needs.steps, of_band.steps, strict=True):
            cost, kept, scratch = step.cost(), small.cost().kept, small.cost().scratch
            once = step.once and frame.settled
            if self._in_one_pass(ask):
                if step.name == "join":
                    continue
                # No plane is kept. What lists of flakes take is told beyond their plane.
                kept, scratch = 0, kept + scratch if scratch else 0
            label = name if step.name == name else f"{name}: {step.name}"
            self._add(label, replace(cost, kept=kept, scratch=scratch), once=once)
            self.left_out += [LeftOut(f"{name}: {one.what}", one.why) for one in cost.left_out]
            if not once:
                most, now, last = max(most, now + kept + scratch), now + kept, kept
        self.left_out += needs.left_out
        # Planes of single steps go; the last one is the layer.
        return last, most

    def _add_composite(self, asks: Sequence[Ask]) -> None:
        """Add the step that mixes the layers."""
        layers, pixels, inner = len(asks), area(whole(self.program.shape)), area(self.window)
        work = {
            "layer": layers,
            "fused pixel": sum(map(self._in_one_pass, asks)) * inner,
            f"{8 * self.item} bit pixel": layers * inner,
            "array pixel": 0 if self.front is None else 2 * layers * inner,
        }
        if not self.mix.linear:
            work["colored pixel"] = sum(ask.needs.colored for ask in asks) * inner
        if layers == 0 or inner < pixels:
            work["copied byte"] = 3 * self.item * (pixels + (2 * inner if layers else 0))
        if not self.mix.same:
            back = "looked up value" if self.choice.table else "encoded value"
            work |= {"decoded value": 3 * pixels, back: 3 * pixels}
        size = f"{layers} layer{'s' * (layers != 1)}"
        self._add("composite", Cost(work, size, 3 * self.item * pixels))

    def _peak(self, held: list[tuple[int, int]]) -> int:
        """Return the most bytes that are held at one time, of effects' layers and planes.

        Of a frame that is made in bands it is those of a band, and the frame itself.
        """
        part = None if self.window is None else common(self.band, self.window)
        inside, result = 3 * self.item * area(part), 3 * self.dtype.itemsize
        result *= area(whole(self.program.shape))
        # The background in the light of the mix; encoding it takes more.
        light = 0 if self.mix.same else 12 * area(self.band)
        turning = 0 if self.mix.same else _TURNED * min(CHUNK, 3 * area(self.band))
        peak, behind = light + turning, light
        for layer, most in held:
            peak, behind = max(peak, behind + max(most, layer + inside)), inside
        done = result if self.banded else 0
        end = behind + turning + (0 if self.mix.same else result - done)
        return max(done + max(peak, end), result)
