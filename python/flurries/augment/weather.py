"""Weather for data sets as a function of pictures, films, batches and both eyes' views."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import partial
from typing import Any, Literal, overload

import numpy as np
import numpy.typing as npt

from flurries._contract import Array, choice, flag, int64, mapping, output, rate_of, real
from flurries.augment.air import FPS, Here, View
from flurries.augment.distance import Depth, Distances, Ground, distances_of
from flurries.augment.labels import Weathered, boxes_of, flow_of, hidden, mixture_of
from flurries.augment.pictures import in_weather, layer_of, picture_of, stack_of
from flurries.augment.record import VERSION, Recorded

_GROUND = Ground()


class Weather(Recorded):
    """Weather as a function of pictures; the fields are described in the weathers themselves."""

    @overload
    def __call__(
        self, image: npt.ArrayLike, *, index: int | None = None, time: float | None = None,
        depth: Depth = None, wet: Any = None, return_layer: Literal[False] = False,
        out: Array | None = None,
    ) -> Array: ...  # fmt: skip

    @overload
    def __call__(
        self, image: npt.ArrayLike, *, index: int | None = None, time: float | None = None,
        depth: Depth = None, wet: Any = None, return_layer: Literal[True], out: Array | None = None,
    ) -> tuple[Array, Array]: ...  # fmt: skip

    def __call__(
        self, image: npt.ArrayLike, *, index: int | None = None, time: float | None = None,
        depth: Depth = None, wet: Any = None, return_layer: bool = False, out: Array | None = None,
    ) -> Any:  # fmt: skip
        """Return the picture in this weather, of its shape and dtype.

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
            which is quicker: its far flakes would not go on from frame to frame.
        depth : float, (H, W) float or DepthMap, optional
            How far away what is seen is: metres, infinity where nothing stands, 0 or NaN where it
            is not known; relative depths through :class:`flurries.scene.DepthMap`. Without it
            `ground`'s, else that of the sky.
        wet : (H, W) bool or float, optional
            Share of ground under water, 0 to 1: darker, a mirror along the horizon of `ground`.
        return_layer : bool
            Also return the weather alone, (H, W, 4) float32, premultiplied; of each picture.
        out : like `image`, optional
            Array to write into and return; not the picture itself.
        """
        given = picture_of("image", image)
        moment, rate = (0.0, None) if time is None else (_seconds(time), FPS)
        record = self._drawn(given, index)
        whole = flag("return_layer", return_layer)
        ((seen, _, alpha, _),) = self._seen([given], [record], [depth], [wet], [moment], rate)
        if out is not None:
            result = output(out, seen.shape, seen.dtype, given)
            result[...] = seen
            seen = result
        return (seen, layer_of(alpha, record["color"])) if whole else seen

    def clip(
        self, frames: npt.ArrayLike, *, index: int | None = None, fps: float = 30.0,
        time: float = 0.0, depth: Depth = None, wet: Any = None, return_layer: bool = False,
    ) -> Any:  # fmt: skip
        """Return the frames of one film in one weather that moves; arguments as of a call.

        Parameters
        ----------
        frames : (T, H, W) or (T, H, W, 1 or 3)
        fps, time : float
            Frames per second; seconds at the first frame.
        depth, wet : as for a call, or (T, H, W), optional
            For all frames, or of each.
        """
        given, rate = stack_of("frames", frames), rate_of(fps)
        records = [self._drawn(given[0], index)] * len(given)
        times = [_seconds(time) + number / rate for number in range(len(given))]
        return self._stacked(given, records, depth, wet, times, return_layer, rate)

    def batch(
        self, images: npt.ArrayLike, *, index: int | Sequence[int] | None = None,
        depth: Depth = None, wet: Any = None, return_layer: bool = False,
    ) -> Any:  # fmt: skip
        """Return pictures, each in a weather of its own; arguments as of a call.

        Parameters
        ----------
        images : (N, H, W) or (N, H, W, 1 or 3)
        index : int or N ints, optional
            Of the first picture, whose followers count up; or of each.
        depth, wet : as for a call, or (N, H, W), optional
        """
        given = stack_of("images", images)
        if isinstance(index, (int, np.integer)):
            first = int64("index", index) + 2**63
            # Wrapped within an int64.
            index = [(first + k) % 2**64 - 2**63 for k in range(len(given))]
        wanted = _each("index", index, len(given))
        records = [self._drawn(image, k) for image, k in zip(given, wanted, strict=True)]
        return self._stacked(given, records, depth, wet, [0.0] * len(given), return_layer)

    def pair(
        self, left: npt.ArrayLike, right: npt.ArrayLike, *, index: int | None = None,
        time: float = 0.0, depth: Depth = None, wet: Any = None, distance: float = 0.12,
        return_layer: bool = False,
    ) -> Any:  # fmt: skip
        """Return both pictures of a rectified stereo pair in one weather; arguments as of a call.

        Parameters
        ----------
        left, right : (H, W) or (H, W, 1 or 3)
            Of one height and width.
        depth, wet : as for a call, or (left, right), optional
        distance : float
            Of the two cameras, metres: what is z metres away has the disparity
            ``focal * distance / z``. Set `focal` to the camera's.
        """
        pictures = _pair(left, right)
        records = [self._drawn(pictures[0], index)] * 2
        times, whole = [_seconds(time)] * 2, flag("return_layer", return_layer)
        seen, layers = [], []
        for one, _, alpha, _ in self._seen(
            pictures, records, depth, wet, times, None, distance, (-1, 1)
        ):
            seen.append(one)
            layers += [layer_of(alpha, records[0]["color"])] if whole else []
        return (*seen, *layers)

    def apply(
        self, image: Any, *, index: int | None = None, time: float | None = None, fps: float = 30.0,
        depth: Depth = None, wet: Any = None, boxes: Any = None, masks: Any = None,
        flow: Any = None, motion: bool = False, eye: Literal["left", "right"] | None = None,
        distance: float = 0.12,
    ) -> Any:  # fmt: skip
        """Return a picture in this weather with its labels; or those of a film or a stereo pair.

        Parameters
        ----------
        image : array, or (left, right)
            A picture as for a call, a film (T, H, W, 1 or 3), or the two of a rectified pair.
        index, time, depth, wet, fps, distance
            As for a call, `clip` and `pair`; `fps` also of the film that a picture is of.
        boxes : (n, 4), optional
            (x0, y0, x1, y1) in pixels; the result says how much of each is hidden.
        masks : optional
            (H, W) integers, one for each instance and 0 for none, or (m, H, W) bool: the result
            says how much of each instance is hidden. Anything else passes through.
        flow : (H, W, 2) float, optional
            Motion of what is seen, pixels (x, y) per frame.
        motion : bool
            Also return how the weather moves and how far away it is.
        eye : {"left", "right"}, optional
            Which of a pair the picture is, where the other is not at hand.

        Returns
        -------
        Weathered
            Of a film a list and of a pair a tuple: of each, with its own boxes, masks and flow.
        """
        wanted, rate = flag("motion", motion), rate_of(fps)
        sides: tuple[int, ...] = ()
        if eye is not None:
            sides = (-1 if choice("eye", eye, ("left", "right")) == "left" else 1,)
        moment = 0.0 if time is None else _seconds(time)
        labels = {"boxes": boxes, "masks": masks, "flow": flow}
        pair, film = isinstance(image, tuple), getattr(image, "ndim", 0) == 4
        if pair:
            pictures, times, sides = _pair(*image), [moment] * 2, (-1, 1)
        elif film:
            pictures = list(stack_of("image", image))
            times = [moment + number / rate for number in range(len(pictures))]
            sides *= len(pictures)
        else:
            pictures, times = [picture_of("image", image)], [moment]
            depth, wet = [depth], [wet]
            labels = {name: [label] for name, label in labels.items()}
        count, record = len(pictures), self._drawn(pictures[0], index)
        # Each picture of several has its own.
        boxes, masks, flow = (_each(name, label, count) for name, label in labels.items())
        corners = [None if one is None else boxes_of(one) for one in boxes]
        shape, color = pictures[0].shape[:2], record["color"]
        flows = [None if one is None else flow_of(one, shape) for one in flow]
        goes_on = rate if time is not None or len(set(times)) > 1 else None
        made = self._seen(pictures, [record] * count, depth, wet, times, goes_on, distance, sides,
                          passing=False)  # fmt: skip
        found = []
        for k, (seen, here, alpha, veil) in enumerate(made):
            later = None
            if wanted or sides or flows[k] is not None or here.distances.given is not None:
                later = partial(mixture_of, here, alpha, flows[k], wanted, rate)
            found.append(Weathered(
                seen, alpha, color, record, boxes[k], masks[k],
                **hidden(alpha, veil, corners[k], masks[k]), _mixture=later,
            ))  # fmt: skip
        return tuple(found) if pair else found if film else found[0]

    def _airs(
        self, pictures: Iterable[Array], records: list[dict[str, Any]], depth: Depth,
        times: list[float], rate: float | None = None, apart: float = 0.0,
        sides: tuple[int, ...] = (),
    ) -> Iterator[Here]:  # fmt: skip
        """Yield the air before each picture: before both eyes one, by what the left one sees."""
        half = 0.5 * real("distance", apart, low=0.0, high=1e3)
        depths, several = _spread("depth", depth, len(times)), _is_several(depth)
        far: Distances | None = None
        first: Here | None = None
        for k, (picture, record) in enumerate(zip(pictures, records, strict=True)):
            shape = picture.shape[:2]
            eye = (half * sides[k], half) if sides else ()
            view = View(shape, self.focal * max(shape), *eye)
            if several or far is None:
                far = distances_of(depths[k], shape, self.ground, view.focal)
            here = Here(self.WEATHER, record, view, far, times[k], rate)
            if sides == (-1, 1):
                first = first or here
                here.extinction = first.extinction
            yield here

    def _seen(
        self, pictures: Iterable[Array], records: list[dict[str, Any]], depth: Depth, wet: Any,
        times: list[float], *how: Any, passing: bool = True,
    ) -> Iterator[tuple[Array, Here, Array, Any]]:  # fmt: skip
        """Yield each picture in its weather, the air before it, its opacity and its veil's."""
        airs = self._airs(pictures, records, depth, times, *how)
        wets, horizon = _spread("wet", wet, len(times)), (self.ground or _GROUND).horizon
        for picture, record, here, mask in zip(pictures, records, airs, wets, strict=True):
            alpha, veil = here.alpha(passing=passing)
            yield in_weather(picture, alpha, here, record, mask, horizon), here, alpha, veil

    def _stacked(
        self, given: Array, records: list[dict[str, Any]], depth: Depth, wet: Any,
        times: list[float], layers: bool, *how: Any,
    ) -> Any:  # fmt: skip
        result = np.empty(given.shape, given.dtype.newbyteorder("="))
        shape = (*given.shape[:3], 4)
        whole = np.empty(shape, np.float32) if flag("return_layer", layers) else None
        made = self._seen(given, records, depth, wet, times, *how)
        for k, (seen, _, alpha, _) in enumerate(made):
            result[k] = seen
            if whole is not None:
                whole[k] = layer_of(alpha, records[k]["color"])
        return result if whole is None else (result, whole)


