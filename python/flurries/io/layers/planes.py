"""EXR pictures with named layers, as compositing programs expect them."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import mapping
from flurries.io.color import Array, to_half, to_single
from flurries.io.files import Budget
from flurries.io.oiio import openimageio
from flurries.io.pictures import metadata as header
from flurries.io.pictures.header import opened_picture
from flurries.io.pictures.rows import Band, write_bands
from flurries.io.pictures.slate import Slate
from flurries.io.pictures.writer import format_of, packing

MAIN = "rgba"

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*(\.[A-Za-z][A-Za-z0-9_]*)*")
# The order of the channels in an array; files keep them by the alphabet.
_ORDER = "RGBAXYZuv"
# Two-dimensional layers get the channel name that tells programs what they are.
_SINGLE = {"depth": "Z", "alpha": "A", "mask": "A", "coverage": "A"}
# Vectors from this frame to the next are called so by compositing programs.
_FLOW = ("forward", "backward")
# What a half is too coarse for.
_PRECISE = ("depth", "id")


def write_layers(
    path: str | os.PathLike[str],
    layers: Mapping[str, npt.ArrayLike],
    *,
    half: bool = True,
    metadata: Mapping[str, object] | None = None,
    slate: Slate | None = None,
) -> None:
    """Write one EXR with several named layers; atomic and verified as `write_picture`.

    Parameters
    ----------
    path : str or path
        Ends in .exr.
    layers : mapping of str to array
        Float arrays of one size, linear light, colors multiplied by alpha. The layer ``"rgba"``
        becomes the channels R, G, B, A; others get their name in front, ``snow.R``. An array
        (H, W, 3) or (H, W, 4) is a color, (H, W, 2) a vector with the channels X and Y, or u and v
        where the name ends in "forward" or "backward", and (H, W) a number: ``depth.Z``,
        ``alpha.A``, ``mask.A``, ``coverage.A``, else ``name.Y``.
    half : bool, default True
        Store colors and masks as half. Depths, vectors and ids always have 32 bits: as half, a
        depth of 3 km is known to 2 m.
    metadata : mapping, optional
        As `write_picture`.
    slate : Slate, optional
        As `write_picture`.

    Raises
    ------
    ValueError
        If a name or a shape is not as above, sizes differ, or `path` does not end in .exr.
    TypeError
        If an array does not hold floats.
    OSError
        If the file cannot be written or does not read back.
    """
    require_exr(path, "layers")
    strings, said = header.checked(metadata), Slate.of(slate)
    specification, band = part_of(layers, half)
    header.put(specification, strings, "openexr")
    said.put(specification, "openexr", "linear")
    write_bands(path, specification, band, lossless=True)


def require_exr(path: str | os.PathLike[str], content: str) -> None:
    """Refuse another format for what only EXR holds."""
    if format_of(path).name != "openexr":
        raise ValueError(f"{os.fspath(path)}: only .exr holds {content}")


def part_of(layers: Mapping[str, npt.ArrayLike], half: bool) -> tuple[Any, Band]:
    """Return layers as `write_layers` takes them as a part of a file, see `write_parts`."""
    planes: dict[str, tuple[Array, bool]] = {}
    sizes = set()
    for name, values in mapping("layers", layers).items():
        array = _checked_layer(name, values)
        sizes.add(array.shape[:2])
        last = name.rpartition(".")[2]
        precise = not half or last in _PRECISE or array.shape[2] == 2
        for number, channel in enumerate(_channels(name, array.shape[2])):
            planes[channel] = (array[..., number], precise)
    if not planes:
        raise ValueError("layers must not be empty")
    if len(sizes) > 1:
        raise ValueError(f"layers must have one size, got {sorted(sizes)}")

    def band(first: int, last: int) -> Array:
        # One type for all: halves are rounded here, so that the check compares what is stored.
        rows = [
            to_single(plane[first:last] if precise else to_half(plane[first:last]))
            for plane, precise in planes.values()
        ]
        return np.stack(rows, axis=-1)

    library = openimageio()
    height, width = sizes.pop()
    kinds = ["float" if precise else "half" for _, precise in planes.values()]
    # Where all channels are alike the common type counts, not the list of theirs.
    specification = library.ImageSpec(width, height, len(planes), max(kinds, key=kinds.count))
    specification.channelnames = tuple(planes)
    if len(set(kinds)) > 1:
        specification.channelformats = tuple(map(library.TypeDesc, kinds))
    specification.alpha_channel = specification.channelindex("A")
    specification.attribute("compression", packing("zip"))
    return specification, band


def read_layers(path: str | os.PathLike[str], *, budget: Budget | None = None) -> dict[str, Array]:
    """Read all layers of an EXR, the inverse of `write_layers`.

    Parameters
    ----------
    path : str or path
    budget : Budget, optional
        As `read_picture`.

    Returns
    -------
    dict of str to ndarray
        float32, (H, W) for single channels and (H, W, C) else; the display window is not applied.

    Raises
    ------
    FileNotFoundError, OSError, ValueError
        As `read_picture`.
    """
    with opened_picture(path, budget) as opened:
        spec = opened.specification
        places: dict[str, list[int]] = {}
        for place, name in enumerate(spec.channelnames):
            places.setdefault(name.rpartition(".")[0] or MAIN, []).append(place)
        for group in places.values():
            group.sort(key=lambda place: _ORDER.find(spec.channelnames[place][-1:]))
        found: dict[str, Array] = {}
        for rows, band in opened.bands(range(spec.nchannels), "float"):
            for name, group in places.items():
                if name not in found:
                    found[name] = np.empty((spec.height, spec.width, len(group)), np.float32)
                found[name][rows] = band[..., group]
    return {name: plane[..., 0] if plane.shape[2] == 1 else plane for name, plane in found.items()}


def _checked_layer(name: str, values: npt.ArrayLike) -> Array:
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ValueError(
            f"layers: the name {name!r} must be letters, digits and '_', parts joined by '.'"
        )
    array = np.asarray(values)
    if array.dtype.kind != "f":
        raise TypeError(f"layers: {name!r} must hold floats, got {array.dtype}")
    if array.ndim == 2:
        array = array[..., np.newaxis]
    if array.ndim != 3 or not 1 <= array.shape[2] <= 4 or 0 in array.shape:
        raise ValueError(
            f"layers: {name!r} must be (H, W), (H, W, 2), (H, W, 3) or (H, W, 4), "
            f"got {np.shape(values)}"
        )
    return array


def _channels(name: str, count: int) -> list[str]:
    """Return the channel names of one layer."""
    if count == 1:
        own = [_SINGLE.get(name.rpartition(".")[2], "Y")]
    elif count == 2:
        own = ["u", "v"] if name.rpartition(".")[2] in _FLOW else ["X", "Y"]
    else:
        own = ["R", "G", "B", "A"][:count]
    return own if name == MAIN else [f"{name}.{channel}" for channel in own]
