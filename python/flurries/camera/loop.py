"""A camera whose way begins again."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from flurries._contract import Float64
from flurries.camera.path import CameraPath
from flurries.camera.rotation import quaternions_of, rotation_matrix, rotation_vector
from flurries.motion.keys import Keys

Axes = tuple[bool, bool, bool]

# Metres and radians that are no difference.
_NOTHING = 1e-9


def looped_path(
    path: CameraPath, first: int, frames: int, fps: float, *, stays: Axes, tilts: bool
) -> tuple[CameraPath, list[str]]:
    """Return a path whose rates repeat those of one round, and what was changed, in words."""
    # Focal length and velocity, where keyed, end as they begin. Along the axes of `stays` the path
    # must end where it began, since something stands in the world; `tilts`: it must look the way
    # that it looked, even if it turns at one rate.
    end, bent = first + frames, []
    gone = path.place(end, fps=fps) - path.place(first, fps=fps)
    back = np.where(stays, gone, 0.0)
    far = float(np.linalg.norm(back))
    moves = path.position is not None or isinstance(path.velocity, Keys)
    closes = far > _NOTHING
    if closes:
        bent.append(
            f"camera: it ends {far:.3g} from where it began, where lamps or mist stand; its "
            f"velocity is changed by {far * fps / frames:.3g} a second"
        )
    turn = np.zeros(3)
    turning = path._turning
    if path.turns and turning is not None:
        turn = rotation_vector(turning.at(first).T @ turning.at(end))
        constant = bool((turning.rates == turning.rates[0]).all())
        if constant and not tilts:
            turn[:] = 0.0
        angle = math.degrees(float(np.linalg.norm(turn)))
        if angle > _NOTHING:
            bent.append(
                f"camera: it ends {angle:.3g} degrees from where it looked; its turning is changed "
                f"by {angle * fps / frames:.3g} degrees a second"
            )
    turned = path.turns and (float(np.abs(turn).max()) > _NOTHING or not _one_rate(path))
    if not (moves or closes or turned):
        return path, bent
    # Every frame of a round, and its keys, so that straight pieces stay straight.
    times = np.arange(float(frames) + 1.0) + first
    for keyed in (path.position, path.orientation):
        if isinstance(keyed, Keys):
            inner = [t for t, _ in keyed.keys if first < t < end]
            times = np.union1d(times, inner)
    changes: dict[str, Any] = {"extend": "on"}
    if moves or closes:

        def place(t: float, rounds: int) -> Float64:
            part = (t - first) / frames
            at = path.place(t, fps=fps)
            return np.asarray(at - part * back + rounds * (gone - back))

        changes["velocity"] = None
        changes["position"] = Keys(_rounds(times, frames, lambda t, n: tuple(place(t, n))))
    if turned:
        rig = path._turning
        assert rig is not None

        def quaternion(t: float, _: int) -> tuple[float, ...]:
            less = rotation_matrix(-(t - first) / frames * turn)
            return tuple(quaternions_of((rig.at(t) @ less)[None])[0].tolist())

        changes["orientation"] = Keys(_rounds(times, frames, quaternion))
    return replace(path, **changes), bent


def _rounds(
    times: Float64, frames: int, value: Callable[[float, int], tuple[float, ...]]
) -> list[tuple[float, tuple[float, ...]]]:
    """Return keys of the round before, this one and the next."""
    return [
        (float(t) + n * frames, tuple(float(v) for v in value(float(t), n)))
        for n in (-1, 0, 1)
        for t in times[:-1]
    ]


def _one_rate(path: CameraPath) -> bool:
    turning = path._turning
    return turning is None or bool((turning.rates == turning.rates[0]).all())
