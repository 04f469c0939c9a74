"""Depths and mattes of a frame that is larger than its display window."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flurries._contract import Array

# (left, top, width, height), px.
Display = tuple[int, int, int, int]


def placed(
    plane: Array,
    own: Display | None,
    shape: tuple[int, int],
    display: Display | None,
    fitted: Callable[[Array, tuple[int, int]], Array],
    outside: float,
) -> Array:
    """Return a plane of a depth or a matte, with the overscan that its file has, for the frame."""
    # `own` is the display window in the plane and `display` that in the frame, None where it is
    # all; `fitted` brings a plane to a (width, height), and `outside` stands beside the display
    # window where the plane has none.
    if plane.shape[:2] == shape:
        return plane
    if own is not None:
        left, top, width, height = own
        plane = np.ascontiguousarray(plane[top : top + height, left : left + width])
    if display is None:
        return fitted(plane, shape[::-1])
    left, top, width, height = display
    inner = plane if plane.shape[:2] == (height, width) else fitted(plane, (width, height))
    whole = np.full((*shape, *inner.shape[2:]), outside, inner.dtype)
    whole[top : top + height, left : left + width] = inner
    return whole
