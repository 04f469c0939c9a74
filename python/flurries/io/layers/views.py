"""EXR files that hold what two eyes see: as two parts, or as two views of one part."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from flurries._contract import mapping
from flurries.io.color import Array
from flurries.io.files import Budget
from flurries.io.layers.planes import MAIN, part_of, require_exr
from flurries.io.oiio import openimageio
from flurries.io.pictures import metadata as header
from flurries.io.pictures.header import Opened, opened_picture
from flurries.io.pictures.rows import Band, write_bands, write_parts
from flurries.io.pictures.slate import Slate

VIEWS = ("left", "right")
Layout: TypeAlias = Literal["parts", "views"]
LAYOUTS = get_args(Layout)


def write_views(
    path: str | os.PathLike[str],
    left: npt.ArrayLike,
    right: npt.ArrayLike,
    *,
    layout: Layout = "parts",
    half: bool = True,
    metadata: Mapping[str, object] | None = None,
) -> None:
    """Write the pictures of two eyes into one EXR; atomic and verified as `write_picture`.

    Parameters
    ----------
    path : str or path
        Ends in .exr.
    left, right : array
        (H, W, 3), or (H, W, 4) multiplied by alpha; float, linear light, both of one shape.
    layout : {"parts", "views"}
        "parts": two parts, each named and marked as a view, with the channels R, G, B (A).
        "views": one part with the channels of the left eye as they are and the right eye's as
        ``right.R``, and the attribute ``multiView``. Programs read the first more often.
    half : bool, default True
        Store as half, 16 bits; False stores 32.
    metadata : mapping, optional
        As `write_picture`.

    Raises
    ------
    ValueError
        If shapes or the extension are not as above.
    TypeError
        If a picture does not hold floats.
    OSError
        If the file cannot be written or does not read back.
    """
    require_exr(path, "two views")
    if layout not in LAYOUTS:
        raise ValueError(f"layout must be 'parts' or 'views', got {layout!r}")
    strings = header.checked(metadata)
    eyes = [_checked(name, eye) for name, eye in zip(VIEWS, (left, right), strict=True)]
    if eyes[0].shape != eyes[1].shape:
        raise ValueError(f"right must have the shape of left {eyes[0].shape}, got {eyes[1].shape}")
    if layout == "parts":
        parts = [part_of({MAIN: eye}, half) for eye in eyes]
        write_parts(path, [_view(*named, strings) for named in zip(VIEWS, parts, strict=True)])
        return
    specification, band = part_of({MAIN: eyes[0], "right": eyes[1]}, half)
    specification.attribute("multiView", openimageio().TypeDesc("string[2]"), VIEWS)
    header.put(specification, strings, "openexr")
    write_bands(path, specification, band, lossless=True)


def read_views(
    path: str | os.PathLike[str], *, budget: Budget | None = None
) -> tuple[Array, Array]:
    """Read the pictures of two eyes from an EXR of either layout, the inverse of `write_views`.

    Parameters
    ----------
    path : str or path
    budget : Budget, optional
        As `read_picture`, for each eye.

    Returns
    -------
    left, right : (H, W, 3 or 4) float32
        Linear light.

    Raises
    ------
    FileNotFoundError, OSError, ValueError
        As `read_picture`; ValueError also if the file does not hold two views.
    """
    with opened_picture(path, budget) as opened:
        parts = opened.parts()
        names = [part.get_string_attribute("view") for part in parts]
        if set(VIEWS) <= set(names):
            return _eye(opened, names.index("left")), _eye(opened, names.index("right"))
        if tuple(parts[0].getattribute("multiView") or ()) == VIEWS:
            return _eye(opened, 0), _eye(opened, 0, "right.")
        raise ValueError(f"{opened.path}: does not hold a left and a right view")


def write_layer_views(
    path: str | os.PathLike[str],
    views: Mapping[str, Mapping[str, npt.ArrayLike]],
    *,
    half: bool = True,
    metadata: Mapping[str, object] | None = None,
    slate: Slate | None = None,
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
    slate : Slate, optional
        As `write_picture`; in the header of each part.

    Raises
    ------
    ValueError
        If a name is no name or the file does not end in .exr, and as `write_layers`.
    TypeError, OSError
        As `write_layers`.
    """
    require_exr(path, "views")
    if not mapping("views", views):
        raise ValueError("views must name at least one view, got none")
    strings, said = header.checked(metadata), Slate.of(slate)
    parts = []
    for name, layers in views.items():
        if not isinstance(name, str) or not name.isidentifier():
            raise ValueError(f"views must be called like 'left' and 'right', got {name!r}")
        part = _view(name, part_of(layers, half), strings)
        said.put(part[0], "openexr", "linear")
        parts.append(part)
    write_parts(path, parts)


def _view(name: str, part: tuple[Any, Band], strings: Mapping[str, str]) -> tuple[Any, Band]:
    """Return a part of a file that says in its header which eye it is."""
    specification, band = part
    specification.attribute("view", name)
    specification.attribute("oiio:subimagename", name)
    header.put(specification, strings, "openexr")
    return specification, band


def _checked(name: str, values: npt.ArrayLike) -> Array:
    array = np.asarray(values)
    if array.dtype.kind != "f":
        raise TypeError(f"{name} must hold floats, got {array.dtype}")
    if array.ndim != 3 or array.shape[2] not in (3, 4) or 0 in array.shape:
        raise ValueError(f"{name} must be (H, W, 3) or (H, W, 4), got {array.shape}")
    return array


def _eye(opened: Opened, part: int, prefix: str = "") -> Array:
    """Return the colors of a part whose names begin with `prefix`, and alpha where there is one."""
    names = list(opened.reader.spec(part).channelnames)
    wanted = [prefix + name for name in ("R", "G", "B", "A") if prefix + name in names]
    if len(wanted) < 3:
        raise ValueError(f"{opened.path}: a view has no red, green and blue")
    return opened.read([names.index(name) for name in wanted], "float", part=part)
