"""How the picture of a population moves at the middles of tiles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flurries._contract import Float64
from flurries.camera.tiles import shift_at
from flurries.effects.gusts import wind_at
from flurries.effects.weather import Share
from flurries.frame.view import Frame


class Flow(NamedTuple):
    """A displacement of the picture, or its change per frame.

    Attributes
    ----------
    along : (rows, cols, 2)
        Pixels times metres: over a depth it is a displacement, (x, y).
    shift : (rows, cols, 2)
        Pixels, at all depths alike.
    """

    along: Float64
    shift: Float64


def flow_of(frame: Frame, share: Share, x: Float64, y: Float64) -> tuple[Flow, Flow, float]:
    """Return the flow since frame 0 and per frame, and how far the air has come nearer, m.

    Parameters
    ----------
    x : (cols,)
    y : (rows,)
        Pixels from the principal point.
    """
    path, camera, motion = frame.path, frame.camera, share.motion
    way = motion.way(frame)
    moved = motion.travel(frame) if path.turns or path.zooms else way.moved
    rate = way.rate
    fx, fy = camera.focals
    shift = np.broadcast_to(np.array(camera.center_shift), (len(y), len(x), 2)).copy()
    shift_rate = np.zeros((len(y), len(x), 2))
    eye = np.array(camera.offset)
    if path.turns:
        rate = rate + np.cross(frame.spin(), camera.offset)
        shift += shift_at(x, y, frame.rotation(), camera, np.empty(shift.shape))
        shift_rate += shift_at(x, y, frame.spin(), camera, np.empty(shift.shape))
    if path.zooms:
        grown, grows = path.zoom(frame.t)
        places = np.stack(np.meshgrid(x, y), axis=-1)
        shift += grown * places
        shift_rate += grows * places

    def along(vector: Float64) -> Float64:
        result = np.empty((len(y), len(x), 2))
        result[..., 0] = (vector[2] * x - fx * vector[0])[None, :]
        result[..., 1] = (vector[2] * y - fy * vector[1])[:, None]
        return result

    return Flow(along(moved + eye), shift), Flow(along(rate), shift_rate), float(moved[2])


def gusts_of(
    frame: Frame, share: Share, depth: float, x: Float64, y: Float64
) -> tuple[Float64, Float64]:
    """Return what a wind that differs adds at a depth: pixels, and per frame, (rows, cols, 2)."""
    fx, fy = frame.camera.focals
    across, down = np.meshgrid(x / fx, y / fy)
    ahead = depth * np.stack([across, down, np.ones_like(across)], axis=-1)
    moved, rate = wind_at(share.motion, frame, ahead)
    focal = np.array([fx, fy]) / depth
    return moved[..., :2] * focal, rate[..., :2] * focal
