"""Flakes before the eye: what a film sees of their box, the lens of the kernels, and drawing."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64
from flurries._core import SortedFlakes
from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath
from flurries.effects.motion import Motion
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.particles.crowd import Lens, Triple

# Nothing nearer than this is drawn, metres; what `particles.splat` has for a default.
NEAR = 0.1

# What the most flakes in view need behind a centred lens; a small scene must not ask for more work,
# nor for all the memory that there is for their numbers.
MOST_IN_BOX = 420_000_000


class Sight(NamedTuple):
    """The part of the air that a film sees up to a depth.

    Attributes
    ----------
    across, down : float
        Sides of the prism around the view, metres.
    ball : float
        Radius of the ball through the eye and the view's far corners, metres.
    """

    across: float
    down: float
    ball: float


def sight_of(path: CameraPath, shape: tuple[int, int], depth: float) -> Sight:
    """Return the sight of a film of a shape up to a depth.

    The path's camera counts, so that both eyes see the same flakes; and the farther side of a lens
    that is off the middle, since boxes are centred on the axis.
    """
    (height, width), lens = shape, path.widest
    cx, cy = lens.principal(shape)
    fx, fy = (depth / focal for focal in lens.focals)
    across, down = 2.0 * max(cx, width - cx) * fx, 2.0 * max(cy, height - cy) * fy
    corner = 0.25 * (across**2 + down**2)
    return Sight(across, down, max(0.5 * (depth + corner / depth), math.sqrt(corner)))


def gust_room(motion: Motion) -> float:
    """Return the distance that gusts carry flakes aside, with few exceptions, metres.

    One that is carried farther is missed at the view's border; none ever jumps, since flakes are
    faded out where the box wraps.
    """
    wind = motion.varied
    return 0.0 if wind is None or wind.waves is None else 1.5 * wind.waves.spread()


def draw_sorted(frame: Frame, flakes: SortedFlakes, numbers: Array | None = None) -> Array:
    """Return the opacity of flakes over the window; `numbers` gets those that show most."""
    top, bottom, left, right = frame.window
    result = plane((bottom - top, right - left))
    _core.particle_draw(result, flakes, frame.window, frame.depth, numbers)
    return result


def draw_numbered(
    frame: Frame, flakes: SortedFlakes, known: npt.NDArray[Any] | None
) -> tuple[Array, Array]:
    """Return the opacity of flakes, and the number of the one that each pixel shows, -1 for none.

    Of flakes that were sorted from a list `known` has the numbers of its rows.
    """
    top, bottom, left, right = frame.window
    shown = plane((bottom - top, right - left), np.int32)
    alpha = draw_sorted(frame, flakes, shown)
    return alpha, shown if known is None else np.append(known, -1).astype(np.int32)[shown]


def lens_of(camera: Camera, shape: tuple[int, int]) -> Lens:
    """Return a camera as the kernel takes it, everything as much higher as pixels are."""
    offset = triple(np.array([1.0, camera.aspect, 1.0]) * camera.offset)
    x, y = camera.principal(shape)
    return camera.focal, x, y, offset, NEAR


def triple(values: Float64) -> Triple:
    """Return three plain numbers."""
    x, y, z = values.tolist()
    return x, y, z
