"""What a frame asks of the air: the flakes of a population before an eye, as the kernel reads them.

The air is that of each class of size, which falls and blows as a whole; a flake's place in it never
changes. So a request says where the camera is in that air at the frame's times, and how the eye
looks there.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Float64
from flurries._threads import kept_by_mode
from flurries.camera.lens import Camera
from flurries.camera.optics import Blur
from flurries.camera.path import CameraPath
from flurries.effects.flakes import Flakes
from flurries.effects.gusts import carried_by_profile, wave_weights
from flurries.effects.motion import relative_course
from flurries.effects.weather import HEIGHTS, Share, Weather
from flurries.frame.view import Frame
from flurries.motion.keys import Number, Vector, value_at

# Nothing nearer than this is drawn, metres; what `particles.splat` has for a default.
NEAREST = 0.1

# Sigma of a flake's image in px between which it gets a shape: below, no shape can be told.
SWITCH = (2.5, 3.5)

# Places along the view at which a wind of depth is looked up.
_DEPTHS = 129

_Triple = tuple[float, float, float]


class Eye(NamedTuple):
    """An eye at one time.

    Attributes
    ----------
    turn : (3, 3)
        Rows turn house axes into the eye's.
    focal : (x, y)
        Pixels.
    center : (x, y)
        The principal point, pixels.
    offset : (3,)
        The eye in the camera's axes, metres.
    """

    turn: Any
    focal: tuple[float, float]
    center: tuple[float, float]
    offset: _Triple


class Class(NamedTuple):
    """Flakes of an interval of sizes.

    Attributes
    ----------
    number : int
        Of the class in its population.
    density : float
        The most there are, per cubic metre.
    sizes : (smallest, largest)
        Diameters, metres.
    slope : float
        Of the law exp(-slope D), per metre.
    shown : (4,)
        Depths between which they fade in, and between which they fade out again, metres.
    by_size : bool
        Whether smaller flakes than the largest fade in nearer, as they are smaller.
    heights : (low, high)
        Below the camera, metres: the places of `amounts`.
    amounts : list of float
        Shares of the density that are there.
    ranks : (first, last)
        Of these shares the part that is shown.
    at : list of (3,)
        The camera in this class's air at each time, metres.
    swung : list of float
        Angles of the sway at each time, cycles.
    waves : (m, 6 times) float64, optional
        Displacements by the waves of the wind, real parts first, metres.
    depths : (near, far)
        Along the house's z ahead of the camera, metres: the places of `profile`.
    profile : list of (x, y)
        How far a wind of depth has carried the air at each time, metres, at even depths.
    """

    number: int
    density: float
    sizes: tuple[float, float]
    slope: float
    shown: tuple[float, float, float, float]
    by_size: bool
    heights: tuple[float, float]
    amounts: list[float]
    ranks: tuple[float, float]
    at: list[_Triple]
    swung: list[float]
    waves: Float64 | None
    depths: tuple[float, float]
    profile: list[tuple[list[float], list[float]]]


class Closeup(NamedTuple):
    """The looks of flakes from near and out of focus.

    Attributes
    ----------
    kind : {"aggregate", "drop", "round"}
        What large ones are.
    switch : (low, high)
        Sigma in px between which a round flake gives way to a shape.
    blur : Blur, optional
        Of the lens.
    seed : int
        Of shapes and tumbling.
    seconds : float
        Since frame 0.
    """

    kind: str
    switch: tuple[float, float]
    blur: Blur | None
    seed: int
    seconds: float


class Air(NamedTuple):
    """The flakes before an eye: at the frame's time, as its shutter opens and closes, and later.

    Attributes
    ----------
    seed : int
    opacity : float
        Mean over the disc of a resting flake, 0 to 1.
    images : BallImages
        Of that opacity.
    classes : list of Class
    eyes : list of Eye
        At each time.
    sway : float
        Metres.
    waves : (m, 3) float64, optional
        Cycles per metre.
    shape : (H, W)
        Of the whole picture, pixels.
    window : (top, bottom, left, right)
        The pixels that are wanted.
    room : float
        Metres around the view in which blurred flakes may be seen.
    near : float
        Metres.
    closeup : Closeup, optional
        How flakes look from near.
    """

    seed: int
    opacity: float
    images: _core.BallImages
    classes: list[Class]
    eyes: list[Eye]
    sway: float
    waves: Float64 | None
    shape: tuple[int, int]
    window: tuple[int, int, int, int]
    room: float
    near: float
    closeup: Closeup | None


def air_of(
    weather: Weather | Flakes, frame: Frame, amount: float, *, steps: tuple[float, ...] = ()
) -> Air:
    """Return the flakes that are drawn before a frame's camera.

    Parameters
    ----------
    amount : float
        Share of the population, 0 to 1.
    steps : tuple of float
        Frames after this one at which places are asked for, besides those of the exposure.
    """
    exposure, path = value_at(weather.motion.shutter, frame.t), frame.path
    after = (0.0, -0.5 * exposure, 0.5 * exposure, *steps)
    times = [frame.t + step for step in after]
    if path.turns or path.zooms:
        eyes = [_eye(frame.later(step).camera if step else frame.camera, frame) for step in after]
    else:
        eyes = [_eye(frame.camera, frame)] * len(after)
    blur, wind = frame.blur, weather.motion.varied
    shares = weather.shares(frame)
    room = 0.0
    if blur is not None:
        # As far as a flake out of focus reaches, at its own depth.
        near, deepest = max(weather.near, 1e-3), max((one.end for one in shares), default=1.0)
        widest = max(depth * blur.circle(depth) for depth in (near, deepest))
        room = 0.75 * widest / frame.camera.focal
    closeup = None
    if weather.shape != "round" or blur is not None:
        closeup = Closeup(weather.shape, SWITCH, blur, frame.seed, frame.t / frame.fps)
    opacity = weather.opacity_at(frame.t)
    return Air(
        seed=frame.seed,
        opacity=opacity,
        images=images_of(opacity),
        classes=[
            _class(weather, frame, times, number, share, amount)
            for number, share in enumerate(shares)
        ],
        eyes=eyes,
        sway=weather.sway[0],
        waves=None if wind is None or wind.waves is None else _cycles(wind.waves),
        shape=frame.shape,
        window=frame.window if frame.shared is None else frame.shared.window,
        room=room,
        near=NEAREST,
        closeup=closeup,
    )


@kept_by_mode(8)
def images_of(opacity: float) -> _core.BallImages:
    """Return the images of flakes of an opacity."""
    return _core.BallImages(opacity)


def _eye(camera: Camera, frame: Frame) -> Eye:
    turn = camera.matrix().T.tolist()
    return Eye(turn, camera.focals, camera.principal(frame.shape), camera.offset)


def _class(
    weather: Weather | Flakes, frame: Frame, times: list[float], number: int, share: Share,
    amount: float,
) -> Class:  # fmt: skip
    motion, wind, path, fps = share.motion, weather.motion.varied, frame.path, frame.fps
    fall, mean = motion.fall, motion.mean_wind
    line = _line(path, fps, fall, mean)
    if line is None:
        found = [path.relative(t, fps=fps, fall=fall, wind=mean)[0].tolist() for t in times]
    else:
        found = [[start + rate * t for start, rate in zip(*line, strict=True)] for t in times]
    at: list[_Triple] = [(x, y, z) for x, y, z in found]
    deepest, part = share.end, 0.0
    if frame.lap is not None and weather.keyed:
        # The round that goes has lost those of low ranks, which the next one shows.
        part = min(frame.lap.part(frame.t), 1.0 - 1e-9)
    heights = np.linspace(-deepest, deepest, 1 if weather.steady else HEIGHTS)
    there = weather.amounts(frame, share, amount, heights) / (1.0 - part)
    profile: list[tuple[list[float], list[float]]] = []
    if wind is not None and wind.profile is not None:
        ahead = np.linspace(0.0, deepest, _DEPTHS)
        for t in times:
            moved = carried_by_profile(motion, path, fps, t, ahead)
            profile.append((moved[:, 0].tolist(), moved[:, 1].tolist()))
    waves = None
    if wind is not None and wind.waves is not None:
        waves = wave_weights(motion, fps, times, np.array(at[0]))
    turns = weather.sway[1] / (2.0 * math.pi * fps)
    return Class(
        number=number,
        density=share.size.density,
        sizes=(share.size.smallest, share.size.largest),
        slope=weather.law.slope,
        shown=weather.shown(share, frame),
        by_size=isinstance(weather, Flakes),
        heights=(-deepest, deepest),
        amounts=np.minimum(there, 1.0).tolist(),
        ranks=(part, 1.0),
        at=at,
        swung=[turns * t for t in times],
        waves=waves,
        depths=(0.0, deepest),
        profile=profile,
    )


@lru_cache(maxsize=64)
def _line(
    path: CameraPath, fps: float, fall: Number, wind: Vector
) -> tuple[list[float], list[float]] | None:
    """Return place and velocity per frame of a camera in air that it passes evenly, at frame 0.

    None where its velocity changes.
    """
    course = relative_course(path, fps, fall, wind)
    if len(course.knots) or (course.slopes is not None and course.slopes.any()):
        return None
    start, rate = path.relative(0.0, fps=fps, fall=fall, wind=wind)
    return start.tolist(), rate.tolist()


@lru_cache(maxsize=32)
def _cycles(waves: Any) -> Float64:
    return np.ascontiguousarray(waves.k / (2.0 * np.pi))
