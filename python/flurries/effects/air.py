"""What a frame asks of the air: the flakes of a population before an eye, as the kernel reads them.

The air is that of each class of size, which falls and blows as a whole; a flake's place in it never
changes. So a request says where the camera is in that air at the frame's times, and how the eye
looks there. `Flakes` are the few that textures without a population have near the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Float64
from flurries._kept import kept
from flurries.camera.lens import Camera
from flurries.camera.optics import Blur
from flurries.camera.path import CameraPath
from flurries.effects.clumps import Clumps, clumps_of
from flurries.effects.gusts import carried_by_profile, cycles_of, wave_weights
from flurries.effects.maps import TUNED
from flurries.effects.motion import Motion
from flurries.effects.weather import NEAR_FADE, Share, Weather, amounts_at
from flurries.frame.view import Frame
from flurries.motion.keys import Keys, Number, value_at
from flurries.particles.population import FADE, SizeClass
from flurries.particles.sizes import Sizes

# The most opaque ball there is: its middle lets through a ten-millionth.
_MOST_OPAQUE = 0.99

# Sizes of these looks are six deviations of a Gaussian wide; a ball that covers as much is smaller.
_BALL = math.sqrt(8.0) / 6.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Flakes:
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
    emission: ClassVar[float] = 1.0
    clumps: ClassVar[float] = 0.0
    near: ClassVar[float] = 0.0

    @cached_property
    def law(self) -> Sizes:
        small, large = (_BALL * size for size in self.sizes)
        return Sizes(small, 0.5 * (small + large), large)

    def opacity_at(self, t: float) -> float:
        return min(float(value_at(self.opacity, t)), _MOST_OPAQUE)

    def shares(self, frame: Frame) -> tuple[Share, ...]:
        return _shares(self, frame.shape, frame.path, frame.camera.focal)


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
    shown = (high, low, flakes.reach, flakes.reach * (1.0 + FADE))
    share = Share(one, flakes.motion, flakes.reach, shown)
    return (share,) if math.isfinite(density) else ()


# Nothing nearer than this is drawn, metres; what `particles.splat` has for a default.
NEAREST = 0.1

# Sigma of a flake's image in px between which it gets a shape: below, no shape can be told.
SWITCH = (3.7, 4.1)

# Places along the view at which a wind of depth is looked up, and heights at which the amount of
# flakes is while they begin or cease to fall.
_DEPTHS, _HEIGHTS = 129, 65


class Eye(NamedTuple):
    turn: Any  # (3, 3): rows turn house axes into the eye's.
    focal: tuple[float, float]  # (x, y): pixels.
    center: tuple[float, float]  # (x, y): the principal point, pixels.
    offset: tuple[float, float, float]  # The eye in the camera's axes, metres.


class Class(NamedTuple):
    """Flakes of an interval of sizes."""

    number: int  # Of the class in its population.
    density: float  # The most there are, per cubic metre.
    sizes: tuple[float, float]  # (smallest, largest): diameters, metres.
    slope: float  # Of the law exp(-slope D), per metre.
    # (4,): depths between which they fade in, and between which they fade out again, metres.
    shown: tuple[float, float, float, float]
    by_size: bool  # Whether smaller flakes than the largest fade in nearer, as they are smaller.
    heights: tuple[float, float]  # (low, high): below the camera, metres: the places of `amounts`.
    amounts: list[float]  # Shares of the density that are there.
    ranks: tuple[float, float]  # (first, last): of these shares the part that is shown.
    at: list[tuple[float, float, float]]  # The camera in this class's air at each time, metres.
    swung: list[float]  # Angles of the sway at each time, cycles.
    # (m, 6 times): displacements by the waves of the wind, real parts first, metres.
    waves: Float64 | None
    # (near, far): along the house's z ahead of the camera, metres: the places of `profile`.
    depths: tuple[float, float]
    # How far a wind of depth has carried the air at each time, metres, at even depths.
    profile: list[tuple[list[float], list[float]]]


class Closeup(NamedTuple):
    """The looks of flakes from near and out of focus."""

    kind: str  # What large ones are.
    # (low, high): sigma in px between which a round flake gives way to a shape.
    switch: tuple[float, float]
    blur: Blur | None  # Of the lens.
    seed: int  # Of shapes and tumbling.
    seconds: float  # Since frame 0.
    exposure: float  # Seconds.


class Air(NamedTuple):
    """The flakes before an eye: at the frame's time, as its shutter opens and closes, and later."""

    seed: int
    opacity: float  # Mean over the disc of a resting flake, 0 to 1.
    images: _core.BallImages  # Of that opacity.
    classes: list[Class]
    eyes: list[Eye]  # At each time.
    sway: float  # Metres.
    waves: Float64 | None  # (m, 3): cycles per metre.
    clumps: Clumps | None  # With them the densities of classes are those of the densest places.
    shape: tuple[int, int]  # (H, W): of the whole picture, pixels.
    window: tuple[int, int, int, int]  # (top, bottom, left, right): the pixels that are wanted.
    room: float  # Metres around the view in which blurred flakes may be seen.
    near: float  # Metres.
    closeup: Closeup | None  # How flakes look from near.


