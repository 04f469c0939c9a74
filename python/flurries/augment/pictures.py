"""What pictures, clips and batches may look like, and how weather is mixed into them.

The rest of the weather is off unless asked for: dimmer light, wet ground, drops on the lens.
"""

import math
from functools import partial
from typing import Any

import numpy as np

from flurries import _contract as check
from flurries import _core
from flurries._contract import Array, _came, aligned, numbers, plane_of, rectangular, shares
from flurries._warnings import warn_of_levels
from flurries.augment.air import Here
from flurries.io.color import linear_to_srgb, srgb_to_linear

# Of the light of a clear day, the part that comes from the sky and not from the sun.
_SKY = 0.3

# The square of water's index of refraction, and what it mirrors of what it is looked straight at.
_WATER, _MIRRORED = 1.77, 0.02

# Radii of drops on the lens, and how far around themselves they show, lengths of the longer side.
_RADII, _AROUND = (0.009, 0.045), 0.35

# How odd their outlines are, by 2, 3 and 4 waves around; the part of a radius over which edges are
# soft, and of light that the rim takes; and numbers that each is drawn from.
_ODD, _SOFT, _RIM, _EACH = (0.2, 0.12, 0.07), 0.3, 0.3, 9

_STREAM = 7006

_LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)


def _shaped(name: str, value: object, first: int) -> Array:
    """Return pictures (..., H, W) or (..., H, W, 1 or 3) as they came; H is dimension `first`."""
    given = numbers(name, value)
    if 0 in given.shape:
        raise ValueError(f"{name} must not be empty, got shape {given.shape}")
    if given.ndim == first + 2 or (given.ndim == first + 3 and given.shape[-1] in (1, 3)):
        return given
    if given.ndim == 4 and not first:
        raise ValueError(
            f"{name} must be one picture, got {_came(given)}; a clip (T, H, W, C) goes to .clip, "
            "a batch (N, H, W, C) to .batch"
        )
    n, three = "N, " * first, given.ndim == first + 3 and given.shape[first] in (1, 3)
    raise ValueError(
        f"{name} must have shape ({n}H, W), ({n}H, W, 1) or ({n}H, W, 3), got {given.shape}"
        + "; channels come last" * three
    )


picture_of, stack_of = partial(_shaped, first=0), partial(_shaped, first=1)


def _mixed(given: Array, alpha: Array, color: tuple[float, ...], white: float) -> Array:
    """Return a picture under a layer of one color."""
    kept = given.dtype
    planes = given if given.ndim == 3 else given[..., None]
    planes = aligned(planes, np.float32 if kept == np.float16 else kept)
    floats = planes.dtype.kind == "f"
    if floats and white == 1.0:
        warn_of_levels("image", planes, "give the transform white=255")
    if planes.shape[2] == 1:
        color = (0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2],)
    light = [c * (white if floats else 1.0) for c in color]
    result: Array = np.empty(planes.shape, planes.dtype)
    kind = np.float64 if planes.dtype == np.float64 else np.float32
    _core.snow(result, planes, aligned(alpha, kind), light)
    if kept != result.dtype:
        with np.errstate(over="ignore"):
            result = result.astype(kept)
    return result.reshape(given.shape)


def layer_of(alpha: Array, color: tuple[float, ...]) -> Array:
    """Return (..., 4) float32: a color, premultiplied with an opacity."""
    layer = np.empty((*alpha.shape, 4), np.float32)
    np.multiply(alpha[..., None], np.asarray(color, np.float32), out=layer[..., :3])
    layer[..., 3] = alpha
    return layer


def in_weather(
    given: Array, alpha: Array, here: Here, record: dict[str, Any], wet: Any, horizon: float
) -> Array:
    """Return a picture in its weather, in its own dtype; never written to."""
    color, white, shade = record["color"], record["white"], record["shade"]
    if wet is None and shade == record["drops"] == 0.0:
        return _mixed(given, alpha, color, white)
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
    if drops := round(record["drops"]):
        eye = int(here.view.aside > 0.0)
        _drop(display, check.uniforms(record["weather_seed"] ^ eye, _STREAM, _EACH * drops))
    result = display.reshape(given.shape) * whole
    rounded = np.rint(result) if given.dtype.kind == "u" else result
    return np.asarray(rounded, given.dtype)


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
    """Put drops before a picture that show what is around them upside down and blurred."""
    (height, width), longer = display.shape[:2], float(max(display.shape[:2]))
    size, means = np.array((height, width)), _means(display, 24)
    each = numbers.reshape(-1, _EACH)
    middles, radii = each[:, :2] * size, longer * (_RADII[0] + np.ptp(_RADII) * each[:, 2] ** 3)
    # All pixels that may show a drop, one drop after the other.
    reach = (radii * (1.0 + 1.5 * sum(_ODD)))[:, None]
    first, last = (np.clip(np.ceil(middles + s * reach), 0, size).astype(int) for s in (-1, 1))
    sides = last - first
    counts = sides.prod(axis=1)
    drop = np.repeat(np.arange(len(each)), counts)
    number = np.arange(len(drop)) - np.repeat(np.cumsum(counts) - counts, counts)
    at = first[drop] + np.stack(np.divmod(number, sides[drop, 1]), axis=1)
    away = at + 0.5 - middles[drop]
    angle = np.arctan2(away[:, 1], away[:, 0])[:, None] * (2.0, 3.0, 4.0)
    along, aside = 2.0 * each[:, 3:].reshape(-1, 2, 3).swapaxes(0, 1) - 1.0
    odd = (along[drop] * np.cos(angle) + aside[drop] * np.sin(angle)) @ _ODD
    far = np.linalg.norm(away, axis=1) / (radii[drop] * (1.0 + odd))
    # Of drops that touch a pixel shows the one that it is deepest in: the last that is written.
    order, shown = np.argsort(-far), np.full(height * width, -1)
    order = order[far[order] < 1.0]
    shown[at[order, 0] * width + at[order, 1]] = order
    (pixels,) = np.nonzero(shown >= 0)
    own = shown[pixels]
    far, away, drop = far[own, None], away[own], drop[own]
    around = middles[drop] - away * (_AROUND * longer / radii[drop, None])
    seen = _at(means, around * (np.array(means.shape[:2]) / size))
    # Its rim turns light away; its edge is far out of focus.
    seen *= 1.0 - _RIM * far**4
    soft = np.clip((1.0 - far) / np.maximum(_SOFT, 1.5 / radii[drop, None]), 0.0, 1.0)
    below = display.reshape(-1, display.shape[2])
    below[pixels] += soft**2 * (3.0 - 2.0 * soft) * (seen - below[pixels])


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
