"""EXR pictures with layers for several eyes: a part of the file for each."""

from __future__ import annotations

import os
from collections.abc import Mapping

import numpy.typing as npt

from flurries._contract import mapping
from flurries.io import metadata as header
from flurries.io.bands import write_parts
from flurries.io.layers import part_of
from flurries.io.writing import format_of


def write_layer_views(
    path: str | os.PathLike[str],
    views: Mapping[str, Mapping[str, npt.ArrayLike]],
    *,
    half: bool = True,
    metadata: Mapping[str, object] | None = None,
) -> None:
    """Write one EXR with several views; atomic and verified as `write_picture`.

    Parameters
    ----------
    path : str or path
        Ends in .exr.
    views : mapping of str to mapping
        The layers of each view, as `write_layers` takes them: usually of "left" and "right". Each
        view becomes a part of the file that is called as the view and says so in its header, as
        stereo programs expect it.
    half : bool, default True
        As `write_layers`.
    metadata : mapping, optional
        As `write_picture`; in the header of each part.

    Raises
    ------
    ValueError
        If a name is no name or the file does not end in .exr, and as `write_layers`.
    TypeError, OSError
        As `write_layers`.
    """
    if format_of(path).name != "openexr":
        raise ValueError(f"{os.fspath(path)}: only .exr holds views")
    if not mapping("views", views):
        raise ValueError("views must name at least one view, got none")
    strings = header.checked(metadata)
    parts = []
    for name, layers in views.items():
        if not isinstance(name, str) or not name.isidentifier():
            raise ValueError(f"views must be called like 'left' and 'right', got {name!r}")
        specification, band = part_of(layers, half)
        specification.attribute("view", name)
        specification.attribute("oiio:subimagename", name)
        header.put(specification, strings, "openexr")
        parts.append((specification, band))
    write_parts(path, parts)
