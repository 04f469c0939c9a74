"""What a frame asks of the air: the flakes before an eye, as the kernel reads them."""

import math
from typing import Any, NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import Float64
from flurries._kept import kept
from flurries.camera.lens import Camera
from flurries.camera.optics import Blur
from flurries.effects.notes import Asked
from flurries.effects.uneven import Clumps, carried_by_profile, clumps_of, cycles_of, wave_weights
from flurries.frame.view import Frame
from flurries.motion.keys import Keys, Vector, value_at
from flurries.particles.population import FADE

# Nothing nearer than this is drawn, metres; what `particles.splat` has for a default.
NEAREST = 0.1

# Flakes fade in before the lens from the near depth over this: from it on all are there.
NEAR_FADE = 1.25

# Sigma of a flake's image in px between which it gets a shape: below, no shape can be told.
SWITCH = (4.4, 4.8)

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
    placed: Any = None  # (3,): where the one flake that somebody put there is in this air, metres.


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
    sway: list[float]  # Amplitudes at each time, metres.
    waves: Float64 | None  # (m, 3): cycles per metre.
    clumps: Clumps | None  # With them the densities of classes are those of the densest places.
    shape: tuple[int, int]  # (H, W): of the whole picture, pixels.
    window: tuple[int, int, int, int]  # (top, bottom, left, right): the pixels that are wanted.
    room: float  # Metres around the view in which blurred flakes may be seen.
    near: float  # Metres.
    closeup: Closeup | None  # How flakes look from near.
    notes: Asked | None = None


def air_of(weather: Any, frame: Frame, amount: float, steps: tuple[float, ...] = ()) -> Air:
    """Return the flakes of a `Drawn` before a frame's camera, with places at steps of frames."""
    clumps, path, fps = clumps_of(weather, frame), frame.path, frame.fps
    motion = weather.motion
    exposure, wind = motion.exposure(frame), motion.varied
    gusts = None if wind is None else wind.waves
    after = (0.0, -0.5 * exposure, 0.5 * exposure, *steps)
    times, clock = motion.clocks(frame.t, after)
    slope, shares, opacity = weather.law.slope, weather.shares(frame), weather.opacity_at(frame.t)
    eyes = [_eye(frame.camera, frame)] * len(after)
    if path.turns or path.zooms:
        eyes[1:] = [_eye(frame.later(s).camera if s else frame.camera, frame) for s in after[1:]]
    blur = None if frame.lens is None else frame.blur
    room, closeup = 0.0, None
    if blur is not None:
        # As far as a flake out of focus reaches, at its own depth.
        near = max(weather.near / NEAR_FADE, 1e-3)
        far = max((one.reach * (1.0 + FADE) for one in shares), default=1.0)
        room = 0.75 * max(near * blur.circle(near), far * blur.circle(far)) / frame.camera.focal
    if weather.shape != "round" or blur is not None:
        pace = motion.clock.value(frame.t) if isinstance(motion.clock, Keys) else motion.clock
        closeup = Closeup(
            weather.shape, SWITCH, blur, frame.seed, clock[0] / fps, pace * exposure / fps
        )
    part = 0.0
    if frame.lap is not None and weather.keyed:
        # The round that goes has lost those of low ranks, which the next one shows.
        part = min(frame.lap.part(frame.t), 1.0 - 1e-9)
    swings, swung = zip(*[swing_of(weather.sway, t, fps) for t in clock], strict=True)
    ways = [share.motion.places(path, fps, times) for share in shares]
    classes = []
    for number, (share, at) in enumerate(zip(shares, ways, strict=True)):
        end = share.reach * (1.0 + FADE)
        profile, there = [], [weather.emission]
        if isinstance(weather.emission, Keys):
            there = amounts_at(weather, frame, share, np.linspace(-end, end, _HEIGHTS)).tolist()
        if wind is not None and wind.profile is not None:
            ahead = np.linspace(0.0, end, _DEPTHS)
            moved = (carried_by_profile(share.motion, path, fps, t, ahead) for t in times)
            profile = [(one[:, 0].tolist(), one[:, 1].tolist()) for one in moved]
        start = np.array(at[0])
        classes.append(Class(
            number=number, density=share.size.density * (1.0 + weather.clumps),
            sizes=(share.size.smallest, share.size.largest), slope=slope,
            shown=share.shown, by_size=weather.by_size, heights=(-end, end),
            amounts=[min(amount * one / (1.0 - part), 1.0) for one in there], ranks=(part, 1.0),
            at=at, swung=list(swung), depths=(0.0, end), profile=profile, placed=share.placed,
            waves=None if gusts is None else wave_weights(share.motion, fps, times, start),
        ))  # fmt: skip
    return Air(
        seed=frame.seed, opacity=opacity, images=images_of(opacity), classes=classes, eyes=eyes,
        sway=list(swings), waves=None if gusts is None else cycles_of(gusts),
        clumps=clumps, notes=weather.notes and weather.notes.asked(frame, times),
        shape=frame.shape,
        window=frame.window if frame.shared is None else frame.shared.window,
        room=room, near=NEAREST, closeup=closeup,
    )  # fmt: skip


def swing_of(sway: Vector, now: float, fps: float) -> tuple[float, float]:
    """Return amplitude in metres and angle in cycles when the weather's clock shows a frame."""
    if isinstance(sway, Keys):
        return sway.value(now)[0], sway.integral(now)[1] / (2.0 * math.pi * fps)
    return sway[0], sway[1] / (2.0 * math.pi * fps) * now


def amounts_at(weather: Any, frame: Frame, share: Any, heights: Float64) -> Float64:
    """Return the part of a class's flakes that is there, at heights below the eye, metres."""
    now = share.motion.now(frame.t)
    fall = max(float(value_at(share.motion.fall, now)), 1e-3)
    left = now - frame.fps * np.maximum(weather.cloud + heights, 0.0) / fall
    return np.array([weather.emission.at(time) for time in left.ravel().tolist()])


def _eye(camera: Camera, frame: Frame) -> Eye:
    turn = camera.matrix().T.tolist()
    return Eye(turn, camera.focals, camera.principal(frame.shape), camera.offset)


def images_of(opacity: float) -> _core.BallImages:
    return _images(opacity, _core.reproducible())


@kept(8)
def _images(opacity: float, mode: bool) -> _core.BallImages:
    return _core.BallImages(opacity)
