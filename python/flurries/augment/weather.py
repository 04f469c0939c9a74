"""Weather for data sets as a function of one picture, and again from its record."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any, Literal, overload

import numpy.typing as npt

from flurries._contract import Array, choice, flag, mapping, output, rate_of, real
from flurries.augment.air import FPS
from flurries.augment.distance import Depth
from flurries.augment.labels import Weathered, boxes_of, flow_of, hidden, layer_of
from flurries.augment.pictures import mixed, picture_of
from flurries.augment.several import Several
from flurries.augment.slices import labels_of


class Weather(Several):
    """Weather as a function of a picture. The fields are described in the weathers themselves."""

    @overload
    def __call__(
        self, image: npt.ArrayLike, *, index: int | None = None, time: float | None = None,
        depth: Depth = None, return_layer: Literal[False] = False, out: Array | None = None,
    ) -> Array: ...  # fmt: skip

    @overload
    def __call__(
        self, image: npt.ArrayLike, *, index: int | None = None, time: float | None = None,
        depth: Depth = None, return_layer: Literal[True], out: Array | None = None,
    ) -> tuple[Array, Array]: ...  # fmt: skip

    def __call__(
        self,
        image: npt.ArrayLike,
        *,
        index: int | None = None,
        time: float | None = None,
        depth: Depth = None,
        return_layer: bool = False,
        out: Array | None = None,
    ) -> Any:
        """Return the picture in this weather.

        Parameters
        ----------
        image : (H, W) or (H, W, 1 or 3)
            uint8, uint16, float16, float32 or float64; floats from 0 to `white`. Never written to.
        index : int, optional
            Which draw of the random numbers: one for each picture of a data set, the same for all
            frames of a film. Without it and without a `seed` each call draws anew; without it and
            with a `seed` the number comes from the picture itself.
        time : float, optional
            Seconds, of a frame of a film (of 30 frames per second). None is a picture by itself,
            whose far flakes are a texture that would not go on from frame to frame, and so is
            quicker.
        depth : float, (H, W) float or DepthMap, optional
            How far away what is seen is: metres, infinity where nothing stands, 0 or NaN where it
            is not known and the nearest pixel of the row that has one is taken; relative depths
            through :class:`flurries.scene.DepthMap`. Without it `ground` is taken, and without that
            all is as far as the sky.
        return_layer : bool
            Also return the weather alone.
        out : like `image`, optional
            Array to write into and return; not the picture itself.

        Returns
        -------
        array of the shape and dtype of `image`
            Or with `return_layer` that and the layer, (H, W, 4) float32, display values
            premultiplied with the opacity.
        """
        given = picture_of("image", image)
        layer = flag("return_layer", return_layer)
        record = self._drawn(given, index)
        view = self._view(given.shape)
        distances = self._distances(depth, view)
        alpha = self._air(record).alpha(
            view, distances, time=_seconds(time), fps=None if time is None else FPS, passing=True
        )
        seen = mixed(given, alpha, record["color"], self.white)
        if out is not None:
            result = output(out, seen.shape, seen.dtype, given)
            result[...] = seen
            seen = result
        return (seen, layer_of(alpha, record["color"])) if layer else seen

    def apply(
        self,
        image: npt.ArrayLike,
        *,
        index: int | None = None,
        time: float | None = None,
        fps: float = 30.0,
        depth: Depth = None,
        boxes: npt.ArrayLike | None = None,
        masks: Any = None,
        flow: npt.ArrayLike | None = None,
        motion: bool = False,
    ) -> Weathered:
        """Return the picture in this weather with its labels.

        Parameters
        ----------
        image, index, time, depth
            As for a call.
        fps : float
            Frames per second of the film that the picture is of.
        boxes : (n, 4), optional
            (x0, y0, x1, y1) in pixels; the result says how much of each is hidden.
        masks : optional
            Anything; passed through.
        flow : (H, W, 2) float, optional
            Motion of what is seen, pixels (x, y) per frame.
        motion : bool
            Also return how the weather moves and how far away it is.

        Returns
        -------
        Weathered
        """
        given = picture_of("image", image)
        wanted, rate = flag("motion", motion), rate_of(fps)
        corners = None if boxes is None else boxes_of(boxes)
        label = None if flow is None else flow_of(flow, given.shape[:2])
        record = self._drawn(given, index)
        view = self._view(given.shape)
        distances = self._distances(depth, view)
        air, moment, film = self._air(record), _seconds(time), time is not None
        alpha = air.alpha(view, distances, time=moment, fps=rate if film else None)
        falls = None
        if wanted or label is not None or distances.given or corners is not None:
            falls = labels_of(air, view, distances, time=moment, fps=rate, film=film)
        found = hidden(
            alpha, falls, corners=corners, flow=label, motion=wanted, came=distances.came,
            depth=distances.whole(view.shape) if distances.given else None,
        )  # fmt: skip
        seen = mixed(given, alpha, record["color"], self.white)
        return Weathered(seen, alpha, record["color"], record, boxes, masks, **found)


def replay(record: Mapping[str, Any]) -> Weather:
    """Return the weather that a record describes.

    Parameters
    ----------
    record : dict
        From `Weather.record` or `Weathered.record`.

    Returns
    -------
    Snowfall, Rainfall or Fog

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> picture = np.full((48, 64, 3), 90, np.uint8)
    >>> seen = fl.augment.Snowfall(severity=3).apply(picture)
    >>> again = fl.augment.replay(seen.record)(picture)
    >>> bool((again == seen.image).all())
    True
    """
    given = mapping("record", record)
    name = choice("record: transform", given.get("transform"), ("Snowfall", "Rainfall", "Fog"))
    kind: type[Weather] = getattr(importlib.import_module("flurries.augment"), name)
    return kind.replay(given)


def _seconds(time: object) -> float:
    return 0.0 if time is None else real("time", time, low=-1e9, high=1e9)
