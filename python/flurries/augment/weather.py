"""What all weather for data sets has in common: how it is called, drawn, recorded and replayed."""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import lru_cache
from typing import Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from flurries._contract import Array, choice, flag, integer, output, rate_of, real
from flurries.augment.air import FPS, Air, Here, View
from flurries.augment.calibration import PROFILES, Profile
from flurries.augment.distance import SKY, Depth, Distances, Ground, distances_of, ground_of
from flurries.augment.draws import Range, between, index_of, own_index, range_of, uniforms
from flurries.augment.labels import Weathered, boxes_of, flow_of, layer_of, weathered
from flurries.augment.pictures import mixed, picture_of, stack_of
from flurries.augment.slices import labels_of
from flurries.camera.lens import Camera

VERSION = 2
SEVERITY = (1, 5)
DEFAULT_AMOUNT = (0.2, 0.8)

_Kind = TypeVar("_Kind", bound="Weather")


@dataclass(frozen=True, kw_only=True)
class Weather(ABC):
    """Weather as a function of a picture. The fields are described in the weathers themselves."""

    amount: Range | None = None
    severity: int | tuple[int, int] | None = None
    profile: Profile = "natural"
    color: Range | tuple[float, float, float] = (0.9, 1.0)
    ground: Ground | None = None
    focal: float = 1.2
    white: float = 1.0
    seed: int | None = None
    weather_seed: int | None = None

    # Numbers that are drawn, in the order of their random numbers: (name, limits).
    DRAWN: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        settle = object.__setattr__
        if self.amount is not None and self.severity is not None:
            raise ValueError("amount and severity must not both be given")
        if self.severity is not None:
            given = self.severity
            levels = given if isinstance(given, (tuple, list, np.ndarray)) else (given, given)
            low, high = range_of("severity", tuple(levels), low=SEVERITY[0], high=SEVERITY[1])
            if low != int(low) or high != int(high):
                raise TypeError(f"severity must be an integer or two, got {given!r}")
            settle(self, "severity", (int(low), int(high)))
        settle(self, "profile", choice("profile", self.profile, PROFILES))
        if self.amount is not None:
            settle(self, "amount", range_of("amount", self.amount, low=0.0, high=1.0))
        if isinstance(self.color, (tuple, list, np.ndarray)) and len(self.color) == 3:
            rgb = tuple(real("color", c, low=0.0, high=1.0) for c in self.color)
            settle(self, "color", rgb)
        else:
            settle(self, "color", range_of("color", self.color, low=0.0, high=1.0))
        settle(self, "ground", ground_of(self.ground))
        settle(self, "focal", real("focal", self.focal, low=0.05, high=1e3))
        settle(self, "white", real("white", self.white, low=1e-30, high=1e30))
        for name in ("seed", "weather_seed"):
            value = getattr(self, name)
            if value is not None:
                settle(self, name, integer(name, value, low=-(2**63), high=2**63 - 1))

    # One picture ---------------------------------------------------------------------------------

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
            through :class:`flurries.DepthMap`. Without it `ground` is taken, and without that all
            is as far as the sky.
        return_layer : bool
            Also return the weather alone.
        out : like `image`, optional
            Array to write into and return; not the picture itself.

        Returns
        -------
        array of the shape and dtype of `image`
            Or with `return_layer` that and the layer, (H, W, 4) float32, display values
            premultiplied with the opacity.

        Raises
        ------
        ValueError, TypeError
            For an argument that is not as described; the message names it.
        """
        given = picture_of("image", image)
        layer = flag("return_layer", return_layer)
        record = self._drawn(given, index)
        view = self._view(given.shape[:2])
        distances = self._distances(depth, view)
        alpha = self._air(record).alpha(
            view, distances, time=_seconds(time), fps=None if time is None else FPS, passing=True
        )
        seen = _into(out, mixed(given, alpha, record["color"], self.white), given)
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
        wanted = flag("motion", motion)
        rate = rate_of(fps)
        shape = given.shape[:2]
        corners = None if boxes is None else boxes_of(boxes)
        label = None if flow is None else flow_of(flow, shape)
        record = self._drawn(given, index)
        view = self._view(shape)
        distances = self._distances(depth, view)
        air = self._air(record)
        moment = _seconds(time)
        film = None if time is None else rate
        alpha = air.alpha(view, distances, time=moment, fps=film)
        falls = None
        if wanted or label is not None or distances.given or corners is not None:
            falls = labels_of(air, view, distances, time=moment, fps=rate, film=time is not None)
        behind = distances.whole(view.shape) if distances.given else None
        return weathered(
            image=mixed(given, alpha, record["color"], self.white), alpha=alpha,
            color=record["color"], record=record, boxes=boxes, corners=corners, masks=masks,
            falls=falls, flow=label, depth=behind, came=distances.came, motion=wanted,
        )  # fmt: skip

    # More than one -------------------------------------------------------------------------------

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
        record = self._drawn(given[0], index)
        air = self._air(record)
        view = self._view(given.shape[1:3])
        several = _each(depth, len(given))
        distances = None if several else self._distances(depth, view)

        def layers() -> Iterator[Array]:
            for number in range(len(given)):
                far = distances or self._distances(depth[number], view)
                yield air.alpha(view, far, time=start + number / rate, fps=rate, passing=True)

        return self._stacked(given, layers(), [record] * len(given), return_layer)

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
        view = self._view(given.shape[1:3])
        several = _each(depth, count)
        distances = None if several else self._distances(depth, view)

        def layers() -> Iterator[Array]:
            for number, record in enumerate(records):
                far = distances or self._distances(depth[number], view)
                yield self._air(record).alpha(view, far, time=0.0, passing=True)

        return self._stacked(given, layers(), records, return_layer)

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
        A flake at depth z has the disparity ``focal * distance / z``, and so have the layers of
        the texture; nearer than four of its tiles' disparities all flakes are drawn.
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

    # What was drawn ------------------------------------------------------------------------------

    def record(self, image: npt.ArrayLike | None = None, *, index: int | None = None) -> Any:
        """Return what a call draws, as plain numbers and words.

        Parameters
        ----------
        image : array, optional
            Needed where the index comes from the picture itself.
        index : int, optional
            As for a call.

        Returns
        -------
        dict
            For :func:`flurries.augment.replay`; holds in JSON.

        Raises
        ------
        ValueError
            Without an index or a picture; and without an index or a seed, since each call then
            draws anew: `apply` returns the record of what it drew.
        """
        if index is None and self.seed is None and self.weather_seed is None:
            raise ValueError("index must be given: without it and a seed each call draws anew")
        if index is None and image is None:
            raise ValueError("index or image must be given")
        return self._drawn(None if image is None else picture_of("image", image), index)

    @classmethod
    def replay(cls: type[_Kind], record: Mapping[str, Any]) -> _Kind:
        """Return the weather that makes what was recorded, whatever the index.

        Raises
        ------
        ValueError, TypeError
            If it is no record of this weather.
        """
        if not isinstance(record, Mapping):
            raise TypeError(f"record must be a dict, got {type(record).__name__}")
        values = dict(record)
        kind, version = values.pop("transform", None), values.pop("version", None)
        if kind != cls.__name__ or version != VERSION:
            raise ValueError(
                f"record must be of a {cls.__name__}, version {VERSION}, got {kind!r}, {version!r}"
            )
        ground = values.pop("ground", None)
        known = {f.name for f in fields(cls)} - {"severity", "seed", "ground"}
        if set(values) != known:
            odd = sorted(set(values) ^ known)
            raise ValueError(f"record must hold {sorted(known)}, differs in {odd}")
        values["color"] = tuple(values["color"])
        return cls(ground=ground, **values)

    # Inside --------------------------------------------------------------------------------------

    def _drawn(self, image: Array | None, index: int | None) -> dict[str, Any]:
        """Return the record of a call."""
        if index is not None:
            number = index_of(index)
        elif self.seed is None and self.weather_seed is not None:
            number = 0
        else:
            assert image is not None
            number = own_index(self.seed, image)
        u = uniforms(self.seed or 0, number, 4 + len(self.DRAWN))
        if self.severity is not None:
            low, high = self.severity  # type: ignore[misc]
            amount = (low + int(u[1] * (high - low + 1))) / SEVERITY[1]
        else:
            amount = between(self.amount or DEFAULT_AMOUNT, u[1])
        if len(self.color) == 3:  # type: ignore[arg-type]
            color: Any = self.color
        else:
            color = (between(self.color, u[2]),) * 3
        own = self.weather_seed
        record: dict[str, Any] = {
            "transform": type(self).__name__,
            "version": VERSION,
            "amount": amount,
            "profile": self.profile,
            "color": color,
            "ground": None if self.ground is None else asdict(self.ground),
            "focal": self.focal,
            "white": self.white,
            "weather_seed": int(u[0] * 2**53) if own is None else own,
        }
        for slot, name in enumerate(self.DRAWN):
            record[name] = between(getattr(self, name), u[4 + slot])
        return record

    @abstractmethod
    def _air(self, record: dict[str, Any]) -> Air:
        """Return the air that a record describes."""

    def _view(self, shape: tuple[int, ...], aside: float = 0.0, eyes: float = 0.0) -> View:
        return _view_of((shape[0], shape[1]), self.focal, aside, eyes)

    def _distances(self, depth: Depth, view: View) -> Distances:
        far = SKY if self.ground is None else self.ground.far
        return distances_of(depth, view.shape, self.ground, view.camera.focal, far)

    def _stacked(
        self, given: Array, alphas: Iterator[Array], records: list[dict[str, Any]], layers: bool
    ) -> Any:
        whole = flag("return_layer", layers)
        result = np.empty(given.shape, given.dtype.newbyteorder("="))
        planes = np.empty((*given.shape[:3], 4), np.float32) if whole else None
        for number, (alpha, record) in enumerate(zip(alphas, records, strict=True)):
            result[number] = mixed(given[number], alpha, record["color"], self.white)
            if planes is not None:
                planes[number] = layer_of(alpha, record["color"])
        return result if planes is None else (result, planes)


def replay(record: Mapping[str, Any]) -> Weather:
    """Return the weather that a record describes.

    Parameters
    ----------
    record : dict
        From `Weather.record` or `Weathered.record`.

    Returns
    -------
    Snowfall, Rainfall or Fog

    Raises
    ------
    ValueError, TypeError
        If it is no record.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> picture = np.full((48, 64, 3), 90, np.uint8)
    >>> seen = fl.augment.Snowfall(severity=3).apply(picture)
    >>> again = fl.augment.replay(seen.record)(picture)
    >>> bool((again == seen.image).all())
    True
    """
    if not isinstance(record, Mapping):
        raise TypeError(f"record must be a dict, got {type(record).__name__}")
    kinds: dict[str, Callable[[], type[Weather]]] = {
        name: lambda name=name: getattr(importlib.import_module("flurries.augment"), name)  # type: ignore[misc]
        for name in ("Snowfall", "Rainfall", "Fog")
    }
    kind = record.get("transform")
    if kind not in kinds:
        raise ValueError(f"record: transform must be one of {', '.join(kinds)}, got {kind!r}")
    return kinds[kind]().replay(record)


@lru_cache(maxsize=32)
def _view_of(shape: tuple[int, int], focal: float, aside: float, eyes: float) -> View:
    return View(shape, Camera(focal * max(shape), offset=(aside, 0.0, 0.0)), eyes)


def _seconds(time: object) -> float:
    return 0.0 if time is None else real("time", time, low=-1e9, high=1e9)


def _each(depth: Depth, count: int) -> bool:
    """Whether a depth is given for each of several pictures."""
    several = isinstance(depth, (list, tuple)) or getattr(depth, "ndim", 0) == 3
    if several and len(depth) != count:
        raise ValueError(f"depth must be one or {count} of them, got {len(depth)}")
    return several


def _wrapped(number: int) -> int:
    """Return an index within an int64."""
    return (number + 2**63) % 2**64 - 2**63


def _into(out: Array | None, seen: Array, given: Array) -> Array:
    if out is None:
        return seen
    result = output(out, seen.shape, seen.dtype, given)
    result[...] = seen
    return result
