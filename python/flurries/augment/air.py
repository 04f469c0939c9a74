"""What is in the air before a picture: flakes or drops, a texture of them, and a veil."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries import _core
from flurries._contract import Array
from flurries.augment.calibration import extinction
from flurries.augment.distance import Distances
from flurries.augment.falling import OPACITY, Falling, law_of, seen_by
from flurries.augment.sheets import Sheets, sheets_of
from flurries.camera.lens import Camera
from flurries.effects.air import NEAREST, Class, Eye, images_of
from flurries.effects.air import Air as Request
from flurries.effects.strength import reach
from flurries.gas.optics import visibility
from flurries.particles.population import FADE

if TYPE_CHECKING:
    from flurries.augment.fog import Patches

FPS = 30.0

# Planes that only a call reads: fresh memory costs more than what is written into it.
_SCRATCH = threading.local()

# Before what is near there are more flakes per cubic metre, up to so many times.
_DENSEST = 4.0

# By so much of the near depth, on either side, flakes fade in.
_NEAR_FADE = 0.2

_STILL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class View:
    """One eye's view."""

    shape: tuple[int, int]
    # Its offset is that of the eye.
    camera: Camera
    # Distance of the farthest eye from the middle, metres.
    eyes: float = 0.0


@dataclass(frozen=True)
class Air:
    """The weather of a record: its `loss` is the share of the contrast that all of it takes."""

    seed: int
    loss: float
    # Of what falls, metres per second; and seconds.
    velocity: tuple[float, float]
    exposure: float
    falling: Falling | None = None
    # The same at the rung of its amount, which sheets are made for.
    rung: Falling | None = None
    patches: Patches | None = None
    # The veil's visibility, metres, in place of one for the loss.
    visible: float | None = None

    @property
    def way(self) -> float:
        """Metres that what falls moves by while the shutter is open."""
        return float(np.hypot(*self.velocity)) * self.exposure


def scratch(name: str, shape: tuple[int, int]) -> Array:
    """Return a plane of this thread, whose content is that of its last use, (H, W) float32."""
    kept: dict[str, Array] = vars(_SCRATCH)
    found = kept.get(name)
    if found is None or found.shape != shape:
        found = kept[name] = np.empty(shape, np.float32)
    return found


