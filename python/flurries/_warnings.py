"""Warnings of input that is taken and hardly meant: levels for light, depths in no metres."""

import sys
import warnings

import numpy as np

from flurries._contract import Array

# Of a picture so many rows and columns are looked at; brighter light than this is rare.
_SAMPLES = 256
# One in so many of them, and across: some say enough.
_FEW = 16
_LARGEST_LIGHT = 16.0

# Colors outside a plate's primaries are a little below 0, and few: more is no light.
_DARKEST = 0.1
_MOST_BELOW = 0.1

# Depths beyond the first and up to the second are those of millimetres in 16 bits.
_FARTHEST_NEAR = 200.0
_MOST_MILLIMETRES = 65535.0


def warn(message: str) -> None:
    """Warn the first caller outside this package."""
    frame, level = sys._getframe(0), 1
    # A script's frames have no package: theirs is None.
    while frame.f_back and str(frame.f_globals.get("__package__")).startswith("flurries"):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, UserWarning, stacklevel=level)


def warn_of_levels(name: str, picture: Array, advice: str) -> None:
    """Warn of a float picture that holds levels up to 255 where 1 is white, or was normalized."""
    # Weather over the first would be nearly black. Judged by an even sample: its largest number is
    # above 16 and no more than 255, and its mean above 1, as that of no picture of light is but in
    # bright sun.
    if picture.dtype.kind != "f" or not picture.size:
        return
    rows, columns = (max(length // _SAMPLES, 1) for length in picture.shape[:2])
    sample = np.asarray(picture[::rows, ::columns], np.float64)
    with np.errstate(invalid="ignore"):
        top, mean = float(sample.max()), float(sample.mean())
        below = float((sample < -_DARKEST).mean())
    if _LARGEST_LIGHT < top <= 255.0 and mean > 1.0:
        warn(
            f"{name} is a float picture of values up to {top:g}, and its white is taken as 1; "
            f"{advice} if that is its white"
        )
    elif below > _MOST_BELOW and top <= _LARGEST_LIGHT:
        warn(
            f"{name} is below 0 in {below:.0%} of its values, as pictures that were normalized "
            "for a network are; weather comes before that"
        )


def warn_of_units(name: str, plane: Array) -> None:
    """Warn of depths that are hardly metres: all within 1, or all some hundreds or more."""
    # The first are inverse depths or greys, as networks that see in one picture give them; the
    # others are millimetres. Both are silent otherwise: weather is nowhere, or everywhere alike.
    if plane.size and 1.0 < plane.item(plane.size // 2) <= _FARTHEST_NEAR:
        return  # One says enough.
    rows, columns = (max(length // _SAMPLES, 1) for length in plane.shape)
    sample = plane[::rows, ::columns]
    few = sample[::_FEW, ::_FEW]
    if ((few > 1.0) & (few <= _FARTHEST_NEAR)).any():
        return
    if not sample.min(initial=1.0) > 0.0:
        sample = sample[sample > 0.0]  # Others are holes.
    near, far = float(sample.min(initial=np.inf)), float(sample.max(initial=0.0))
    if far < 2.0 * near or far == np.inf:
        return
    if far <= 1.0:
        message = "nothing is farther than 1 m; flurries.scene.DepthMap makes depth of greys"
    elif near > _FARTHEST_NEAR and far <= _MOST_MILLIMETRES:
        message = f"nothing is nearer than {_FARTHEST_NEAR:g} m; divide millimetres by 1000"
    else:
        return
    # Without numbers of the frame: a sequence is warned of once.
    warn(f"{name} is taken as metres: {message}")