def air_of(
    weather: Weather | Flakes, frame: Frame, amount: float, steps: tuple[float, ...] = ()
) -> Air:
    """Return the flakes that are drawn before a frame's camera."""
    clumps = clumps_of(weather, frame)
    exposure, wind = weather.motion.exposure(frame), weather.motion.varied
    path, fps = frame.path, frame.fps
    after = (0.0, -0.5 * exposure, 0.5 * exposure, *steps)
    eyes = [_eye(frame.camera, frame)] * len(after)
    if path.turns or path.zooms:
        eyes[1:] = [_eye(frame.later(s).camera if s else frame.camera, frame) for s in after[1:]]
    slope, shares, opacity = weather.law.slope, weather.shares(frame), weather.opacity_at(frame.t)
    times = [frame.t + step for step in after]
    swung = [weather.sway[1] / (2.0 * math.pi * fps) * t for t in times]
    ways = [share.motion.places(path, fps, times) for share in shares]
    blur = None if frame.lens is None else frame.blur
    room, closeup = 0.0, None
    if blur is not None:
        # As far as a flake out of focus reaches, at its own depth.
        ends = [one.reach * (1.0 + FADE) for one in shares]
        near, deepest = max(weather.near / NEAR_FADE, 1e-3), max(ends, default=1.0)
        widest = max(near * blur.circle(near), deepest * blur.circle(deepest))
        room = 0.75 * widest / frame.camera.focal
    if weather.shape != "round" or blur is not None:
        closeup = Closeup(weather.shape, SWITCH, blur, frame.seed, frame.t / fps, exposure / fps)
    part = 0.0
    if frame.lap is not None and weather.keyed:
        # The round that goes has lost those of low ranks, which the next one shows.
        part = min(frame.lap.part(frame.t), 1.0 - 1e-9)
    classes = []
    for number, (share, at) in enumerate(zip(shares, ways, strict=True)):
        end, waves, profile = share.reach * (1.0 + FADE), None, []
        emission = weather.emission
        if isinstance(emission, Keys):
            assert isinstance(weather, Weather)
            heights = np.linspace(-end, end, _HEIGHTS)
            amounts = (amount * amounts_at(weather, frame, share, heights)).tolist()
        else:
            amounts = [amount * emission]
        if wind is not None and wind.profile is not None:
            ahead = np.linspace(0.0, end, _DEPTHS)
            moved = [carried_by_profile(share.motion, path, fps, t, ahead).T for t in times]
            profile = [(one[0].tolist(), one[1].tolist()) for one in moved]
        if wind is not None and wind.waves is not None:
            waves = wave_weights(share.motion, fps, times, np.array(at[0]))
        classes.append(Class(
            number=number, density=share.size.density * (1.0 + weather.clumps),
            sizes=(share.size.smallest, share.size.largest), slope=slope,
            shown=share.shown, by_size=isinstance(weather, Flakes), heights=(-end, end),
            amounts=[min(one / (1.0 - part), 1.0) for one in amounts], ranks=(part, 1.0), at=at,
            swung=swung, waves=waves, depths=(0.0, end), profile=profile,
        ))  # fmt: skip
    return Air(
        seed=frame.seed, opacity=opacity, images=images_of(opacity), classes=classes, eyes=eyes,
        sway=weather.sway[0],
        waves=None if wind is None or wind.waves is None else cycles_of(wind.waves),
        clumps=clumps, shape=frame.shape,
        window=frame.window if frame.shared is None else frame.shared.window,
        room=room, near=NEAREST, closeup=closeup,
    )  # fmt: skip


def _eye(camera: Camera, frame: Frame) -> Eye:
    turn = camera.matrix().T.tolist()
    return Eye(turn, camera.focals, camera.principal(frame.shape), camera.offset)


def images_of(opacity: float) -> _core.BallImages:
    return _images(opacity, _core.reproducible())


@kept(8)
def _images(opacity: float, mode: bool) -> _core.BallImages:
    return _core.BallImages(opacity)