def replay(record: Mapping[str, Any]) -> Weather:
    """Return the weather that a record describes: a Snowfall, Rainfall or Fog.

    Parameters
    ----------
    record : dict
        From `Weather.record` or `Weathered.record`.
    """
    given = dict(mapping("record", record))
    kinds = {kind.__name__: kind for kind in Weather.__subclasses__()}
    kind = kinds[choice("record: transform", given.pop("transform", None), kinds)]
    if (version := given.pop("version", None)) != VERSION:
        raise ValueError(f"record must be of version {VERSION}, got {version!r}")
    known = {field.name for field in fields(kind)} - {"severity", "seed"}
    if odd := sorted(given.keys() ^ known):
        raise ValueError(f"record must hold {sorted(known)}, differs in {odd}")
    return kind(**given)


def _pair(left: Any, right: Any) -> list[Array]:
    pictures = [picture_of("left", left), picture_of("right", right)]
    if pictures[0].shape[:2] != pictures[1].shape[:2]:
        raise ValueError(
            f"right must have the height and width of left, {pictures[0].shape[:2]}, got "
            f"{pictures[1].shape[:2]}"
        )
    return pictures


def _seconds(time: float) -> float:
    return real("time", time, low=-1e9, high=1e9)


def _is_several(value: Any) -> bool:
    return isinstance(value, (list, tuple)) or getattr(value, "ndim", 0) == 3


def _spread(name: str, value: Any, count: int) -> list[Any]:
    """Return what belongs to each of several pictures, or to all of them."""
    return _each(name, value, count) if _is_several(value) else [value] * count


def _each(name: str, value: Any, count: int) -> list[Any]:
    """Return what belongs to each of several pictures."""
    if value is None:
        return [None] * count
    if len(value) != count:
        raise ValueError(f"{name} must be one or {count} of them, got {len(value)}")
    return list(value)
