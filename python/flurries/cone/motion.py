"""The motion of precipitation against the camera (Wang 2004, Eq. 1): corrected, and as printed."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64, flag, moderate, real, table

__all__ = ["travel"]

# t_const of Eq. 3, seconds.
FRAME = 1.0 / 30.0


def travel(
    drop: npt.ArrayLike,
    camera: npt.ArrayLike = (0.0, 0.0, 0.0),
    *,
    damping: float = 1.0,
    published: bool = False,
    dt: npt.ArrayLike = FRAME,
) -> Float64:
    """Return the motion of precipitation relative to the camera (Eq. 1).

    Parameters
    ----------
    drop, camera : (3,) or (n, 3)
        Velocities, metres per second, house axes.
    damping : float
        C_f, how much of the camera's motion tilts the cone, 0 to 1.
    published : bool
        As printed: ``(C_f camera + drop) dt``. Its sign turns the cone away from the focus of
        expansion, and a paused clock leaves no direction.
    dt : float or (n,)
        t_delta, seconds since the last frame; used by the printed form only.

    Returns
    -------
    (3,) or (n, 3) float64
        ``drop - C_f camera``, metres per second: with damping 1 the velocity of a drop that the
        camera sees. As printed, metres per frame.
    """
    fallen, moved = _vectors("drop", drop), _vectors("camera", camera)
    share = real("damping", damping, low=0.0, high=1.0)
    step = _steps(dt)
    if not flag("published", published):
        _alike(drop=fallen[..., 0], camera=moved[..., 0])
        return np.asarray(fallen - share * moved)
    _alike(drop=fallen[..., 0], camera=moved[..., 0], dt=step)
    return np.asarray((share * moved + fallen) * (step[..., None] if step.ndim else step))


def _vectors(name: str, value: Any) -> Float64:
    given = table(name, value, ndim=None)
    if given.ndim not in (1, 2) or given.shape[-1] != 3:
        raise ValueError(f"{name} must be (3,) or (n, 3), got shape {given.shape}")
    return moderate(name, given)


def _numbers(name: str, value: Any) -> Float64:
    """Return one number or a row of them, as float64."""
    given: Float64 = moderate(name, table(name, value, ndim=None)).reshape(np.shape(value))
    if given.ndim > 1:
        raise ValueError(f"{name} must be one number or (n,), got shape {given.shape}")
    return given


def _alike(**numbers: Float64) -> None:
    """Refuse rows of different lengths."""
    try:
        np.broadcast_shapes(*(given.shape for given in numbers.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {given.shape}" for name, given in numbers.items())
        raise ValueError(f"{', '.join(numbers)} must be alike in length, got {shapes}") from None


def _steps(dt: npt.ArrayLike) -> Float64:
    step = _numbers("dt", dt)
    if not (step >= 0.0).all():
        raise ValueError(f"dt must be seconds, none negative, got {step.min()}")
    return step
