"""Opening a picture: what it holds and where its colors are, before any pixel is decoded."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flurries.io import metadata
from flurries.io.color import Encoding
from flurries.io.integrity import check_structure
from flurries.io.library import last_error, openimageio

# More pixels are refused before anything is allocated. A picture of 16384 x 16384 has half as many.
LARGEST_PICTURE = 2**29


@dataclass(frozen=True)
class Header:
    """What a picture says about itself.

    Attributes
    ----------
    path : str
        The file.
    size : tuple of int
        (width, height) in px as the user sees it: display window, orientation applied.
    channels : tuple of str
        The names of all channels, in file order.
    encoding : str
        ``"linear"`` for float pixels, ``"display"`` for integers.
    metadata : dict
        What flurries wrote into it, keys without ``flurries:``; empty for other pictures.
    """

    path: str
    size: tuple[int, int]
    channels: tuple[str, ...]
    encoding: Encoding
    metadata: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Opened:
    """A picture that is open, and where in it the colors are."""

    path: Path
    reader: Any
    specification: Any
    part: int
    color: tuple[int, ...]
    alpha: int | None

    @property
    def stored_type(self) -> str:
        """The type of the color channels in the file, as OpenImageIO calls it."""
        return str(self.specification.channelformat(self.color[0]))

    @property
    def encoding(self) -> Encoding:
        """Floats are linear light, integers are display values."""
        return "linear" if self.stored_type in ("half", "float", "double") else "display"

    @property
    def premultiplied(self) -> bool:
        """Whether the colors are multiplied by alpha: in EXR always, in TIFF if it says so."""
        kind = self.reader.format_name()
        straight = self.specification.get_int_attribute("oiio:UnassociatedAlpha") != 0
        return kind == "openexr" or (kind == "tiff" and not straight)

    @property
    def orientation(self) -> int:
        """The EXIF orientation, 1 to 8."""
        stated = self.specification.get_int_attribute("Orientation", 1)
        return stated if 1 <= stated <= 8 else 1

    @property
    def window(self) -> tuple[int, int, int, int]:
        """The display window (left, top, width, height) relative to the first stored pixel."""
        spec = self.specification
        if self.reader.format_name() != "openexr":
            # Offsets in other formats are about printing several pictures on one page.
            return 0, 0, spec.width, spec.height
        return spec.full_x - spec.x, spec.full_y - spec.y, spec.full_width, spec.full_height

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) as the user sees it."""
        _, _, width, height = self.window
        return (height, width) if self.orientation >= 5 else (width, height)

    def failure(self, what: str) -> OSError:
        """Return the error that says what could not be done with this file, and why."""
        reason = last_error(self.reader) or "no reason given"
        return OSError(f"{self.path}: {what}: {reason}")


def read_header(path: str | os.PathLike[str]) -> Header:
    """Read what a picture says about itself, without decoding its pixels.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    OSError
        If the file is damaged.
    ValueError
        If it is not a picture of a known format.
    """
    opened = open_picture(path)
    spec = opened.specification
    found = Header(
        path=str(opened.path),
        size=opened.size,
        channels=tuple(spec.channelnames),
        encoding=opened.encoding,
        metadata=metadata.get(spec),
    )
    opened.reader.close()
    return found


def plain_file(path: str | os.PathLike[str]) -> Path:
    """Return `path` as a Path if it is a file that can be read, else raise an error that says so.

    Opening a FIFO would wait for ever, and a device may never end.
    """
    text = os.fspath(path)
    if not isinstance(text, str):
        raise TypeError(f"path must be a string or a path, got {type(path).__name__}")
    if not text or "\0" in text:
        raise ValueError(f"path must name a file, got {text!r}")
    found = Path(text)
    mode = found.stat().st_mode  # FileNotFoundError names the file by itself.
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "Is a folder, not a file", text)
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "Is not a plain file", text)
    if not os.access(found, os.R_OK):
        raise PermissionError(errno.EACCES, "Cannot be read", text)
    return found


