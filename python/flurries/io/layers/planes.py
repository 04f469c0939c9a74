"""EXR pictures with named layers, views and deep samples, as compositing programs expect them."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries._contract import Array, ArrayLike, PathLike, mapping, rectangular
from flurries.io.atomic import replacing
from flurries.io.color import to_half, to_single
from flurries.io.files import Budget, given
from flurries.io.oiio import openimageio
from flurries.io.pictures.header import Opened, opened_picture
from flurries.io.pictures.parts import Part, output_of, unwritten, write_parts
from flurries.io.pictures.reader import samples_of
from flurries.io.pictures.slate import Slate, checked_metadata
from flurries.io.pictures.writer import format_of

MAIN = "rgba"

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*(\.[A-Za-z][A-Za-z0-9_]*)*")
# The order of the channels in an array; files keep them by the alphabet.
_ORDER = "RGBAXYZuv"
# Two-dimensional layers get the channel name that tells programs what they are; vectors from this
# frame to the next are called "u" and "v" by compositing programs.
_SINGLE = {"depth": "Z", "alpha": "A", "mask": "A", "coverage": "A"}
_PAIR = {"forward": "uv", "backward": "uv"}
# What a half is too coarse for.
_PRECISE = ("depth",)
# Whole numbers are two channels; Blender would take a bare "snow.id" for a fifth of "snow".
_LOWER, _UPPER = ".lo", ".hi"

VIEWS = ("left", "right")

CHANNELS = ("R", "G", "B", "A", "Z", "ZBack")  # Of a deep picture.
_DEEP_ROWS = 16  # Rows that are handed over together.


def write_layers(
    path: PathLike, layers: Mapping[str, ArrayLike], *, half: bool = True,
    metadata: Mapping[str, object] | None = None, slate: Slate | None = None,
) -> None:  # fmt: skip
    """Write one EXR with several named layers; atomic and verified as `write_picture`.

    Parameters
    ----------
    path : str or path
        Ends in .exr.
    layers : mapping of str to array
        Arrays of one size: floats, linear light, colors multiplied by alpha. The layer ``"rgba"``
        becomes the channels R, G, B, A; others get their name in front, ``snow.R``. An array (H, W,
        3) or (H, W, 4) is a color, (H, W, 2) a vector with the channels X and Y, or u and v where
        the name ends in "forward" or "backward", and (H, W) a number: ``depth.Z``, ``alpha.A``,
        ``mask.A``, ``coverage.A``, else ``name.Y``. An array (H, W) of int64 or uint64, 0 to 2^63 -
        1, is two channels of type uint: ``name.lo``, its lower 32 bits, and ``name.hi``, the upper
        ones.
    half : bool, default True
        Store colors, masks and what ends in "forward" or "backward" as half. Depths and other
        vectors always have 32 bits.
    metadata, slate
        As `write_picture`.
    """
    require_exr(path, "layers")
    _write(path, {"": layers}, half, metadata, slate)


def write_layer_views(
    path: PathLike, views: Mapping[str, Mapping[str, ArrayLike]], *,
    half: bool = True, metadata: Mapping[str, object] | None = None, slate: Slate | None = None,
) -> None:  # fmt: skip
    """Write an EXR with a part for each view, usually "left" and "right", of layers each."""
    require_exr(path, "views")
    if not mapping("views", views):
        raise ValueError("views must name at least one view, got none")
    for name in views:
        if not isinstance(name, str) or not name.isidentifier():
            raise ValueError(f"views must be called like 'left' and 'right', got {name!r}")
    _write(path, views, half, metadata, slate)


def _write(
    path: PathLike, views: Mapping[str, Mapping[str, ArrayLike]], half: bool,
    metadata: Mapping[str, object] | None, slate: Slate | None,
) -> None:  # fmt: skip
    """Write a part for each view; one without a name is not marked."""
    strings, said = checked_metadata(metadata), given("slate", slate, Slate)
    parts = []
    for name, layers in views.items():
        parts.append(part := _part_of(layers, half))
        if name:
            part.specification.attribute("view", name)
            part.specification.attribute("oiio:subimagename", name)
        said.put(part.specification, "openexr", "linear", strings)
    write_parts(path, parts)


def read_layers(path: PathLike, *, budget: Budget | None = None) -> dict[str, Array]:
    """Read all layers of an EXR, the inverse of `write_layers`.

    They are float32, (H, W) for single channels and (H, W, C) else; the display window is not
    applied. Each channel of type uint is a plane of its own by its whole name, (H, W) int64, and
    ``name.lo`` and ``name.hi`` are one. `path`, `budget` and errors are those of `read_picture`.
    """
    with opened_picture(path, budget) as opened:
        spec = opened.specification
        found: dict[str, Array] = {}
        places: dict[str, list[int]] = {}
        for place, name in enumerate(spec.channelnames):
            if str(spec.channelformat(place)) == "uint":
                [plane] = opened.read("uint", [place])
                found[name] = plane[..., 0].astype(np.int64)
            else:
                places.setdefault(name.rpartition(".")[0] or MAIN, []).append(place)
        for name in [name.removesuffix(_LOWER) for name in found if name.endswith(_LOWER)]:
            if name + _UPPER in found:
                found[name] = found.pop(name + _LOWER) | found.pop(name + _UPPER) << 32
        for group in places.values():
            group.sort(key=lambda place: _ORDER.find(spec.channelnames[place][-1:]))
        planes = opened.read("float", *places.values()) if places else []
    for name, plane in zip(places, planes, strict=True):
        found[name] = plane[..., 0] if plane.shape[2] == 1 else plane
    return found


def read_views(path: PathLike, *, budget: Budget | None = None) -> tuple[Array, Array]:
    """Read (left, right), (H, W, 3 or 4), of an EXR: two parts, or one with two views in it."""
    with opened_picture(path, budget) as opened:
        parts = opened.parts
        names = [part.get_string_attribute("view") for part in parts]
        if set(VIEWS) <= set(names):
            left, right = (_eye(opened.at(names.index(view)), "") for view in VIEWS)
        elif tuple(parts[0].getattribute("multiView") or ()) == VIEWS:
            left, right = (_eye(opened.at(0), prefix) for prefix in ("", "right."))
        else:
            raise ValueError(f"{opened.path}: does not hold a left and a right view")
        return left, right


def _eye(opened: Opened, prefix: str) -> Array:
    """Return the colors of a part whose names begin with `prefix`, and alpha where there is one."""
    names = opened.specification.channelnames
    wanted = [names.index(prefix + name) for name in "RGBA" if prefix + name in names]
    if len(wanted) < 3:
        raise ValueError(f"{opened.path}: a view has no red, green and blue")
    return opened.read("float", wanted)[0]


def require_exr(path: PathLike, content: str) -> None:
    if format_of(path).name != "openexr":
        raise ValueError(f"{os.fspath(path)}: only .exr holds {content}")


def _part_of(layers: Mapping[str, ArrayLike], half: bool) -> Part:
    planes: dict[str, tuple[Array, str]] = {}
    sizes = set()
    for name, values in mapping("layers", layers).items():
        array = _checked_layer(name, values)
        sizes.add(array.shape[:2])
        last, count = name.rpartition(".")[2], array.shape[2]
        if array.dtype.kind in "iu":
            words = np.ascontiguousarray(array, "<i8").view("<u4")
            planes[name + _LOWER] = words[..., 0], "uint"
            planes[name + _UPPER] = words[..., 1], "uint"
            continue
        precise = not half or last in _PRECISE or (count == 2 and last not in _PAIR)
        own = {1: _SINGLE.get(last, "Y"), 2: _PAIR.get(last, "XY")}.get(count, "RGBA"[:count])
        for number, channel in enumerate(own):
            called = channel if name == MAIN else f"{name}.{channel}"
            planes[called] = (array[..., number], "float" if precise else "half")
    if not planes:
        raise ValueError("layers must not be empty")
    if len(sizes) > 1:
        raise ValueError(f"layers must have one size, got {sorted(sizes)}")
    height, width = sizes.pop()
    names = sorted(planes)
    kinds = [planes[name][1] for name in names]
    specification = openimageio().ImageSpec(width, height, len(names), kinds[0])
    specification.channelnames = tuple(names)
    specification.channelformats = tuple(map(openimageio().TypeDesc, kinds))
    specification.alpha_channel = specification.channelindex("A")
    specification.attribute("compression", "zip")

    def band(first: int, last: int) -> Array:
        rows = list[Array]()
        for name, kind in zip(names, kinds, strict=True):
            plane = planes[name][0][first:last]
            if kind != "uint":
                plane = to_half(plane) if kind == "half" else to_single(plane)
            rows.append(np.ascontiguousarray(plane).view(np.uint8))
        return np.concatenate(rows, axis=1)

    return Part(specification, band)


def _checked_layer(name: str, values: ArrayLike) -> Any:
    """Return a layer as (H, W, C)."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        known = "letters, digits and '_', parts joined by '.'"
        raise ValueError(f"layers: the name {name!r} must be {known}")
    array = np.asarray(values)
    whole = array.dtype.kind in "iu"
    if array.dtype.kind != "f" and not (whole and array.dtype.itemsize == 8):
        raise TypeError(f"layers: {name!r} must hold floats or 64-bit integers, got {array.dtype}")
    if array.ndim == 2:
        array = array[..., np.newaxis]
    if array.ndim != 3 or not 1 <= array.shape[2] <= 4 or 0 in array.shape:
        raise ValueError(
            f"layers: {name!r} must be (H, W), (H, W, 2), (H, W, 3) or (H, W, 4), "
            f"got {np.shape(values)}"
        )
    if whole and array.shape[2] > 1:
        raise ValueError(f"layers: {name!r} holds integers and must be (H, W), got several numbers")
    if whole and (int(array.min()) < 0 or int(array.max()) >= 2**63):
        raise ValueError(f"layers: {name!r} must hold numbers from 0 to 2^63 - 1")
    return array


