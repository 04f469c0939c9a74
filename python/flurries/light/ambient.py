"""The light of a place, as its picture tells it."""

from __future__ import annotations

import numpy as np

from flurries._contract import Array
from flurries.io.color import decoding_table, linear_to_srgb, to_linear, to_unit

# What pictures reflect on average, the grey of exposure meters; and fresh snow.
_GREY, _SNOW = 0.18, 0.9
# A black picture is none: snow on it is meant to be laid over one later.
_BLACK = 1.0, 1.0, 1.0


def ambient_light(picture: Array, encoding: str) -> tuple[float, float, float]:
    """Return how bright white snow is in the light that a picture was taken in.

    Parameters
    ----------
    picture : (H, W, 3 or 4)
        Of a background's dtype; what is transparent counts as far as it shows.
    encoding : {"display", "linear"}
        What its numbers mean.

    Returns
    -------
    (r, g, b)
        Display values, 0 to 1: the mean of the linear light over 0.18, which is what pictures
        reflect on average, times 0.9, what snow does; lowered in one proportion to 1 at most, or in
        linear light to 0.9 of its brightest twentieth where that is more. What is not finite does
        not count. White for a picture that is black all over.

    Notes
    -----
    The ambient color of Langer 2003's slides, which do not say where it comes from.
    """
    if encoding == "display" and picture.dtype.kind == "u" and picture.shape[2] == 3:
        return _of_snow(_mean_of_levels(picture), 1.0)
    light = to_linear(picture[..., :3], encoding)
    whole = 1.0
    if picture.shape[2] == 4:
        cover = to_unit(picture[..., 3:])
        light, whole = light * cover if picture.dtype.kind == "u" else light, float(cover.mean())
    light = light.reshape(-1, 3)
    light = light[np.isfinite(light).all(axis=1)]
    if len(light) == 0 or whole == 0.0 or not light.any():
        return _BLACK
    most = 1.0
    if encoding == "linear":
        # Light has no end at paper white: before a sky of 5 snow is not grey.
        most = max(most, _SNOW * float(np.quantile(light[:: max(len(light) // 65536, 1)], 0.95)))
    return _of_snow(light.mean(axis=0, dtype=np.float64) / whole, most)


def _of_snow(mean: Array, most: float) -> tuple[float, float, float]:
    """Return the color of snow in light of that mean, at most so bright."""
    if not mean.any():
        return _BLACK
    white = np.maximum(mean, 0.0) * (_SNOW / _GREY)
    red, green, blue = linear_to_srgb(white / max(float(white.max()) / most, 1.0)).tolist()
    return red, green, blue


def _mean_of_levels(picture: Array) -> Array:
    """Return the mean linear light of integers: how often each occurs says all, (3,)."""
    table = decoding_table(picture.dtype.itemsize).astype(np.float64)
    counts = [np.bincount(picture[..., c].ravel(), minlength=len(table)) for c in range(3)]
    mean: Array = np.multiply(counts, table).sum(axis=1) / max(picture[..., 0].size, 1)
    return mean