def open_picture(path: str | os.PathLike[str]) -> Opened:
    """Open a picture, check that it is whole as far as its structure tells, find its colors."""
    found = plain_file(path)
    check_structure(found)
    library = openimageio()
    wishes = library.ImageSpec()
    # As stored: without this, colors of PNG come multiplied by alpha and rounded to integers.
    wishes.attribute("oiio:UnassociatedAlpha", 1)
    reader = library.ImageInput.open(str(found), wishes)
    if reader is None:
        reason = last_error()
        if found.suffix.lower().lstrip(".") in _extensions(library):
            raise OSError(f"{found}: the picture cannot be read: {reason}")
        raise ValueError(f"{found}: not a picture of a known format")
    # Readers that were tried before the right one leave complaints in the global list. The reader's
    # own are kept: a progressive JPEG is decoded on opening, and tells then that it is cut short.
    last_error()
    if reader.format_name() in ("null", "term"):
        # The null format invents a black picture for any file with its extension.
        raise ValueError(f"{found}: not a picture of a known format")
    try:
        part, spec = _part_with_color(found, reader)
        color, alpha = find_channels(spec.channelnames, spec.nchannels, spec.alpha_channel)
    except UnicodeDecodeError as error:
        raise OSError(f"{found}: the picture's header is damaged: a name is not text") from error
    opened = Opened(found, reader, spec, part, color, alpha)
    for width, height in ((spec.width, spec.height), opened.size):
        if not 0 < width * height <= LARGEST_PICTURE:
            raise OSError(
                f"{found}: the picture claims {width} x {height} px, "
                f"more than the {LARGEST_PICTURE} that are allowed"
            )
    return opened


def find_channels(
    names: Sequence[str], count: int, stated_alpha: int = -1
) -> tuple[tuple[int, ...], int | None]:
    """Return where the colors (one or three channels) and the alpha are.

    Named channels count first: R, G, B and A, then Y and A, then the same names of the first layer
    that has them. OpenImageIO's own note about alpha may point at a layer's, or past the end.
    """
    places = {name: place for place, name in reversed(list(enumerate(names)))}
    layers = dict.fromkeys(name.rpartition(".")[0] for name in names)
    for prefix in ["", *(f"{layer}." for layer in layers if layer)]:
        for wanted in (("R", "G", "B"), ("r", "g", "b"), ("Y",)):
            color = tuple(places[prefix + name] for name in wanted if prefix + name in places)
            if len(color) == len(wanted):
                return color, places.get(f"{prefix}A", places.get(f"{prefix}a"))
    color = (0, 1, 2) if count >= 3 else (0,)
    alpha = stated_alpha if len(color) <= stated_alpha < count else None
    return color, alpha


def _part_with_color(path: Path, reader: Any) -> tuple[int, Any]:
    """Return the first part of a picture that holds red, green and blue, or else its first."""
    spec = reader.spec()
    parts = [spec]
    if reader.format_name() == "openexr":
        stated = spec.get_int_attribute("oiio:subimages", 1)
        parts += [reader.spec(part) for part in range(1, min(stated, 1000))]
    chosen = next((n for n, part in enumerate(parts) if {"R", "G", "B"} <= {*part.channelnames}), 0)
    spec = parts[chosen]
    if spec.deep:
        raise ValueError(f"{path}: deep pictures, with many samples in a pixel, are not supported")
    if {"RY", "BY"} & {*spec.channelnames}:
        raise ValueError(f"{path}: pictures in luminance and chroma are not supported")
    if spec.nchannels < 1:
        raise OSError(f"{path}: the picture has no channels")
    return chosen, spec


def _extensions(library: Any) -> set[str]:
    listed = library.get_string_attribute("extension_list")
    return {name for group in listed.split(";") for name in group.partition(":")[2].split(",")}
