"""Flakes that are drawn one by one, the near ones or all of them, and the list of them."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64
from flurries._core import SortedFlakes
from flurries._kept import kept
from flurries.camera.path import CameraPath
from flurries.effects.air import air_of
from flurries.effects.maps import TUNED
from flurries.effects.motion import STEPS, Motion
from flurries.frame.needs import Needs, Step, has_keys
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.light.lamp import Optics
from flurries.motion.keys import Keys, Number, value_at
from flurries.particles.population import FADE, SizeClass
from flurries.particles.sizes import Sizes

STEP = 1.0 / 1024.0  # Frames over which a velocity is a difference of places, which are float64.

# What is known of a drawn flake; see :func:`flurries.flakes`.
FLAKE = np.dtype([
    ("id", np.uint64), ("place", np.float64, 3), ("pixel", np.float64, 2), ("depth", np.float64),
    ("diameter", np.float64), ("opacity", np.float64),
])  # fmt: skip

_MOST_OPAQUE = 0.99  # The most opaque ball there is: its middle lets through a ten-millionth.

# Sizes of `Flakes` are six deviations of a Gaussian wide; a ball that covers as much is smaller.
_BALL = math.sqrt(8.0) / 6.0

# Of more than so many `Flakes` in view those are not drawn whose largest are narrower than so many
# px: they cannot be told one by one.
_FEW, _TOLD = 600, 0.5


@dataclass(frozen=True, eq=False)
class Share:
    """A class of size, and what is drawn of it."""

    size: SizeClass
    motion: Motion  # With the fall speed of the class.
    reach: float  # Depth up to which its flakes are drawn, metres.
    # Depths between which drawn ones fade in, and between which they fade out again, metres.
    shown: tuple[float, float, float, float]
    placed: tuple[float, ...] | None = None  # Where in its air its one flake is, by hand, metres.


class Drawn(ABC):
    """Flakes that move and look alike but for their sizes, as a part of a layer."""

    @abstractmethod
    def shares(self, frame: Frame) -> tuple[Share, ...]:
        """Return the flakes that are drawn, by classes of size."""

    @abstractmethod
    def opacity_at(self, t: float) -> float: ...

    @property
    def hangs(self: Any) -> bool:
        """Whether no flake ever swings."""
        return not isinstance(self.sway, Keys) and 0.0 in self.sway

    def needs(self: Any, frame: Frame, amount: float) -> Needs:
        opacity, most = self.opacity_at(frame.t), 0.0
        for one in self.shares(frame):
            most = max(most, one.size.density * one.reach)
        if opacity == 0.0 or most == 0.0:
            return Needs.none("flakes", "there are none")
        still = frame.settled and self.motion.still and self.hangs
        # Shapes tumble.
        still = still and self.shape == "round" and self.notes is None and not has_keys(self)
        # However few there are, one that is there shows whole.
        return Needs((Step("flakes", once=still),), most=1.0)

    def alpha(self, frame: Frame, amount: float) -> Array:
        if frame.whole:
            return self.seen(frame, amount)[2]
        flakes, result = self.listed(frame, amount), plane(frame.size)
        _core.particle_draw(result, flakes, frame.window, frame.depth, None)
        return result

    def lit(
        self, frame: Frame, amount: float, optics: Optics, behind: tuple[Array, Any] | None
    ) -> tuple[Array, Array]:
        """Return opacity and light under the frame's lamps of the flakes and what is behind."""
        drawn, lamps = self.listed(frame, amount), frame.lamps()
        near, glow = plane(frame.size), plane((*frame.size, 3))
        _core.particle_draw_lit(near, glow, drawn, frame.window, lamps, optics, frame.depth, behind)
        return near, glow

    def listed(self, frame: Frame, amount: float) -> SortedFlakes:
        def fall() -> SortedFlakes:
            return _core.fall(air_of(self, frame, amount, STEPS if frame.whole else ()))

        return frame.once(self, "flakes", fall, eye=True)

    def seen(self, frame: Frame, amount: float) -> tuple[SortedFlakes, Array, Array]:
        """Return the flakes, which of them shows most at a pixel or -1, and their opacity."""

        def make() -> tuple[SortedFlakes, Array, Array]:
            alpha, nearest = plane(frame.size), plane(frame.size, np.int32)
            flakes = self.listed(frame, amount)
            _core.particle_draw(alpha, flakes, frame.window, frame.depth, nearest)
            return flakes, nearest, alpha

        return frame.once(self, "seen", make, eye=True, depth=True)


