"""Flakes as points in the world, for programs that draw them themselves."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64
from flurries.effects.crowd import DrawnFlakes
from flurries.effects.precipitation import Precipitation
from flurries.frame.view import Frame
from flurries.motion.keys import value_at

# A radius of `particles.splat` over the diameter of the flake.
_RADIUS_OF_DIAMETER = 3.0 / math.sqrt(8.0)

# Frames over which a velocity is a difference of places, which are float64.
_STEP = 1.0 / 1024.0

# Numbers of different populations, and of near and far flakes, are so far apart.
_APART = 2**40


@dataclass(frozen=True, eq=False)
class Points:
    """Flakes in view.

    Attributes
    ----------
    places : (n, 3) float64
        House axes, metres from the camera's place at frame 0.
    velocities : (n, 3) float64
        Metres per second.
    widths : (n,) float64
        Diameters, metres.
    opacities : (n,) float64
        Of a flake's middle where nothing blurs it.
    ids : (n,) int64
        The same in every frame.
    """

    places: Float64
    velocities: Float64
    widths: Float64
    opacities: Float64
    ids: npt.NDArray[np.int64]


def points_of(effect: Any, frame: Frame, later: Frame) -> Points | None:
    """Return the flakes of an effect that are drawn one by one; None if it has no population.

    Parameters
    ----------
    effect : object
        Snow or rain.
    frame, later : Frame
        The frame, and the same a `_STEP` later.
    """
    parts = getattr(effect, "parts", None)
    found = []
    for number, part in enumerate(getattr(parts, "parts", [parts])):
        if isinstance(part, Precipitation) and isinstance(part.flakes, DrawnFlakes):
            found.append(_points(part, part.flakes, frame, later, 2 * number * _APART))
    if not found:
        return None
    names = ("places", "velocities", "widths", "opacities", "ids")
    return Points(*(np.concatenate([getattr(one, name) for one in found]) for name in names))


def step_after(frame: Frame, view: Any) -> Frame:
    """Return the frame a `_STEP` later, seen by what `view` returns for that time."""
    t = frame.t + _STEP
    return replace(frame, t=t, camera=view(t))


def _points(
    part: Precipitation[Any], flakes: DrawnFlakes, frame: Frame, later: Frame, first: int
) -> Points:
    now, then = (_in_world(flakes, one, _amount(part, one), first) for one in (frame, later))
    speed = _velocities(now, then, later.t - frame.t) * frame.fps
    return Points(now[0], speed, now[1] / _RADIUS_OF_DIAMETER, now[2], now[3])


def _amount(part: Precipitation[Any], frame: Frame) -> float:
    return float(value_at(part.amount, frame.t))


def _in_world(
    flakes: DrawnFlakes, frame: Frame, amount: float, first: int
) -> tuple[Float64, Float64, Float64, npt.NDArray[np.int64]]:
    """Return places, radii, opacities and numbers, in the order of the numbers."""
    listed = [flakes.listed(frame, amount)]
    if flakes.weather.simulated:
        listed.append(flakes.listed(frame, amount, beyond=True))
    high = np.array([1.0, frame.camera.aspect, 1.0])
    origin = frame.path.place(frame.t, fps=frame.fps)
    # A flake's place is from the camera itself, of which an eye may be beside.
    places = origin + np.concatenate([one[0] for one in listed]) / high @ frame.camera.matrix().T
    ids = [first + number * _APART + one[4] for number, one in enumerate(listed)]
    radii, opacities = (np.concatenate([one[column] for one in listed]) for column in (1, 2))
    numbers = np.concatenate(ids)
    order = np.argsort(numbers, kind="stable")
    return places[order], radii[order], opacities[order], numbers[order]


def _velocities(now: Any, then: Any, step: float) -> Float64:
    """Return metres per frame; of flakes that are not seen at both times those of a neighbour."""
    places, _, _, ids = now
    if len(then[3]) == 0 or len(ids) == 0:
        return np.zeros_like(places)
    at = np.minimum(np.searchsorted(then[3], ids), len(then[3]) - 1)
    speed: Float64 = (then[0][at] - places) / step
    # Not there a moment later, or at the other side of its box.
    lost = then[3][at] != ids
    usual = np.median(speed[~lost], axis=0) if not lost.all() else np.zeros(3)
    lost |= np.abs(speed - usual).max(axis=1) * step > 1.0
    known = np.flatnonzero(~lost)
    if len(known) == 0:
        return np.zeros_like(places)
    near = known[np.minimum(np.searchsorted(known, np.flatnonzero(lost)), len(known) - 1)]
    speed[lost] = speed[near]
    return speed
