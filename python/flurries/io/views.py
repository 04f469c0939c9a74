"""EXR files that hold what two eyes see: as two parts, or as two views of one part."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries.io import metadata as header
from flurries.io.atomic import replacing
from flurries.io.bands import write_bands
from flurries.io.color import Array, to_half, to_single
from flurries.io.headers import open_picture
from flurries.io.library import last_error, openimageio
from flurries.io.writing import format_of

VIEWS = ("left", "right")
LAYOUTS = ("parts", "views")


def write_views(
    path: str | os.PathLike[str],
    left: npt.ArrayLike,
    right: npt.ArrayLike,
    *,
    layout: str = "parts",
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
    if format_of(path).name != "openexr":
        raise ValueError(f"{os.fspath(path)}: only .exr holds two views")
    if layout not in LAYOUTS:
        raise ValueError(f"layout must be 'parts' or 'views', got {layout!r}")
    strings = header.checked(metadata)
    eyes = [_checked(name, eye) for name, eye in zip(VIEWS, (left, right), strict=True)]
    if eyes[0].shape != eyes[1].shape:
        raise ValueError(f"right must have the shape of left {eyes[0].shape}, got {eyes[1].shape}")
    stored = [to_half(eye) if half else to_single(eye) for eye in eyes]
    (_write_parts if layout == "parts" else _write_multiview)(path, stored, strings)


def read_views(path: str | os.PathLike[str]) -> tuple[Array, Array]:
    """Read the pictures of two eyes from an EXR of either layout, the inverse of `write_views`.

    Returns
    -------
    left, right : (H, W, 3 or 4) float32
        Linear light.

    Raises
    ------
    FileNotFoundError, OSError, ValueError
        As `read_picture`; ValueError also if the file does not hold two views.
    """
    opened = open_picture(path)
    reader = opened.reader
    try:
        first = reader.spec(0)
        count = first.get_int_attribute("oiio:subimages", 1)
        names = [reader.spec(part).get_string_attribute("view") for part in range(min(count, 64))]
        if set(VIEWS) <= set(names):
            eyes = [_part(opened, names.index(view)) for view in VIEWS]
        elif tuple(first.getattribute("multiView") or ()) == VIEWS:
            both = _pixels(opened, 0, first)
            eyes = [_channels(both, first, prefix) for prefix in ("", "right.")]
        else:
            raise ValueError(f"{os.fspath(path)}: does not hold a left and a right view")
    finally:
        reader.close()
    return eyes[0], eyes[1]


def _checked(name: str, values: npt.ArrayLike) -> Array:
    array = np.asarray(values)
    if array.dtype.kind != "f":
        raise TypeError(f"{name} must hold floats, got {array.dtype}")
    if array.ndim != 3 or array.shape[2] not in (3, 4) or 0 in array.shape:
        raise ValueError(f"{name} must be (H, W, 3) or (H, W, 4), got {array.shape}")
    return array


def _specification(shape: tuple[int, ...], kind: str, channels: tuple[str, ...]) -> Any:
    specification = openimageio().ImageSpec(shape[1], shape[0], len(channels), kind)
    specification.channelnames = channels
    specification.attribute("compression", "zip")
    if "A" in channels:
        specification.alpha_channel = channels.index("A")
    return specification


def _kind(eye: Array) -> str:
    return "half" if eye.dtype == np.float16 else "float"


def _write_parts(
    path: str | os.PathLike[str], eyes: list[Array], strings: Mapping[str, str]
) -> None:
    library = openimageio()
    target = os.fspath(path)
    parts = []
    for view, eye in zip(VIEWS, eyes, strict=True):
        part = _specification(eye.shape, _kind(eye), ("R", "G", "B", "A")[: eye.shape[2]])
        part.attribute("oiio:subimagename", view)
        part.attribute("view", view)
        header.put(part, strings, "openexr")
        parts.append(part)
    with replacing(path) as temporary:
        output = library.ImageOutput.create(str(temporary))
        if output is None:
            raise ValueError(f"{target}: cannot be written: {last_error()}")
        done = False
        try:
            if not output.open(str(temporary), tuple(parts)):
                raise OSError(f"{target}: cannot be written: {last_error(output)}")
            for number, eye in enumerate(eyes):
                if number and not output.open(str(temporary), parts[number], "AppendSubimage"):
                    raise OSError(f"{target}: cannot be written: {last_error(output)}")
                if not output.write_image(np.ascontiguousarray(eye)):
                    raise OSError(f"{target}: cannot be written: {last_error(output)}")
            done = True
            if not output.close():
                raise OSError(f"{target}: cannot be written: {last_error(output)}")
        finally:
            if not done:
                output.close()
                last_error(output)
        _verify(target, str(temporary), eyes)


def _verify(target: str, temporary: str, eyes: list[Array]) -> None:
    """Read both parts back; a full disk shows here and not next week."""
    reader = openimageio().ImageInput.open(temporary)
    if reader is None:
        raise OSError(f"{target}: cannot be read back: {last_error()}")
    try:
        for number, eye in enumerate(eyes):
            values = reader.read_image(number, 0, 0, eye.shape[2], _kind(eye))
            if values is None or reader.has_error:
                raise OSError(f"{target}: cannot be read back: {last_error(reader)}")
            if np.ascontiguousarray(values).tobytes() != np.ascontiguousarray(eye).tobytes():
                raise OSError(f"{target}: does not read back as what was written")
    finally:
        reader.close()
        last_error(reader)


def _write_multiview(
    path: str | os.PathLike[str], eyes: list[Array], strings: Mapping[str, str]
) -> None:
    names = ("R", "G", "B", "A")[: eyes[0].shape[2]]
    channels = (*names, *(f"right.{name}" for name in names))
    specification = _specification(eyes[0].shape, _kind(eyes[0]), channels)
    specification.attribute("multiView", openimageio().TypeDesc("string[2]"), VIEWS)
    header.put(specification, strings, "openexr")

    def band(first: int, last: int) -> Array:
        return np.concatenate([eye[first:last] for eye in eyes], axis=-1)

    write_bands(path, specification, band, lossless=True)


def _pixels(opened: Any, part: int, spec: Any) -> Array:
    values = opened.reader.read_image(part, 0, 0, spec.nchannels, "float")
    if values is None or opened.reader.has_error:
        raise opened.failure("the picture is damaged or cut short")
    found: Array = values.reshape(spec.height, spec.width, spec.nchannels)
    return found


def _part(opened: Any, part: int) -> Array:
    spec = opened.reader.spec(part)
    return _channels(_pixels(opened, part, spec), spec, "")


def _channels(values: Array, spec: Any, prefix: str) -> Array:
    names = list(spec.channelnames)
    wanted = [prefix + name for name in ("R", "G", "B", "A") if prefix + name in names]
    return np.ascontiguousarray(values[..., [names.index(name) for name in wanted]])