class Here:
    """The air of one moment before one picture: drawn flakes, sheets of others, a veil."""

    def __init__(
        self, air: Air, view: View, distances: Distances, time: float, fps: float | None = None
    ) -> None:
        if air.visible is not None:
            distances = distances.until(reach(air.visible))
        self.air, self.view, self.distances, self.time = air, view, distances, time
        self.falling: Falling | None = None
        self.sheets: Sheets | None = None
        self.gain, self.density = 1.0, 0.0
        self.moving = fps is not None or view.eyes > 0.0
        # Whether nothing stands in what falls.
        self.open = air.falling is not None and distances.beyond(air.falling.far)
        if air.falling is None or air.rung is None or air.loss <= 0.0:
            return
        times, longer = self._times(air.falling), max(view.shape)
        self.falling = seen_by(air.falling, longer, times)
        self.gain, self.density = self.falling.look(air.way)
        self.sheets = sheets_of(
            air.rung, times, air.velocity, air.way, longer, view.camera.focal, self.moving
        )

    def _times(self, falling: Falling) -> float:
        """Return how many times more flakes there are before a picture that ends nearer."""
        if self.open:
            return 1.0
        deep = falling.far - falling.near
        before = np.clip((self.distances.quantiles - falling.near) / deep, 0.0, 1.0)
        return 1.0 / max(float(before.mean()), 1.0 / _DENSEST)

    @cached_property
    def extinction(self) -> float:
        """Of the veil, per metre."""
        air, falling = self.air, self.falling
        if air.visible is not None:
            return visibility(air.visible)
        if air.falling is not None and air.falling.veil == 0.0:
            return 0.0
        depth = self.distances.quantiles
        clear = np.ones(len(depth)) if falling is None else falling.before(depth)
        density = np.ones(1) if air.patches is None else air.patches.densities()
        return extinction(air.loss, depth, clear[:, None], density)

    def veil(self, thick: float) -> tuple[float, Array | None]:
        """Return the veil's opacity, as a number where it is even, else 0 and a plane."""
        plane, patches = self.distances.plane, self.air.patches
        even = patches is None or patches.strength == 0.0
        if even and plane.size == 1:
            return float(-np.expm1(-thick * plane[0, 0])), None
        found = scratch("veil", self.view.shape)
        field = None
        if patches is not None and not even:
            field = patches.field(self.view.shape, self.air.seed, self.time)
        _core.veil(found, plane, thick, field)
        return 0.0, found

    def alpha(self, *, passing: bool = False) -> tuple[Array, Any]:
        """Return the opacity of it all, (H, W), and its veil's: `passing` until the next call."""
        shape = self.view.shape
        if self.air.loss <= 0.0:
            return np.zeros(shape, np.float32), 0.0
        haze, plane = self.veil(self.extinction)
        hidden = haze if plane is None else plane
        if self.falling is None:
            if plane is None:
                return np.full(shape, haze, np.float32), hidden
            return plane if passing else plane.copy(), hidden
        out = scratch("alpha", shape) if passing else np.empty(shape, np.float32)
        self.write(out, haze, plane)
        return out, hidden

    @property
    def depth(self) -> Array | None:
        """The picture's depth where flakes may be behind it, (H, W) float32."""
        return None if self.open else self.distances.full(self.view.shape)

    @cached_property
    def layers(self) -> list[Any]:
        """The sheets where this picture reads them, for `_core.sheet_read`."""
        if self.falling is None or self.sheets is None:
            return []
        camera, moved = self.view.camera, None
        if self.moving:
            moved = np.array(self.air.velocity) * self.time - camera.offset[:2]
        return self.sheets.layers(self.falling, camera.focal, self.air.seed, moved)

    def write(self, out: Array, haze: float = 0.0, veil: Array | None = None) -> None:
        """Write the opacity of all that falls, and of a veil."""
        depth, drawn, request = self.depth, None, self.request()
        if request is not None:
            plane = scratch("drawn", self.view.shape)
            _core.particle_draw(plane, _core.fall(request), request.window, depth, None)
            drawn = plane, self.gain
        _core.sheet_read(out, (0, 0), self.layers, depth, True, drawn, veil, haze)

    def request(self, steps: tuple[float, ...] = ()) -> Request | None:
        """Return the flakes that are drawn, with places at steps of seconds; None without any."""
        falling, sheets, air = self.falling, self.sheets, self.air
        if falling is None or sheets is None or sheets.reach <= falling.near:
            return None
        law, (x, y), reach = law_of(falling.sizes), air.velocity, sheets.reach
        times = [self.time + s for s in (0.0, -0.5 * air.exposure, 0.5 * air.exposure, *steps)]
        end = reach if reach >= falling.far else reach * (1.0 + FADE)
        fade = falling.near * (1.0 - _NEAR_FADE), falling.near * (1.0 + _NEAR_FADE)
        one = Class(
            number=0, density=self.density, sizes=(law.smallest, law.largest), slope=law.slope,
            shown=(*fade, reach, end), by_size=False, heights=(-end, end), amounts=[1.0],
            ranks=(0.0, 1.0),
            at=[(-x * t, -y * t, 0.0) for t in times],
            swung=[falling.sway[1] * t / (2.0 * math.pi) for t in times],
            waves=None, depths=(0.0, end), profile=[],
        )  # fmt: skip
        camera, (height, width) = self.view.camera, self.view.shape
        eye = Eye(_STILL, camera.focals, camera.principal(self.view.shape), camera.offset)
        return Request(
            seed=air.seed, opacity=OPACITY, images=images_of(OPACITY), classes=[one],
            eyes=[eye] * len(times), sway=falling.sway[0], waves=None, clumps=None,
            shape=self.view.shape, window=(0, height, 0, width), room=0.0, near=NEAREST,
            closeup=None,
        )  # fmt: skip
