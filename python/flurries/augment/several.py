"""More than one picture in a weather: the frames of a film, a batch, and both eyes' views."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import Array, flag, rate_of, real
from flurries.augment.air import Here
from flurries.augment.distance import Depth
from flurries.augment.draws import index_of
from flurries.augment.labels import layer_of
from flurries.augment.pictures import mixed, picture_of, stack_of
from flurries.augment.record import Recorded


class Several(Recorded):
    """Weather of films, batches and pairs."""

    def clip(
        self,
        frames: npt.ArrayLike,
        *,
        index: int | None = None,
        fps: float = 30.0,
        time: float = 0.0,
        depth: Depth = None,
        return_layer: bool = False,
    ) -> Any:
        """Return the frames of one film in one weather that moves.

        Parameters
        ----------
        frames : (T, H, W) or (T, H, W, 1 or 3)
            As `image` of a call.
        index, return_layer
            As for a call.
        fps : float
            Frames per second.
        time : float
            Seconds at the first frame.
        depth : as for a call, or (T, H, W), optional
            For all frames, or of each.

        Returns
        -------
        array of the shape and dtype of `frames`
            Or with `return_layer` that and the layers, (T, H, W, 4) float32.
        """
        given = stack_of("frames", frames)
        rate = rate_of(fps)
        start = real("time", time, low=-1e9, high=1e9)
        records = [self._drawn(given[0], index)] * len(given)
        times = [start + number / rate for number in range(len(given))]
        return self._stacked(given, records, depth, return_layer, times, rate)

    def batch(
        self,
        images: npt.ArrayLike,
        *,
        index: int | Sequence[int] | None = None,
        depth: Depth = None,
        return_layer: bool = False,
    ) -> Any:
        """Return pictures, each in a weather of its own.

        Parameters
        ----------
        images : (N, H, W) or (N, H, W, 1 or 3)
            As `image` of a call.
        index : int or N ints, optional
            Of the first picture, whose followers count up; or of each.
        depth : as for a call, or (N, H, W), optional
        return_layer : bool

        Returns
        -------
        array of the shape and dtype of `images`
            Or with `return_layer` that and the layers, (N, H, W, 4) float32. Picture k is what a
            call with its index gives.
        """
        given = stack_of("images", images)
        count = len(given)
        if index is None or isinstance(index, (int, np.integer)):
            first = None if index is None else index_of(index)
            wanted = [None if first is None else _wrapped(first + k) for k in range(count)]
        else:
            if len(index) != count:
                raise ValueError(f"index must be one or {count} integers, got {len(index)}")
            wanted = [index_of(value) for value in index]
        records = [self._drawn(image, k) for image, k in zip(given, wanted, strict=True)]
        return self._stacked(given, records, depth, return_layer, [0.0] * count)

    def pair(
        self,
        left: npt.ArrayLike,
        right: npt.ArrayLike,
        *,
        index: int | None = None,
        time: float = 0.0,
        depth: Depth = None,
        distance: float = 0.12,
        return_layer: bool = False,
    ) -> Any:
        """Return both pictures of a rectified stereo pair in one weather.

        Parameters
        ----------
        left, right : (H, W) or (H, W, 1 or 3)
            As `image` of a call; of one shape.
        index, time, return_layer
            As for a call.
        depth : as for a call, or (left, right), optional
            One for both, or a tuple of two.
        distance : float
            Of the two cameras, metres. Set `focal` to the camera's.

        Returns
        -------
        left, right
            Or with `return_layer` (left, right, left layer, right layer).

        Notes
        -----
        A flake at depth z has the disparity ``focal * distance / z``, and so have each layer
        of sheets.
        """
        pictures = (picture_of("left", left), picture_of("right", right))
        layer = flag("return_layer", return_layer)
        apart = real("distance", distance, low=0.0, high=1e3)
        if pictures[0].shape[:2] != pictures[1].shape[:2]:
            raise ValueError(
                f"right must have the height and width of left, {pictures[0].shape[:2]}, got "
                f"{pictures[1].shape[:2]}"
            )
        record = self._drawn(pictures[0], index)
        air = self._air(record)
        moment = real("time", time, low=-1e9, high=1e9)
        both = depth if isinstance(depth, tuple) else (depth, depth)
        if len(both) != 2:
            raise ValueError(f"depth must be one or (left, right), got {len(both)}")
        results, layers = [], []
        veil = None
        for side, (picture, own) in enumerate(zip(pictures, both, strict=True)):
            view = self._view(picture.shape[:2], (side - 0.5) * apart, 0.5 * apart)
            distances = self._distances(own, view)
            if veil is None:
                # One air for both eyes, by what the left one sees.
                veil = Here(air, view, distances, moment).extinction
            alpha = air.alpha(view, distances, time=moment, veil=veil)
            results.append(mixed(picture, alpha, record["color"], self.white))
            if layer:
                layers.append(layer_of(alpha, record["color"]))
        return (*results, *layers)

    def _stacked(
        self, given: Array, records: list[dict[str, Any]], depth: Depth, layers: bool,
        times: list[float], rate: float | None = None,
    ) -> Any:  # fmt: skip
        whole, view = flag("return_layer", layers), self._view(given.shape[1:3])
        # A depth for each of them, or one for all.
        several = isinstance(depth, (list, tuple)) or getattr(depth, "ndim", 0) == 3
        if several and len(depth) != len(given):
            raise ValueError(f"depth must be one or {len(given)} of them, got {len(depth)}")
        far = None if several else self._distances(depth, view)
        result = np.empty(given.shape, given.dtype.newbyteorder("="))
        planes = np.empty((*given.shape[:3], 4), np.float32) if whole else None
        for number, (image, record, time) in enumerate(zip(given, records, times, strict=True)):
            one = far or self._distances(depth[number], view)
            alpha = self._air(record).alpha(view, one, time=time, fps=rate, passing=True)
            result[number] = mixed(image, alpha, record["color"], self.white)
            if planes is not None:
                planes[number] = layer_of(alpha, record["color"])
        return result if planes is None else (result, planes)


def _wrapped(number: int) -> int:
    """Return an index within an int64."""
    return (number + 2**63) % 2**64 - 2**63
