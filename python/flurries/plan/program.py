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
from flurries.background import ambient_light
from flurries.camera import Camera
from flurries.effects.layer import Frame
from flurries.effects.needs import Kept, LeftOut, Needs, Run, keyed, needs_of
from flurries.effects.visible import Visible, Window
from flurries.trace import stage

if TYPE_CHECKING:
    from flurries.scene import Scene

# The steepest place of the sRGB encoding, at black: display values per linear light.
STEEPEST = 12.92

# Half a step of an integer picture, less what rounding in float32 can take.
HALF_STEP = 0.5 - 1e-3

# An effect, its view of the frame, and its needs.
Asked = tuple[Any, Frame, Needs]


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
        self._kept = Kept()
        self._visible: Visible | None = None
        self._looked = False
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
        self, t: float, eye: Camera | None, window: Window, *, dtype: np.dtype[Any] | None
    ) -> Iterator[Asked]:
        """Return the effects that run at `t` with what they are asked, back to front.

        A picture of integers, of type `dtype`, does not show what is less than half of a step; of
        layers, where it is None, every value counts.
        """
        asked = []
        if self.parts:
            base = self._frame(t, eye, window, seed=0)
            visible = None if dtype is None else self.visible
            for part in self.parts:
                frame = replace(base, seed=part.seed)
                needs = part.needs if part.needs is not None else needs_of(part.effect, frame)
                if needs.steps:
                    asked.append((part, frame, needs))
            if dtype is not None and dtype.kind == "u":
                faint = self._faint([needs for _, _, needs in asked], dtype)
                asked = [one for one, gone in zip(asked, faint, strict=True) if not gone]
            for part, frame, needs in asked:
                steps = {step.name: step for step in needs.steps}
                key = (part.index, frame.camera, window, dtype is None)
                run = Run(steps, self._kept if self.settled else None, key, visible)
                yield part.effect, replace(frame, run=run, whole=dtype is None), needs

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

    def seen(self, window: Window) -> Window | None:
        """Return the part of a window in which the weather can be seen at all."""
        if not self.parts:
            return None
        visible = self.visible
        return window if visible is None else visible.within(window)

    @property
    def visible(self) -> Visible | None:
        """Where the weather can be seen in the composite; None is everywhere."""
        if not self._looked:
            front = self.scene._foreground
            if front is not None:
                cover: Array = front.cover
                if front.light is not None:
                    cover = np.maximum(cover, front.light[..., 3])
                self._visible = Visible(cover) if bool((cover >= 1.0).any()) else None
            self._looked = True
        return self._visible

    def _faint(self, needs: list[Needs], dtype: np.dtype[Any]) -> list[bool]:
        """Return which effects cannot change a picture of integers."""
        limit = HALF_STEP / float(np.iinfo(dtype).max)
        if not self.scene.linear:
            # Each layer is rounded before the next.
            return [one.most < limit for one in needs]
        total, gone = 0.0, []
        for one in needs:
            change = STEEPEST * one.most
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
