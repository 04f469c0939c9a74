"""Flakes as points in the world, for programs that draw them themselves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64
from flurries.effects.drawn import DrawnFlakes
from flurries.effects.precipitation import Precipitation
from flurries.frame.view import Frame
from flurries.motion.keys import value_at

# Frames over which a velocity is a difference of places, which are float64.
STEP = 1.0 / 1024.0


# What is known of a drawn flake; see :func:`flurries.flakes`.
FLAKE = np.dtype(
    [
        ("id", np.uint64),
        ("place", np.float64, 3),
        ("pixel", np.float64, 2),
        ("depth", np.float64),
        ("diameter", np.float64),
        ("opacity", np.float64),
    ]
)


def drawn_of(effect: Any, frame: Frame) -> npt.NDArray[Any] | None:
    """Return the flakes of an effect that are drawn one by one, of `FLAKE`; None if it draws none.

    Of a film that repeats, the effect may show an earlier round.
    """
    if hasattr(effect, "then"):
        effect, frame = effect.effect, effect.then(frame)
    parts = getattr(effect, "parts", None)
    found = []
    for part in getattr(parts, "parts", [parts]):
        if not (isinstance(part, Precipitation) and isinstance(part.front, DrawnFlakes)):
            continue
        flakes = part.front
        rows = flakes.rows(frame, float(value_at(part.amount, frame.t)))
        made = np.empty(len(rows.ids), FLAKE)
        # The camera may be beside its eyes.
        origin = frame.path.place(frame.t, fps=frame.fps)
        made["place"] = origin + rows.points @ frame.camera.matrix().T
        made["id"], made["pixel"], made["depth"] = rows.ids, rows.pixels, rows.depths
        made["diameter"] = rows.diameters
        made["opacity"] = flakes.weather.opacity_at(frame.t) * rows.shares
        found.append(made)
    return np.concatenate(found) if found else None


def velocities(now: npt.NDArray[Any], then: npt.NDArray[Any], seconds: float) -> Float64:
    """Return how fast flakes of `FLAKE` move until a moment later, (n, 3) m/s."""
    speed = np.zeros((len(now), 3))
    _, here, there = np.intersect1d(now["id"], then["id"], return_indices=True)
    speed[here] = (then["place"][there] - now["place"][here]) / seconds
    # One that is gone a moment later moves as most of them do.
    gone = np.setdiff1d(np.arange(len(now)), here)
    if len(here):
        speed[gone] = np.median(speed[here], axis=0)
    return speed


def step_after(frame: Frame, view: Any) -> Frame:
    """Return the frame a `STEP` later, seen by what `view` returns for that time."""
    t = frame.t + STEP
    return replace(frame, t=t, camera=view(t))
