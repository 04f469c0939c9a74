"""Depth from files: the one float channel that holds it, as rendering programs write it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import depths
from flurries.io.color import Array
from flurries.io.headers import Opened, open_picture
from flurries.io.pictures import Picture, seen
from flurries.io.sources import SequenceSource, Source, StillSource

# What programs call the channel, alone or at the end of a layer's name.
_NAMES = ("Z", "z", "depth", "Depth", "DEPTH")


def read_depth(path: str | os.PathLike[str]) -> Array:
    """Read the depth channel of a picture.

    Parameters
    ----------
    path : str or path
        EXR or TIFF with a float channel named "Z" or "depth", alone or at the end of a layer's name
        (``ViewLayer.Depth.Z``), in any part; or with a single float channel.

    Returns
    -------
    (H, W) float32
        As stored; outside an EXR's data window it is infinity.

    Raises
    ------
    FileNotFoundError, OSError
        If the file cannot be read, or is damaged.
    ValueError
        If it has no such channel, or a depth is not greater than 0 (NaN is not).
    """
    opened = open_picture(path)
    part, channel = _channel_of(opened)
    values = opened.reader.read_image(part, 0, channel, channel + 1, "float")
    if values is None or opened.reader.has_error:
        raise opened.failure("the picture is damaged or cut short")
    opened.reader.close()
    plane = values.reshape(*values.shape[:2], 1)
    depth = np.ascontiguousarray(seen(plane, opened, np.inf)[..., 0])
    return depths(f"{opened.path}: depth", depth)


def _channel_of(opened: Opened) -> tuple[int, int]:
    """Return part and channel of the depth."""
    first = opened.reader.spec()
    parts = first.get_int_attribute("oiio:subimages", 1)
    specs = [opened.reader.spec(part) for part in range(min(max(parts, 1), 1000))]
    for ending in (False, True):
        for wanted in _NAMES:
            for part, spec in enumerate(specs):
                for channel, name in enumerate(spec.channelnames):
                    short = name.rpartition(".")[2] if ending else name
                    if short == wanted and _is_float(spec, channel):
                        return part, channel
    if len(specs) == 1 and first.nchannels == 1 and _is_float(first, 0):
        return 0, 0
    names = ", ".join(name for spec in specs for name in spec.channelnames)
    raise ValueError(
        f"{opened.path}: no float channel 'Z' or 'depth' among {names}; a grey picture becomes "
        "depths through DepthMap"
    )


def _is_float(spec: Any, channel: int) -> bool:
    return str(spec.channelformat(channel)) in ("half", "float", "double")


class DepthStill(StillSource):
    """One depth for all frames; its picture's pixels are (H, W)."""

    def __init__(self, spec: str) -> None:
        super().__init__(spec, "stop")
        _require(Path(spec))

    def _picture(self, path: str | Path) -> Picture:
        return _picture(path)


class DepthSequence(SequenceSource):
    """A depth per frame; its pictures' pixels are (H, W)."""

    def __init__(self, spec: str) -> None:
        super().__init__(spec, "stop")
        _require(self._path(self.first))

    def _picture(self, path: str | Path) -> Picture:
        return _picture(path)


def _require(path: Path) -> None:
    """Refuse a file without depth before any frame is asked for."""
    opened = open_picture(path)
    _channel_of(opened)
    opened.reader.close()


def _picture(path: str | Path) -> Picture:
    return Picture(read_depth(path), None, "linear", str(path))


def open_depth(spec: str | os.PathLike[str]) -> Source:
    """Open depth: a picture, or a numbered sequence of pictures.

    Parameters
    ----------
    spec : str or path
        ``depth.exr`` or ``depth.%04d.exr``; see :func:`read_depth`.

    Returns
    -------
    Source
        Its pictures' pixels are (H, W) float32.

    Raises
    ------
    FileNotFoundError, OSError, ValueError
        As :func:`read_depth`.
    """
    text = os.fspath(spec)
    if not isinstance(text, str):
        raise TypeError(f"depth must be a string or a path, got {type(spec).__name__}")
    if not text or "\0" in text:
        raise ValueError(f"depth must name a file, got {text!r}")
    path = Path(text).absolute()
    if "%" in path.name and not path.exists():
        return DepthSequence(str(path))
    return DepthStill(str(path))
