"""Tilt, elongation and scroll of the double cone: corrected, and as printed (Wang 2004, Eqs. 1-3).

The printed forms are kept with their defects, which the tests show one by one; nothing else in the
package uses them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import Float64, flag, moderate, real, table

__all__ = ["elongation", "scroll", "travel"]

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


def elongation(
    speed: npt.ArrayLike,
    *,
    exposure: float = 1.0 / 60.0,
    length: float = 0.02,
    published: bool = False,
    pixel: float = 1.0,
    scale: float = 1.0,
) -> Float64:
    """Return the length of a drop's streak over that of the drop (Eq. 2).

    Parameters
    ----------
    speed : float or (n,)
        Speed of the drops relative to the camera, metres per second; the sign does not matter. As
        printed: the length of Vec, metres per frame.
    exposure : float
        Seconds, 0 or more.
    length : float
        Length of a drop, metres, more than 0. As printed: S_streak, pixels.
    published : bool
        As printed: ``1 / (S_f E) = 1 + C S_f |Vec| / S_streak``: depends on the frame rate, makes
        far streaks shorter than perspective does, and a larger S_streak gives shorter streaks.
    pixel, scale : float
        C_pixel, pixels per metre, and S_f, the layer's scale; used by the printed form only.

    Returns
    -------
    () or (n,) float64
        ``1 + |speed| exposure / length``, 1 or more.
    """
    pace = np.abs(_numbers("speed", speed))
    drop = real("length", length, above=0.0)
    if not flag("published", published):
        return np.asarray(1.0 + pace * (real("exposure", exposure, low=0.0) / drop))
    factor = real("pixel", pixel, above=0.0) * real("scale", scale, above=0.0)
    return np.asarray(1.0 + factor * pace / drop)


def scroll(
    speed: npt.ArrayLike,
    dt: npt.ArrayLike,
    *,
    stretch: npt.ArrayLike = 1.0,
    tile: float = 1.0,
    published: bool = False,
    streak: float = 8.0,
    pixel: float = 1.0,
    scale: float = 1.0,
) -> Float64:
    """Return the distance that the texture moves in a time (Eq. 3).

    Parameters
    ----------
    speed : float or (n,)
        Of the drops relative to the camera, metres per second, negative against the axis. As
        printed: the length of Vec, metres per frame.
    dt : float or (n,)
        Seconds.
    stretch : float or (n,)
        L, from :func:`elongation`.
    tile : float
        Metres that one tile of the first layer stands for: ``2 pi radius / repeats``.
    published : bool
        As printed: ``D / E`` with ``D = S_streak t_delta / t_const``, in pixels on the screen. It
        depends on the frame rate and not on how fast anything falls.
    streak, pixel, scale : float
        S_streak (pixels), C_pixel (pixels per metre) and S_f; used by the printed form only.

    Returns
    -------
    () or (n,) float64
        ``speed dt / (tile stretch)``, tiles; the same for all layers, which are farther by as much
        as they are smaller.
    """
    pace, step = _numbers("speed", speed), _steps(dt)
    if not flag("published", published):
        longer = _numbers("stretch", stretch)
        if not (longer > 0.0).all():
            raise ValueError(f"stretch must be positive, got {longer.min()}")
        _alike(speed=pace, dt=step, stretch=longer)
        return np.asarray(pace * step / (real("tile", tile, above=0.0) * longer))
    drop, size = real("streak", streak, above=0.0), real("scale", scale, above=0.0)
    _alike(speed=pace, dt=step)
    moved = drop * step / FRAME
    longer = elongation(pace, length=drop, published=True, pixel=pixel, scale=size)
    return np.asarray(moved * size * longer)


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
