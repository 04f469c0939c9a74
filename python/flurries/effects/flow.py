"""How the picture of what falls moves at places: with its depth, and at all depths alike."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flurries._contract import Float64
from flurries.camera.tiles import drift_at, shift_at
from flurries.effects.motion import Motion, Way
from flurries.frame.view import Frame

_STILL = np.zeros((1, 1, 2))


class Flow(NamedTuple):
    """A displacement of the picture, or its change per frame.

    Attributes
    ----------
    along : (rows, cols, 2), or (1, 1, 2) where all places move alike
        Pixels times metres: over a depth it is a displacement, (x, y).
    shift : the same
        Pixels, at all depths alike.
    """

    along: Float64
    shift: Float64


def flow_of(frame: Frame, motion: Motion, way: Way, x: Float64, y: Float64) -> tuple[Flow, Flow]:
    """Return the flow since frame 0 and per frame.

    Parameters
    ----------
    way : Way
        Of the frame by that motion.
    x : (cols,)
    y : (rows,)
        Pixels from the principal point.
    """
    path, camera = frame.path, frame.camera
    turns, zooms = path.turns, path.zooms
    moved = motion.travel(frame) if turns or zooms else way.moved
    rate, shift, shift_rate = way.rate, np.array(camera.center_shift).reshape(1, 1, 2), _STILL
    if turns:
        # An eye beside the axis is carried round it; its place in the air stays that of the camera
        # plus the offset, so that two eyes keep their disparities.
        rate = rate + np.cross(frame.spin(), camera.offset)
        turned, turning = (
            shift_at(x, y, angle, camera, np.empty((len(y), len(x), 2)))
            for angle in (frame.rotation(), frame.spin())
        )
        shift, shift_rate = shift + turned, shift_rate + turning
    if zooms:
        grown, grows = path.zoom(frame.t)
        places = np.stack(np.meshgrid(x, y), axis=-1)
        shift, shift_rate = shift + grown * places, shift_rate + grows * places
    focals = camera.focals
    gone = Flow(drift_at(x, y, moved + camera.offset, focals), shift)
    return gone, Flow(drift_at(x, y, rate, focals), shift_rate)