@dataclass(frozen=True, eq=False)
class Deep:
    """The samples of a deep picture.

    Attributes
    ----------
    counts : (H, W) int array
        Samples of each pixel.
    values : (N, 6) float32 array
        Pixel after pixel, row after row, nearest sample first: red, green, blue, opacity, and the
        depths where the sample begins and ends. Colors are linear light multiplied by the opacity.
    """

    counts: Array
    values: Array

    def __post_init__(self) -> None:
        counts = rectangular("counts", self.counts)
        if counts.ndim != 2 or counts.dtype.kind not in "iu" or bool((counts < 0).any()):
            raise ValueError(f"counts must be (H, W) numbers of samples, got {self.counts!r:.80}")
        values, wanted = rectangular("values", self.values), (int(counts.sum()), len(CHANNELS))
        if values.shape != wanted or values.dtype.kind != "f":
            raise ValueError(f"values must be floats of shape {wanted}, got {self.values!r:.80}")
        object.__setattr__(self, "counts", counts.astype(np.int64))
        object.__setattr__(self, "values", values.astype(np.float32))


def write_deep(
    path: PathLike, deep: Deep, *, half: bool = True,
    metadata: Mapping[str, object] | None = None, slate: Slate | None = None,
) -> None:  # fmt: skip
    """Write samples into a deep EXR; large pictures take long, number by number."""
    require_exr(path, "deep samples")
    if not isinstance(deep, Deep):
        raise TypeError(f"deep must be a Deep, got {deep!r:.80}")
    strings, said = checked_metadata(metadata), given("slate", slate, Slate)
    library, target = openimageio(), os.fspath(path)
    height, width = deep.counts.shape
    kinds = [library.TypeDesc("half" if half else "float")] * 4 + [library.TypeDesc("float")] * 2
    specification = library.ImageSpec(width, height, len(CHANNELS), "float")
    specification.channelnames, specification.channelformats = CHANNELS, tuple(kinds)
    specification.alpha_channel, specification.z_channel = 3, 4
    specification.deep = True
    said.put(specification, "openexr", "linear", strings)
    specification.attribute("compression", "zips")
    starts = np.concatenate([[0], np.cumsum(deep.counts.sum(axis=1))])
    with replacing(path) as temporary:
        with output_of(target, temporary, [specification]) as output:
            for top in range(0, height, _DEEP_ROWS):
                last = min(top + _DEEP_ROWS, height)
                values = deep.values[starts[top] : starts[last]]
                band = _band(library, kinds, deep.counts[top:last], values)
                rows = specification.y + top, specification.y + last
                if not output.write_deep_scanlines(*rows, 0, band):
                    raise unwritten(target, output)
        with opened_picture(temporary, deep=True) as opened:
            there, _ = samples_of(opened, [])
        if not np.array_equal(there, deep.counts):
            raise OSError(f"{target}: does not read back as what was written")


def read_deep(path: PathLike) -> Deep:
    """Return the samples of a deep EXR; OSError or ValueError where none can be read."""
    with opened_picture(path, deep=True) as opened:
        names = opened.specification.channelnames
        if not opened.specification.deep or not set(CHANNELS) <= set(names):
            raise ValueError(f"{opened.path}: holds no deep samples of {', '.join(CHANNELS)}")
        return Deep(*samples_of(opened, [names.index(name) for name in CHANNELS]))


def _band(library: Any, kinds: list[Any], counts: Array, values: Array) -> Any:
    data = library.DeepData()
    data.init(counts.size, len(CHANNELS), kinds, list(CHANNELS))
    flat = counts.ravel().tolist()
    for pixel, count in enumerate(flat):
        if count:
            data.set_samples(pixel, count)
    put, rows = data.set_deep_value, iter(values.tolist())
    for pixel, count in enumerate(flat):
        for sample in range(count):
            for channel, value in enumerate(next(rows)):
                put(pixel, channel, sample, value)
    return data
