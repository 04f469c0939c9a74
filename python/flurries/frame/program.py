"""What a scene's frames are made of: which effects run, with which steps, and what they are given.

Resolved once for a scene, when its first frame is asked for. What is left out here is not imported,
seeded or allocated, and a frame costs no time for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries import _core
from flurries._contract import Array
from flurries.camera.lens import Camera
from flurries.frame.bands import most_bands
from flurries.frame.costs import nanoseconds
from flurries.frame.needs import Kept, LeftOut, Needs, Run, Saving, keyed, needs_of
from flurries.frame.tolerance import EXACT, STEEPEST, Asking, Choice, Light, choose, light_of
from flurries.frame.view import Frame
from flurries.frame.visible import Visible, Window
from flurries.scene.background import ambient_light
from flurries.trace import stage

if TYPE_CHECKING:
    from flurries.scene.scene import Scene

# Half a step of an integer picture, less what rounding in float32 can take.
HALF_STEP = 0.5 - 1e-3

# An effect, its view of the frame, and its needs.
Asked = tuple[Any, Frame, Needs]

_Entry = tuple["Part", Frame, Needs]


@dataclass(frozen=True)
class Part:
    """An effect of the scene that shows something at some time.

    Attributes
    ----------
    effect : effect
        Itself.
    index : int
        Its place in the scene.
    seed : int
        Of its random numbers.
    needs : Needs or None
        The same at all times, or None where it has to be asked.
    """

    effect: Any
    index: int
    seed: int
    needs: Needs | None

    @property
    def name(self) -> str:
        """What people call it."""
        return getattr(self.effect, "NAME", "") or type(self.effect).__name__.lower()


def _savings(part: Part, needs: Needs) -> tuple[Saving, ...]:
    """Return what an effect can save, and the effect as a whole."""

    def saved(_: float) -> float:
        layer = nanoseconds({"layer": 1.0})
        return layer + sum(nanoseconds(step.cost().work) for step in needs.steps)

    whole = Saving(part.name, part.name, needs.most, saved, all=True)
    return (*needs.savings, whole)


class Program:
    """What runs for each frame of a scene.

    Attributes
    ----------
    parts : list of Part
        The effects that show something, back to front.
    left_out : list of LeftOut
        What never runs.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.parts: list[Part] = []
        self.left_out: list[LeftOut] = []
        self._kept = Kept(most_bands(scene.shape))
        self._visible: dict[float, Visible | None] = {}
        self._light: Light | None = None
        self._choices: dict[Any, Choice] = {}
        distance = scene._distance
        self.deep = distance is not None
        self.settled = scene.camera.still and (distance is None or distance.still)
        for index, effect in enumerate(scene.effects):
            self._add(index, effect)

    def _add(self, index: int, effect: Any) -> None:
        own = getattr(effect, "seed", None)
        whole = (0, self.scene.shape[0], 0, self.scene.shape[1])
        constant = None
        if not keyed(effect):
            # The seed is not among what an effect may decide by.
            said = needs_of(effect, self._frame(0.0, None, whole, seed=0))
            if not said.steps:
                self.left_out += said.left_out
                return
            constant = None if said.varies else said
        seed = effect_seed(self.scene.seed, index) if own is None else own
        self.parts.append(Part(effect, index, seed, constant))

    def _frame(self, t: float, eye: Camera | None, window: Window, seed: int) -> Frame:
        path = self.scene.camera
        return Frame(
            shape=self.scene.shape,
            window=window,
            t=t,
            fps=self.scene.fps,
            camera=path.seen(path.camera if eye is None else eye, t),
            path=path,
            seed=seed,
            sun=self.scene.sun,
            settled=self.settled,
            deep=self.deep,
        )

    def frames(
        self,
        t: float,
        eye: Camera | None,
        window: Window,
        *,
        dtype: np.dtype[Any] | None,
        choice: Choice = EXACT,
    ) -> Iterator[Asked]:
        """Return the effects that run at `t` with what they are asked, back to front.

        A picture of integers, of type `dtype`, does not show what is less than half of a step; of
        layers, where it is None, every value counts. A `choice` leaves out more.
        """
        visible = None if dtype is None or not self.parts else self.visible(choice.hidden)
        for part, frame, all_needs in self._entries(t, eye, window, dtype):
            needs = all_needs
            if gone := choice.without.get(part.index):
                needs = needs.without(gone)
                if not needs.steps:
                    continue
            steps = {step.name: step for step in needs.steps}
            settings = choice.settings.get(part.index, {})
            key = (part.index, frame.camera, window, dtype is None, *settings.values())
            run = Run(steps, self._kept if self.settled else None, key, visible, settings)
            yield (
                part.effect,
                replace(frame, seed=part.seed, run=run, whole=dtype is None),
                needs,
            )

    def _entries(
        self, t: float, eye: Camera | None, window: Window, dtype: np.dtype[Any] | None
    ) -> list[_Entry]:
        """Return the parts that show anything at `t`, with their needs."""
        if not self.parts:
            return []
        asked = []
        base = self._frame(t, eye, window, seed=0)
        for part in self.parts:
            # The seed comes last: needs do not depend on it, and copies of frames take time.
            needs = part.needs if part.needs is not None else needs_of(part.effect, base)
            if needs.steps:
                asked.append((part, base, needs))
        if dtype is not None and dtype.kind == "u":
            faint = self._faint([needs for _, _, needs in asked], dtype)
            asked = [one for one, gone in zip(asked, faint, strict=True) if not gone]
        return asked

    def choice(self, t: float, dtype: np.dtype[Any] | None, tolerance: float) -> Choice:
        """Return what a tolerance is spent on at `t`: the same for every window and eye."""
        if tolerance <= 0.0 or dtype is None or not self.parts:
            return EXACT
        still = self.scene.frames is None
        if self._light is None or not still:
            self._light = light_of(self.scene, t)
        light = self._light
        whole = (0, self.scene.shape[0], 0, self.scene.shape[1])
        asked = self._entries(t, None, whole, dtype)
        # Nothing that counts changes: asked once.
        fixed = all(part.needs is not None for part, _, _ in asked)
        key = (tolerance, light, tuple(part.index for part, _, _ in asked)) if fixed else None
        if key is not None and (found := self._choices.get(key)) is not None:
            return found
        asking = [
            Asking(part.index, part.name, replace(needs, savings=_savings(part, needs)))
            for part, _, needs in asked
        ]
        values = 3 * self.scene.shape[0] * self.scene.shape[1]
        found = choose(asking, light, tolerance, values=values, hides=self._hides)
        if key is not None:
            self._choices = {key: found}
        return found

    def _hides(self, hidden: float) -> float:
        """Return the share of the frame that is covered by all but so much, and not wholly."""
        cover = self._cover()
        if cover is None:
            return 0.0
        return float(((cover >= np.float32(1.0 - hidden)) & (cover < 1.0)).mean())

    def given(self, t: float, asked: list[Asked]) -> list[tuple[Any, Frame]]:
        """Return the effects with what they read of the scene filled in."""
        reads = frozenset[str]().union(*(needs.reads for _, _, needs in asked))
        depth = self.scene.depth_at(t) if "depth" in reads else None
        ambient = None
        if "ambient" in reads:
            with stage("ambient"):
                # Of the whole picture, so that a region has the whole's bits.
                backdrop = self.scene._backdrop
                ambient = ambient_light(backdrop.frame(t), backdrop.encoding)
        if depth is None and ambient is None:
            return [(effect, frame) for effect, frame, _ in asked]
        return [
            (
                effect,
                replace(
                    frame,
                    depth=depth if "depth" in needs.reads else None,
                    ambient=ambient if "ambient" in needs.reads else None,
                ),
            )
            for effect, frame, needs in asked
        ]

    def seen(self, window: Window, hidden: float = 0.0) -> Window | None:
        """Return the part of a window in which the weather can be seen at all."""
        if not self.parts:
            return None
        visible = self.visible(hidden)
        return window if visible is None else visible.within(window)

    def visible(self, hidden: float = 0.0) -> Visible | None:
        """Return where the weather can be seen in the composite; None is everywhere.

        Not where all but `hidden` of it is covered.
        """
        known = self._visible
        if hidden in known:
            return known[hidden]
        cover = self._cover()
        none = cover is None or not bool((cover >= np.float32(1.0 - hidden)).any())
        found = None if none or cover is None else Visible(cover, hidden)
        # Of tolerances the last one; a new dictionary: other threads may read the old one.
        self._visible = {**({0.0: known[0.0]} if 0.0 in known else {}), hidden: found}
        return found

    def _cover(self) -> Array | None:
        """Return how much of the weather stands something in front of."""
        front = self.scene._foreground
        if front is None:
            return None
        if front.light is None:
            return front.cover
        return np.asarray(np.maximum(front.cover, front.light[..., 3]))

    def _faint(self, needs: list[Needs], dtype: np.dtype[Any]) -> list[bool]:
        """Return which effects cannot change a picture of integers."""
        limit = HALF_STEP / float(np.iinfo(dtype).max)
        if not self.scene.linear:
            # Each layer is rounded before the next.
            return [one.most * one.brightest < limit for one in needs]
        total, gone = 0.0, []
        for one in needs:
            change = STEEPEST * one.most * one.brightest
            gone.append(total + change < limit)
            total += change if gone[-1] else 0.0
        return gone


def effect_seed(seed: int, index: int) -> int:
    """Return the seed of the effect at a place of the list; the first one's is the scene's own."""
    if index == 0:
        return seed
    draw = np.empty(index + 1)
    _core.uniform(draw, seed, -1)
    return int(draw[index] * 2**53)
