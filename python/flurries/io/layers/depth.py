"""Depth from files: the one float channel that holds it, as rendering programs write it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import depths
from flurries._warnings import warn_of_units
from flurries.io.color import Array
from flurries.io.files import Budget
from flurries.io.pictures.header import Opened, opened_picture

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
    budget, overscan
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


def require_depth(path: Path, budget: Budget | None) -> None:
    """Refuse a file without depth, before any frame is asked for."""
    with opened_picture(path, budget) as opened:
        _channel_of(opened)
