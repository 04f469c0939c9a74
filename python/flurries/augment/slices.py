"""What falls, cut into slices of depth: how opaque, how far away and how fast each is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flurries._contract import Array, Float64
from flurries.augment.air import Air, Here, View
from flurries.augment.distance import Distances
from flurries.augment.flakes import NEAREST, Flakes

# Depths that drawn flakes are sorted into.
_SLABS = 12

# Opacities so small that those that overlap add up, to a part in ten thousand.
_THIN = 1e-4


class Slice(NamedTuple):
    """The flakes at about one depth.

    Attributes
    ----------
    opacity : (H, W) float32
    motion : (H, W, 2) or (1, 1, 2)
        Pixels (x, y) per frame.
    depth : (H, W) or (1, 1)
        Metres.
    """

    opacity: Array
    motion: Array
    depth: Array


class Labels(NamedTuple):
    """The flakes at each pixel, the nearer slices before the farther ones.

    Attributes
    ----------
    alpha : (H, W) float32
        Opacity of all that falls, without a veil.
    motion : (H, W, 2) float32
        Pixels (x, y) per frame, premultiplied with the opacity.
    nearness : (H, W) float32
        One over the depth, 1/m, premultiplied.
    most : Slice
        The slice that is densest at each pixel.
    """

    alpha: Array
    motion: Array
    nearness: Array
    most: Slice


def labels_of(
    air: Air, view: View, distances: Distances, *, time: float, fps: float, film: bool = True
) -> Labels:
    """Return the labels of the flakes before a picture, a film's frame or one by itself.

    Fog moves as the mean of its patches and is nowhere in particular.
    """
    shape = view.shape
    alpha, nearness = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    motion = np.zeros((*shape, 2), np.float32)
    most = Slice(
        np.zeros(shape, np.float32), np.zeros((*shape, 2), np.float32),
        np.full(shape, np.inf, np.float32),
    )  # fmt: skip
    if air.loss > 0.0 and air.patches is not None:
        most.motion[...] = air.patches.motion(shape, fps)
    if air.loss <= 0.0 or air.falling is None:
        return Labels(alpha, motion, nearness, most)
    here = Here(air, view, distances, time, fps if film else None)
    for part in slices(here, fps):
        weight = (1.0 - alpha) * part.opacity
        motion += weight[..., None] * part.motion
        nearness += weight / part.depth
        alpha += weight
        seen = part.opacity > most.opacity
        most.opacity[seen] = part.opacity[seen]
        most.motion[seen] = np.broadcast_to(part.motion, (*shape, 2))[seen]
        most.depth[seen] = np.broadcast_to(part.depth, shape)[seen]
    # Each layer of the texture ends at no opacity by itself, so that slices together are a little
    # denser than the picture's own sum: they are shares of that.
    whole = np.empty(shape, np.float32)
    here.join(whole)
    share = np.divide(whole, alpha, out=np.zeros(shape, np.float32), where=alpha > _THIN)
    return Labels(share * alpha, share[..., None] * motion, share * nearness, most)


def slices(here: Here, fps: float) -> list[Slice]:
    """Return all that falls, near slices first."""
    found = []
    if here.flakes is not None and len(here.flakes.points):
        flakes = here.flakes
        edges = np.geomspace(NEAREST, 1.001 * float(flakes.points[:, 2].max()), _SLABS + 1)
        slab = np.searchsorted(edges, flakes.points[:, 2], side="right")
        found += [_means(here, flakes.part(slab == k), fps) for k in np.unique(slab)]
    if here.texture is not None:
        focal, speed = here.view.camera.focal, np.asarray(here.air.velocity)
        for index, depth in enumerate(here.texture.patterns.depths.tolist()):
            plane = here.layer(here.texture, index)
            step = (speed * (focal / depth / fps)).astype(np.float32)
            near = np.minimum(np.float32(depth), here.distances.plane)
            found.append(Slice(plane, step.reshape(1, 1, 2), near))
    return found


def _means(here: Here, flakes: Flakes, fps: float) -> Slice:
    """Return drawn flakes of about one depth: their opacity, and their means by it."""
    pixels: Float64 = here.view.camera.focal / flakes.points[:, 2]
    # Drawn so thin that opacities add up, each flake as dense as its number is large.
    thin = here.drawn(flakes, scale=np.full(len(pixels), _THIN))
    means = []
    for values in (*(flakes.rates() * pixels / fps), pixels):
        low, span = float(values.min()), float(np.ptp(values)) or 1.0
        dense = here.drawn(flakes, scale=_THIN * (values - low) / span)
        share = np.divide(dense, thin, out=np.zeros_like(dense), where=thin > 0.0)
        means.append((low + span * share).astype(np.float32))
    cover = here.dense(here.drawn(flakes), flakes.times)
    cover = np.where(thin > 0.0, cover, np.float32(0.0))
    return Slice(cover, np.stack(means[:2], axis=-1), here.view.camera.focal / means[2])
