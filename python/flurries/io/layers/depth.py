"""Depth from files: the one float channel that holds it, as rendering programs write it."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import depths
from flurries._warnings import warn_of_units
from flurries.io.color import Array
from flurries.io.files import Budget
from flurries.io.pictures.header import Opened, opened_picture
from flurries.io.pictures.reader import Picture
from flurries.io.sources import Source, open_pictures

# What programs call the channel, alone or at the end of a layer's name.
_NAMES = ("Z", "z", "depth", "Depth", "DEPTH")


def read_depth(
    path: str | os.PathLike[str], *, budget: Budget | None = None, overscan: bool = False
) -> Array:
    """Read the depth channel of a picture.

    Parameters
    ----------
    path : str or path
        EXR or TIFF with a float channel named "Z" or "depth", alone or at the end of a layer's name
        (``ViewLayer.Depth.Z``), in any part; or with a single float channel.
    budget : Budget, optional
        As `read_picture`.
    overscan : bool
        As `read_picture`.

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
    with opened_picture(path, budget, overscan=overscan) as opened:
        part, channel = _channel_of(opened)
        plane = opened.read([channel], "float", part=part)
        shown = np.ascontiguousarray(opened.shown(plane, np.inf)[..., 0])
    warn_of_units("depth", shown)
    return depths(f"{opened.path}: depth", shown)


def _channel_of(opened: Opened) -> tuple[int, int]:
    """Return part and channel of the depth."""
    specs = opened.parts()
    for ending in (False, True):
        for wanted in _NAMES:
            for part, spec in enumerate(specs):
                for channel, name in enumerate(spec.channelnames):
                    short = name.rpartition(".")[2] if ending else name
                    if short == wanted and _is_float(spec, channel):
                        return part, channel
    if len(specs) == 1 and specs[0].nchannels == 1 and _is_float(specs[0], 0):
        return 0, 0
    names = ", ".join(name for spec in specs for name in spec.channelnames)
    raise ValueError(
        f"{opened.path}: no float channel 'Z' or 'depth' among {names}; a grey picture becomes "
        "depths through DepthMap"
    )


def _is_float(spec: Any, channel: int) -> bool:
    return str(spec.channelformat(channel)) in ("half", "float", "double")


def _picture(path: str | Path, *, budget: Budget | None = None, overscan: bool = False) -> Picture:
    depth = read_depth(path, budget=budget, overscan=overscan)
    return Picture(depth, None, "linear", str(path))


def open_depth(
    spec: str | os.PathLike[str], *, budget: Budget | None = None, overscan: bool = False
) -> Source:
    """Open depth: a picture, or a numbered sequence of pictures.

    Parameters
    ----------
    spec : str or path
        ``depth.exr`` or ``depth.%04d.exr``; see :func:`read_depth`.
    budget : Budget, optional
        As `read_picture`.
    overscan : bool
        As `read_picture`.

    Returns
    -------
    Source
        Its pictures' pixels are (H, W) float32.

    Raises
    ------
    FileNotFoundError, OSError, ValueError
        As :func:`read_depth`.
    """
    read = partial(_picture, budget=budget, overscan=overscan)
    source = open_pictures("depth", spec, read, overscan=overscan)
    # A file without depth is refused before any frame is asked for.
    with opened_picture(source.first_file, budget) as opened:
        _channel_of(opened)
    return source
