"""How tiles of :func:`flurries.spectral.field` move for a camera that moves and turns."""

from __future__ import annotations

from typing import Any

import numpy as np

from flurries import _contract as check
from flurries._contract import OVERLAP, SMALLEST, TILE, ArrayLike, Float64
from flurries.camera.lens import Camera, expect_camera, rotational
from flurries.spectral.tiles import starts


def tile_drift(
    shape: tuple[int, int], displacement: ArrayLike, camera: Camera, *, near_depth: float,
    tile: int | tuple[int, int] = TILE, overlap: int = OVERLAP, out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Drift (rows, cols, 2) of tiles of :func:`flurries.spectral.field` for a moving camera.

    It is ``(Pz x - f Px, Pz y - f Py) / near_depth`` pixels, float64, (x, y) the tile's centre from
    the principal point: exact for sideways motion of any size, to first order in forward motion.

    Parameters
    ----------
    displacement : (3,)
        P, camera minus air since time 0, in camera axes, world units.
    camera : Camera
        The eye; its offset is added to P, so that a second eye is a camera moved aside.
    near_depth : float
        Depth that the longest wave stands for, world units, positive.
    tile, overlap : int
        As given to the field.
    """
    view, x, y, result = _asked(shape, camera, tile, overlap, out)
    near = check.real("near_depth", near_depth, low=SMALLEST)
    moved = check.vector("displacement", displacement, 3)
    drift_at(x, y, moved + view.offset, view.focals, result)
    result /= near
    return result


def tile_shift(
    shape: tuple[int, int], rotation: ArrayLike, camera: Camera, *,
    tile: int | tuple[int, int] = TILE, overlap: int = OVERLAP, out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Shift (rows, cols, 2) of tiles of :func:`flurries.spectral.field` for a turning camera.

    It is how far the content of the tile moves, pixels, whatever its depth, float64, with the
    tile's centre (x, y) from the principal point: ``-(f + x^2/f) wy + (x y/f) wx + y wz`` across
    and ``(f + y^2/f) wx - (x y/f) wy - x wz`` down (``docs/internals/deviations.md``, 17).

    Parameters
    ----------
    shape, camera, tile, overlap
        See :func:`tile_drift`.
    rotation : (3,)
        Radians in camera axes, right-handed (a pan to the right is +y): of a frame, or of several.
    """
    view, x, y, result = _asked(shape, camera, tile, overlap, out)
    return shift_at(x, y, check.vector("rotation", rotation, 3), view, result)


def _asked(
    shape: object, camera: object, tile: Any, overlap: Any, out: Any
) -> tuple[Camera, Float64, Float64, Float64]:
    """Return checked arguments: the eye, the middles of tiles, and the array to fill."""
    size, view = check.shape_of("shape", shape), expect_camera(camera, stretched=True)
    x, y = tile_middles(size, view, *check.tile_of(tile, overlap))
    return view, x, y, check.output(out, (len(y), len(x), 2), np.dtype(np.float64))


def tile_middles(
    shape: tuple[int, int], camera: Camera, tile: tuple[int, int], overlap: int
) -> tuple[Float64, Float64]:
    """Return the middles of tiles, px from the principal point: across, and down."""
    cx, cy = camera.principal(shape)
    across = starts(shape[1], tile[1], overlap) + tile[1] / 2 - cx
    down = starts(shape[0], tile[0], overlap) + tile[0] / 2 - cy
    return np.asarray(across, np.float64), np.asarray(down, np.float64)


def drift_at(
    x: Float64, y: Float64, displacement: Float64, focals: tuple[float, float],
    result: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Return motion times depth, px m, (y, x, 2), at places from the principal point."""
    # For a `displacement` of the eye against the air in camera axes, metres. Without a `result` to
    # be filled it is (1, 1, 2) where all places move alike.
    right, down, ahead = displacement.tolist()
    fx, fy = focals
    if result is None:
        if ahead == 0.0:
            return np.array([[[-fx * right, -fy * down]]])
        result = np.empty((len(y), len(x), 2))
    result[..., 0] = (ahead * x - fx * right)[None, :]
    result[..., 1] = (ahead * y - fy * down)[:, None]
    return result


def shift_at(x: Float64, y: Float64, rotation: Float64, camera: Camera, result: Float64) -> Float64:
    """Fill `result` (y, x, 2) with the shift of `tile_shift` at places from the principal point."""
    flow = rotational(x[None, :], y[:, None], camera.focals, rotation)
    result[..., 0], result[..., 1] = flow
    return result
