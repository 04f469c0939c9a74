"""The rest of the weather, off unless asked for: dimmer light, wet ground, drops on the lens."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flurries._contract import Array, plane_of, rectangular, shares
from flurries.augment.air import Here, uniforms
from flurries.io.color import linear_to_srgb, srgb_to_linear

# Of the light of a clear day, the part that comes from the sky and not from the sun.
_SKY = 0.3

# The square of water's index of refraction, and what it mirrors of what it is looked straight at.
_WATER, _MIRRORED = 1.77, 0.02

# Radii of drops on the lens, and how far around themselves they show, lengths of the longer side.
_RADII, _AROUND = (0.008, 0.035), 0.35

_STREAM = 7006

_LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)


def seen(
    given: Array, alpha: Array, here: Here, record: dict[str, Any], wet: Any, horizon: float
) -> Array:
    """Return a picture in its weather, in its own dtype."""
    color, white = record["color"], record["white"]
    shade, drops = record["shade"], round(record["drops"])
    whole = np.iinfo(given.dtype).max if given.dtype.kind == "u" else white
    planes = given.reshape(*given.shape[:2], -1)
    display = planes.astype(np.float32) / np.float32(whole)
    if wet is not None or shade > 0.0:
        light = srgb_to_linear(display)
        if wet is not None:
            light = _wetted(light, wet, horizon * len(light), here.view.focal)
        if shade > 0.0:
            light = _shaded(light, math.exp(-shade * here.extinction))
        display = linear_to_srgb(light)
    tint = np.array(color if planes.shape[2] == 3 else [_LUMA @ color], np.float32)
    display += alpha[..., None] * (tint - display)
    if drops:
        eye = int(here.view.aside > 0.0)
        _drop(display, uniforms(record["weather_seed"] ^ eye, _STREAM, 3 * drops))
    result = display.reshape(given.shape) * whole
    rounded = np.rint(result) if given.dtype.kind == "u" else result
    return np.asarray(rounded, given.dtype.newbyteorder("="))


def _shaded(light: Array, sun: float) -> Array:
    """Return light of which a part of the sun's is left: dimmer, with half of its shadows."""
    luma = light @ _LUMA if light.shape[2] == 3 else light[..., 0]
    means, size = _means(luma, 16), luma.shape
    places = (np.moveaxis(np.mgrid[: size[0], : size[1]], 0, -1) + 0.5) / size * means.shape
    smooth = _at(means[..., None], places)[..., 0].astype(np.float32)
    # What varies slowly is half the light's doing and half that of what it lies on.
    flat = (smooth.mean() / np.maximum(smooth, 1e-4)) ** (0.5 * (1.0 - sun))
    return np.asarray(light * (flat * (_SKY + (1.0 - _SKY) * sun))[..., None])


def _wetted(light: Array, wet: Any, horizon: float, focal: float) -> Array:
    """Return light of ground under water: darker, and a mirror of what is above the horizon."""
    share = rectangular("wet", wet)
    share = plane_of("wet", share * 1.0 if share.dtype == bool else share, light.shape[:2])
    shares("wet", share)
    rows = np.arange(len(light))
    below = np.maximum(rows + 0.5 - horizon, 0.0)
    # Angstrom (1925): what a wet ground sends back, its water turns back in part.
    dark = np.where(light < 1.0, light / (light + _WATER * (1.0 - light)), light)
    # Fresnel's law, by Schlick.
    mirror = _MIRRORED + (1.0 - _MIRRORED) * (1.0 - below / np.hypot(below, focal)) ** 5
    mirror = mirror[:, None, None].astype(np.float32)
    # What stands above the picture is taken for what is below its upper edge.
    flipped = light[np.minimum(np.abs(np.rint(2.0 * horizon - 1.0 - rows)).astype(int), rows[-1])]
    share = (share * (below > 0.0)[:, None])[..., None]
    return np.asarray(light + share * ((1.0 - mirror) * dark + mirror * flipped - light))


def _drop(display: Array, numbers: Array) -> None:
    """Put discs before a picture that show what is around them upside down and blurred."""
    size = np.array(display.shape[:2])
    longer = float(size.max())
    means = _means(display, 48)
    scale = np.array(means.shape[:2]) / size
    for *place, large in numbers.reshape(-1, 3):
        radius = longer * (_RADII[0] + (_RADII[1] - _RADII[0]) * large**3)
        middle = np.array(place) * size
        first, last = (np.clip(np.ceil(middle + s * radius), 0, size).astype(int) for s in (-1, 1))
        part = tuple(map(slice, first, last))
        away = np.moveaxis(np.mgrid[part], 0, -1) + 0.5 - middle
        far = np.linalg.norm(away, axis=-1, keepdims=True) / radius
        shown = _at(means, (middle - away * (_AROUND * longer / radius)) * scale)
        # Its rim turns light away; its edge is soft over a pixel and a half.
        shown *= 1.0 - 0.6 * np.minimum(far, 1.0) ** 6
        cover = np.clip((1.0 - far) * radius / 1.5, 0.0, 1.0)
        display[part] += cover * (shown - display[part])


def _means(plane: Array, cells: int) -> Array:
    """Return the means of a picture over so many equal cells of its longer side, or fewer."""
    step = max(-(-max(plane.shape[:2]) // cells), 1)
    edges = [np.arange(0, length, step) for length in plane.shape[:2]]
    sums = np.add.reduceat(np.add.reduceat(plane, edges[0], axis=0), edges[1], axis=1)
    counts = [np.diff([*edge, n]) for edge, n in zip(edges, plane.shape, strict=False)]
    return sums / np.outer(*counts).reshape(*sums.shape[:2], *[1] * (plane.ndim - 2))


def _at(plane: Array, places: Array) -> Array:
    """Return a picture between its pixels, at (y, x) whose middles of pixels are halves."""
    ends = np.array(plane.shape[:2]) - 1
    inside = np.clip(places - 0.5, 0.0, ends)
    low = np.minimum(inside.astype(int), np.maximum(ends - 1, 0))
    y, x = np.moveaxis(inside - low, -1, 0)[..., None]
    (i, j), (k, m) = np.moveaxis(low, -1, 0), np.moveaxis(np.minimum(low + 1, ends), -1, 0)
    top = plane[i, j] * (1.0 - x) + plane[i, m] * x
    return np.asarray(top * (1.0 - y) + (plane[k, j] * (1.0 - x) + plane[k, m] * x) * y)
