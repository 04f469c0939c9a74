"""Two eyes: a second eye is the camera moved aside, for the texture and the flakes alike."""

from __future__ import annotations

from dataclasses import replace

from flurries._contract import real
from flurries.camera import Camera, expect_camera

__all__ = ["eyes"]


def eyes(
    camera: Camera, *, distance: float, convergence: float | None = None
) -> tuple[Camera, Camera]:
    """Return the left and the right eye of a camera.

    Parameters
    ----------
    camera : Camera
        What stands between them.
    distance : float
        From eye to eye, world units, 0 or more; people's are 0.065 m apart.
    convergence : float, optional
        Depth in world units that both eyes see at one place of the picture; nearer things come out
        of it. If not given the eyes look straight ahead and infinity is there.

    Returns
    -------
    left, right : Camera
        `offset` less and more by half the distance along x, and `center_shift` by
        ``focal distance / (2 convergence)`` px the other way: a point at depth Z is seen
        ``focal distance (1/Z - 1/convergence)`` px farther left by the right eye than by the left.

    Raises
    ------
    ValueError, TypeError
        For a negative distance, a convergence that is not positive, or what is no camera.

    Examples
    --------
    >>> import flurries as fl
    >>> left, right = fl.stereo.eyes(fl.Camera(1200.0), distance=0.065, convergence=3.0)
    >>> left.offset, right.center_shift
    ((-0.0325, 0.0, 0.0), (13.0, 0.0))
    """
    middle = expect_camera(camera)
    half = 0.5 * real("distance", distance, low=0.0)
    shift = 0.0
    if convergence is not None:
        shift = middle.focal * half / real("convergence", convergence, above=0.0)
    x, y, z = middle.offset
    cx, cy = middle.center_shift
    left, right = (
        replace(middle, offset=(x + side * half, y, z), center_shift=(cx + side * shift, cy))
        for side in (-1.0, 1.0)
    )
    return left, right