@dataclass(frozen=True, eq=False, kw_only=True)
class Flakes(Drawn):
    """The few flakes that textures without a population have near the camera."""

    motion: Motion  # What moves them.
    number: int  # How many are in view.
    density: float | None = None  # Per cubic metre, in place of the number in view.
    reach: float  # Depth up to which there are any, metres.
    # (smallest, largest): widths, metres, as many of each: six times the deviation of a Gaussian
    # that covers as much.
    sizes: tuple[float, float]
    opacity: Number  # Mean over the disc of a resting one.
    sway: tuple[float, float] = (0.0, 0.0)  # (amplitude, rate): metres, and radians per second.
    # (low, high): sigma of images on a picture 1024 px wide between which flakes fade: out-of-
    # focus puffs look like dirt.
    largest: tuple[float, float] = (3.5, 6.0)
    keyed: bool = False  # Whether the amount of flakes changes.

    shape: ClassVar[str] = "round"
    by_size: ClassVar[bool] = True
    emission: ClassVar[float] = 1.0
    clumps: ClassVar[float] = 0.0
    near: ClassVar[float] = 0.0
    notes: ClassVar[None] = None

    @cached_property
    def law(self) -> Sizes:
        small, large = (_BALL * size for size in self.sizes)
        return Sizes(small, 0.5 * (small + large), large)

    def opacity_at(self, t: float) -> float:
        return min(float(value_at(self.opacity, t)), _MOST_OPAQUE)

    def shares(self, frame: Frame) -> tuple[Share, ...]:
        return _shares(self, frame.shape, frame.path, frame.camera.focal)

    def faint(self, frame: Frame, amount: float) -> tuple[float, float, float]:
        """Return the optical depth of those not drawn, and the depths between which they are."""
        thick, middle = 0.0, 1.0 + 0.5 * FADE
        near, far = 0.0, middle * self.reach
        for one in self.shares(frame):
            near, covered = middle * one.reach, self.opacity_at(frame.t) * self.law.moment(2.0)
            thick = amount * one.size.density * 0.25 * math.pi * covered * (far - near)
        return thick, near, far


@kept(64)
def _shares(
    flakes: Flakes, shape: tuple[int, int], path: CameraPath, focal: float
) -> tuple[Share, ...]:
    (height, width), (fx, fy) = shape, path.widest.focals
    # The view is a pyramid: a third of the prism around it.
    view = width * height * flakes.reach**3 / (3.0 * fx * fy)
    density = flakes.number / view if flakes.density is None else flakes.density
    small, large = flakes.law.smallest, flakes.law.largest
    fall = float(value_at(flakes.motion.fall, 0.0))
    one = SizeClass(density, small, large, fall, flakes.law.nodes(small, large))
    # The largest fade in, and all out again.
    widest = focal * flakes.sizes[1] / (6.0 * width / TUNED)
    low, high = (widest / limit for limit in flakes.largest)
    part = min(_FEW / max(density * view, _FEW), 1.0) ** (1.0 / 3.0)
    reach = min(flakes.reach, max(part * flakes.reach, path.longest_focal * large / _TOLD))
    shown = (high, low, reach, reach * (1.0 + FADE))
    share = Share(one, flakes.motion, reach, shown)
    return (share,) if math.isfinite(density) else ()


def drawn_of(effect: Any, frame: Frame) -> npt.NDArray[Any] | None:
    """Return the flakes of an effect that are drawn one by one, of `FLAKE`; None if none are."""
    if hasattr(effect, "then"):
        effect, frame = effect.effect, effect.then(frame)
    parts, found = getattr(effect, "parts", None), []
    for part in getattr(parts, "parts", [parts]):
        flakes = getattr(part, "flakes", None)
        if not isinstance(flakes, Drawn):
            continue
        ids, rows, _ = _core.flake_rows(flakes.listed(frame, value_at(part.amount, frame.t)))
        made = np.empty(len(ids), FLAKE)
        # The camera may be beside its eyes.
        origin = frame.path.place(frame.t, fps=frame.fps)
        made["place"] = origin + rows[:, :3] @ frame.camera.matrix().T
        made["id"], made["pixel"], made["depth"] = ids, rows[:, 3:5], rows[:, 5]
        made["diameter"], made["opacity"] = rows[:, 6], flakes.opacity_at(frame.t) * rows[:, 7]
        found.append(made)
    return np.concatenate(found) if found else None


def velocities(now: npt.NDArray[Any], then: npt.NDArray[Any], seconds: float) -> Float64:
    """Return how fast flakes of `FLAKE` move until a moment later, (n, 3) m/s."""
    speed = np.zeros((len(now), 3))
    _, here, there = np.intersect1d(now["id"], then["id"], return_indices=True)
    if len(here):
        moved = (then["place"][there] - now["place"][here]) / seconds
        # One that is gone a moment later moves as most of them do.
        speed[:], speed[here] = np.median(moved, axis=0), moved
    return speed
