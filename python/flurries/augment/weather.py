"""Weather for data sets as a function of one picture, and again from its record."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any, Literal, overload

import numpy.typing as npt

from flurries._contract import Array, choice, flag, mapping, output, real
from flurries.augment.air import FPS
from flurries.augment.distance import Depth
from flurries.augment.labels import layer_of
from flurries.augment.pictures import mixed, picture_of
from flurries.augment.several import Several


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
        moment = 0.0 if time is None else real("time", time, low=-1e9, high=1e9)
        rate = None if time is None else FPS
        (here,) = self._airs([given], [record], [depth], [moment], rate)
        alpha, _ = here.alpha(passing=True)
        seen = mixed(given, alpha, record["color"], self.white)
        if out is not None:
            result = output(out, seen.shape, seen.dtype, given)
            result[...] = seen
            seen = result
        return (seen, layer_of(alpha, record["color"])) if layer else seen


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
