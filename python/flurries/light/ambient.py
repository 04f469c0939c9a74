"""The light of a place, as its picture tells it."""

from __future__ import annotations

import numpy as np

from flurries._contract import Array
from flurries.io.color import linear_to_srgb
from flurries.light.plate import cell_sums

# What pictures reflect on average, the grey of exposure meters; and fresh snow.
_GREY, _SNOW = 0.18, 0.9
# A black picture is none: snow on it is meant to be laid over one later.
_BLACK = 1.0, 1.0, 1.0
# What the most saturated color counts for the tint, so that a picture of one color has one.
_LEAST = 1e-6


def ambient_light(picture: Array, encoding: str) -> tuple[float, float, float]:
    """Return the brightness (r, g, b) of white snow in the light of a picture (H, W, 3 or 4)."""
    # Display values, 0 to 1. The ambient color of Langer 2003's slides, which do not say where it
    # comes from: as bright as the mean of the linear light over 0.18, which is what pictures
    # reflect on average, times 0.9, what snow does; of the tint of what is nearly grey; lowered in
    # one proportion to 1 at most, or in linear light to 0.9 of its brightest twentieth where that
    # is more. White for a picture that is black all over. What is not finite does not count, and
    # what is transparent as far as it shows.
    # Each part of the picture (1/96 of its longer side) counts for the tint by its least channel
    # over its largest: a red coat is no red light, and grey ground shows the light's own color.
    sums = np.maximum(cell_sums(picture, encoding)[0].reshape(-1, 4), 0.0).astype(np.float64)
    light, cover = sums[:, :3], sums[:, 3]
    if not cover.any() or not light.any():
        return _BLACK
    mean = light.sum(axis=0) / cover.sum()
    grey = light.min(axis=1) / np.maximum(light.max(axis=1), np.finfo(np.float32).tiny)
    tint = (grey + _LEAST) @ light
    white = tint * (float(mean.sum() / tint.sum()) * _SNOW / _GREY)
    most = 1.0
    if encoding == "linear":
        # Light has no end at paper white: before a sky of 5 snow is not grey.
        shown = light[cover > 0.0] / cover[cover > 0.0, None]
        most = max(most, _SNOW * float(np.quantile(shown, 0.95)))
    red, green, blue = linear_to_srgb(white / max(float(white.max()) / most, 1.0)).tolist()
    return red, green, blue
