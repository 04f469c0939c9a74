"""What a scene's frames are made of: which effects run, with which steps, and what they get."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array, uniforms
from flurries._kept import Kept
from flurries._trace import current
from flurries.camera.lens import Camera
from flurries.frame.bands import Window, bands_of
from flurries.frame.edges import edges_by
from flurries.frame.matte import Front
from flurries.frame.mixing import Mix
from flurries.frame.needs import LeftOut, Needs, has_keys, needs_of, renderer_of
from flurries.frame.view import Frame
from flurries.io.color import linear_to_srgb, to_unit
from flurries.light.plate import PlateLight, cell_sums, plate_light
from flurries.light.shot import Light, light_of

_FRAMES = 9  # Frames of a background in which the light of its shot is found.
HALF_STEP = 0.5 - 1e-3  # Half a step of an integer picture, less what rounding in float32 can take.

# The steepest place of the sRGB encoding, at black: display values per linear light.
STEEPEST = 12.92


class Part(NamedTuple):
    """An effect of the scene that shows something at some time."""

    effect: Any
    renderer: Any  # What renders it: itself, or its parts.
    place: int  # Its number in the scene.
    seed: int
    needs: Needs | None  # The same at all times, or None where it has to be asked.

    @property
    def name(self) -> str:
        return getattr(self.effect, "NAME", "") or type(self.effect).__name__.lower()


class Ask(NamedTuple):
    """An effect that runs, its view of a frame, and what it needs for it."""

    part: Part
    frame: Frame  # Its window is all of the picture in which the weather can be seen.
    needs: Needs

    def derive(self, **changes: Any) -> Ask:
        return self._replace(frame=self.frame.derive(**changes))


@dataclass(eq=False, kw_only=True)
class Program:
    """The steps that run for each frame of a scene. All else is as in the scene."""

    effects: Sequence[Any]
    base: Frame  # The view of an effect that draws no random numbers, without depth and light.
    seed: int
    backdrop: Any  # Has frame(t), encoding ("display" or "linear") and count (None for a still).
    distance: Any  # None, or has frame(t) and still: whether every frame has the same.
    # None, or has frame(t), a `Front`, and still and deep: whether any of it has a depth.
    mattes: Any
    linear: bool  # Whether layers are mixed in linear light.
    primaries: Array | None = None  # See `Mix`.
    light: Light | None = None  # Of the shot, where the scene says it.
    # In the background's last frame; all scenes derived from one share it.
    found: dict[str, tuple[Any, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.parts: list[Part] = []
        self.left_out: list[LeftOut] = []
        base, kept = self.base, None
        if all(part is None or part.still for part in (self.distance, self.mattes)):
            kept = Kept(4 * len(bands_of(base.window)) + 8)
        moves = not base.path.still or has_keys(base.lens) or has_keys(base.lights)
        deep = self.distance is not None or (self.mattes is not None and self.mattes.deep)
        self.base = replace(base, kept=kept, settled=kept is not None and not moves, deep=deep)
        first = self.frame(0.0)
        for index, effect in enumerate(self.effects):
            # What an effect needs does not depend on the seed.
            needs = None if has_keys(effect) else needs_of(effect, first)
            if needs is not None and not needs.steps:
                self.left_out += needs.left_out
                continue
            own = getattr(effect, "seed", None)
            seed = effect_seed(self.seed, index) if own is None else own
            self.parts.append(Part(effect, renderer_of(effect), index, seed, needs))

    def mix(self, plate: Array) -> Mix:
        """Return the light that layers are mixed in, over a plate of the background."""
        straight = plate.shape[2] == 4 and plate.dtype.kind == "u"
        return Mix(self.linear, self.backdrop.encoding, straight, self.primaries)

    def camera(self, eye: Camera | None, t: float) -> Camera:
        """Return an eye, or the path's own camera, as it is at `t`."""
        path = self.base.path
        return path.pose(path.camera if eye is None else eye, t)

    def frame(self, t: float, camera: Camera | None = None, window: Window | None = None) -> Frame:
        """Return the view of an effect that draws no random numbers, without depth and light."""
        camera = self.camera(None, t) if camera is None else camera
        return replace(self.base, t=t, camera=camera, window=window or self.base.window)

    def asks(
        self, t: float, camera: Camera, window: Window, dtype: np.dtype[Any] | None, *,
        read: bool = True,
    ) -> list[Ask]:  # fmt: skip
        """Return the effects that run at `t` with their views of the frame, back to front."""
        # A picture of integers, of type `dtype`, does not show what is less than half of a step; of
        # layers, where it is None, every value counts. Depth and light are filled in where an
        # effect reads them, unless `read` is False.
        base, front = self.frame(t, camera, window), self.front(t)
        runs = self._parts_in(base, dtype)
        reads = frozenset[str]().union(*(needs.reads for _, needs in runs)) if read else ()
        given: dict[str, dict[str, Any]] = {}
        depth: Array | None = None
        if "depth" in reads:
            depth, edges = self.depth_at(t), self.distance and self.distance.edges(t)
            if depth is not None and (plate := self.backdrop.frame(t)).shape[2] == 4:
                edges = edges_by(to_unit(plate[..., 3]), depth, edges)
                base = base if self.backdrop.count is None else base.derive(kept=None)
            depth = edges.back if edges else depth
            nearer = edges and edges.front, front and front.deep
            given["depth"] = {"depth": depth, "nearer": tuple(d for d in nearer if d is not None)}
        if "ambient" in reads:
            # The display values of white snow in the light of the shot.
            with current.get().stage("ambient"):
                white = linear_to_srgb(self._light().at(t)[0])
            given["ambient"] = {"ambient": tuple(white.tolist())}
        if "plate" in reads:
            given["plate"] = {"plate": self._plate(t, depth)}
        visible = None if front is None or dtype is None else front.visible
        # Extinctions around the camera, per metre; 0 where not known.
        airs = [
            float(air(t)) if base.lights and (air := getattr(part.renderer, "air", None)) else 0.0
            for part, _ in runs
        ]
        found = []
        for number, (part, needs) in enumerate(runs):
            read_by = {k: v for name in needs.reads for k, v in given.get(name, {}).items()}
            frame = base.derive(
                seed=part.seed, air=(sum(airs), sum(airs[:number])),
                steps={step.name: step for step in needs.steps}, visible=visible,
                whole=dtype is None, **read_by,
            )  # fmt: skip
            found.append(Ask(part, frame, needs))
        return found

    def views(self, t: float) -> list[tuple[Any, Frame]]:
        """Return the effects that run at `t`, each with its exact view of the whole frame."""
        asks = self.asks(t, self.camera(None, t), self.base.window, None)
        return [(ask.part.effect, ask.frame) for ask in asks]

    def _parts_in(self, frame: Frame, dtype: np.dtype[Any] | None) -> list[tuple[Part, Needs]]:
        """Return the parts that show anything in a frame, with their needs."""
        asked = [(part, part.needs or needs_of(part.effect, frame)) for part in self.parts]
        runs = [(part, needs) for part, needs in asked if needs.steps]
        if dtype is None or dtype.kind != "u":
            return runs
        limit, total, shown = HALF_STEP / float(np.iinfo(dtype).max), 0.0, []
        for part, needs in runs:
            change = needs.most * needs.brightest * (STEEPEST if self.linear else 1.0)
            # In display values each layer is rounded before the next; in linear light they add up.
            if total + change >= limit:
                shown.append((part, needs))
            elif self.linear:
                total += change
        return shown

    def front(self, t: float) -> Front | None:
        found: Front | None = self.mattes and self.mattes.frame(t)
        return found

    def open_part(self, window: Window, front: Front | None) -> Window | None:
        """Return the part of a window in which the weather can be seen at all."""
        if not self.parts:
            return None
        visible = None if front is None else front.visible
        return window if visible is None else visible.within(window)

    def depth_at(self, t: float) -> Array | None:
        """Return the background's depth at `t`, (H, W) float32, or None."""
        if self.distance is None:
            # What stands in the air before nothing needs one all the same.
            return np.full(self.base.shape, np.inf, np.float32) if self.base.deep else None
        with current.get().stage("depth"):
            depth: Array = self.distance.frame(t)
        return depth

    # Of the whole picture, so that a region has the whole's bits.
    def find_light(self, *, keyed: bool = False) -> Light:
        """Return the light of the shot, from frames of all of its background."""
        sums = {}
        for number in self.backdrop.sampled(_FRAMES):
            with suppress(OSError):  # Damaged frames have no say.
                sums[number] = cell_sums(*self._picture(number))[0]
        return light_of(sums, keyed=keyed)

    def _light(self) -> Light:
        if self.light is None and "light" not in self.found:
            self.found["light"] = (), self.find_light()
        light: Light = self.light or self.found["light"][1]
        return light

    def _plate(self, t: float, depth: Array | None) -> PlateLight:
        """Return the light by places of the background at `t`; of one that never changes, once."""
        with current.get().stage("plate light"):
            _, sky, ground = self._light().at(t)
            depth = None if self.distance is None else depth
            number = 0 if self.backdrop.count is None else math.floor(t)
            key = id(depth), number, *sky.tolist(), *ground.tolist()
            there = self.found.get("plate")
            if there is None or there[0] != key:
                made = plate_light(*self._picture(t), sky, ground, depth)
                # With the depth, so that its number stays its own.
                there = self.found["plate"] = key, made, depth
        answer: PlateLight = there[1]
        return answer

    def _picture(self, t: float) -> tuple[Array, str]:
        picture = self.backdrop.frame(t)
        if self.primaries is not None:
            # Effects' colors are of Rec. 709's primaries.
            back = (picture[..., :3] @ np.linalg.inv(self.primaries)).astype(np.float32)
            picture = np.concatenate([back, picture[..., 3:]], axis=2)
        return picture, self.backdrop.encoding


def effect_seed(seed: int, index: int) -> int:
    """Return the seed of the effect at a place of the list; the first one's is the scene's own."""
    if index == 0:
        return seed
    return int(uniforms(seed, -1, index + 1)[index] * 2**53)
