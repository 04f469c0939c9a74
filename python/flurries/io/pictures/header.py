"""Opening a picture: what it holds and where its colors are, before any pixel is decoded."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import flag
from flurries.io.color import Array, Encoding
from flurries.io.files import Budget, plain_file, require_whole_png
from flurries.io.oiio import last_error, let_open, libraries_silent, openimageio

# Pixels that are decoded at a time, in whole blocks of compression of so many rows.
_CHUNK, _ROWS = 1 << 20, 256

# NumPy's names for the types of numbers, where OpenImageIO's are others.
_DTYPES = {"half": "float16", "float": "float32", "uint": "uint32"}


@dataclass(frozen=True)
class Header:
    """The header of a picture.

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
    display : (left, top, width, height) or None
        Where the display window lies in what `size` says, px; None where it is all of it.
    aspect : float
        Width of a pixel over its height.
    rate : Fraction or None
        Frames per second, if the header has them.
    curve : str
        What a DPX says of its numbers: "Logarithmic", "Linear" and so on; empty of other formats.
    moves : bool
        Whether it holds several pictures to be shown after each other, as GIF and WebP may.
    """

    path: str
    size: tuple[int, int]
    channels: tuple[str, ...]
    encoding: Encoding
    display: tuple[int, int, int, int] | None = None
    aspect: float = 1.0
    rate: Fraction | None = None
    moves: bool = False
    curve: str = ""


@dataclass(frozen=True)
class Opened:
    """A picture that is open, and where in it the colors are."""

    path: Path
    reader: Any
    specification: Any
    part: int
    color: tuple[int, ...]
    alpha: int | None
    budget: Budget
    overscan: bool = False

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
    def frame_window(self) -> tuple[int, int, int, int]:
        """The window of all that is stored or shown, as `window`: overscan is around the latter."""
        left, top, width, height = self.window
        spec = self.specification
        if self.orientation != 1 or not self.overscan:
            return left, top, width, height
        first, above = min(left, 0), min(top, 0)
        last, below = max(left + width, spec.width), max(top + height, spec.height)
        return first, above, last - first, below - above

    @property
    def display(self) -> tuple[int, int, int, int] | None:
        """The display window's place in the picture with its overscan; None without any."""
        left, top, width, height = self.window
        first, above, across, down = self.frame_window
        found = (left - first, top - above, width, height)
        return None if found == (0, 0, across, down) else found

    @property
    def aspect(self) -> float:
        """Width of a pixel over its height; 1 where it makes no sense."""
        said = self.specification.get_float_attribute("PixelAspectRatio", 1.0)
        said = said if 0.05 <= said <= 20.0 else 1.0
        return 1.0 / said if self.orientation >= 5 else said

    @property
    def size(self) -> tuple[int, int]:
        _, _, width, height = self.frame_window
        return (height, width) if self.orientation >= 5 else (width, height)

    def parts(self) -> list[Any]:
        return _parts(self.reader)

    def read(self, channels: Sequence[int], kind: str, *, part: int | None = None) -> Array:
        """Return channels of a part as stored, (h, w, c); see `bands`."""
        return self.read_groups([channels], kind, part=part)[0]

    def read_groups(
        self, groups: Sequence[Sequence[int]], kind: str, *, part: int | None = None
    ) -> list[Array]:
        """Return groups of channels of a part, each as `read` does; the file is decoded once."""
        channels = [channel for group in groups for channel in group]
        ends = np.cumsum([len(group) for group in groups])[:-1]
        spec = self.specification if part is None else self.reader.spec(part)
        made: list[Array] = []
        for rows, band in self.bands(channels, kind, part=part):
            parts = np.split(band, ends, axis=2)
            made = made or [np.empty((spec.height, *one.shape[1:]), band.dtype) for one in parts]
            for plane, values in zip(made, parts, strict=True):
                plane[rows] = values
        return made

    def bands(
        self, channels: Sequence[int], kind: str, *, part: int | None = None, step: int = 0
    ) -> Iterator[tuple[slice, Array]]:
        """Yield channels of a part as stored, some rows at a time: where, and (rows, w, c)."""
        number = self.part if part is None else part
        spec = self.reader.spec(number)
        size = np.dtype(_DTYPES.get(kind, kind)).itemsize * len(channels)
        # What is shown is another array where it is not what is stored.
        whole = self.frame_window == (0, 0, spec.width, spec.height) and self.orientation == 1
        for shown in ((spec.width, spec.height), self.size):
            self.budget.admit(self.path, shown, size if whole else 2 * size)
        first, last = min(channels), max(channels) + 1
        wanted = [channel - first for channel in channels]
        in_order = wanted == list(range(last - first))
        step = step or max(_CHUNK // spec.width // _ROWS, 1) * _ROWS
        if spec.tile_height:
            step = -(-step // spec.tile_height) * spec.tile_height
        for top in range(0, spec.height, step):
            bottom = min(top + step, spec.height)
            rows = spec.y + top, spec.y + bottom
            if spec.tile_width:
                box = (spec.x, spec.x + spec.width, *rows, 0, 1)
                band = self.reader.read_tiles(number, 0, *box, first, last, kind)
            else:
                band = self.reader.read_scanlines(number, 0, *rows, 0, first, last, kind)
            # libjpeg fills what is missing with grey, returns it as a success, leaves a message.
            if band is None or self.reader.has_error:
                reason = last_error(self.reader) or "no reason given"
                raise OSError(f"{self.path}: the picture is damaged or cut short: {reason}")
            band = band.reshape(bottom - top, spec.width, last - first)
            yield slice(top, bottom), band if in_order else band[..., wanted]

    def shown(self, values: Array, outside: float = 0.0) -> Array:
        """Return the shown part of stored values (h, w, c): the display window, upright."""
        left, top, width, height = self.frame_window
        stored_height, stored_width = values.shape[:2]
        if (left, top, width, height) != (0, 0, stored_width, stored_height):
            framed = np.full((height, width, values.shape[2]), outside, values.dtype)
            rows = slice(max(top, 0), max(min(top + height, stored_height), 0))
            columns = slice(max(left, 0), max(min(left + width, stored_width), 0))
            part = values[rows, columns]
            y, x = max(-top, 0), max(-left, 0)
            framed[y : y + part.shape[0], x : x + part.shape[1]] = part
            values = framed
        return upright(values, self.orientation)


def read_header(
    path: str | os.PathLike[str], *, overscan: bool = False, deep: bool = False
) -> Header:
    """Read what a picture says about itself, without decoding its pixels.

    Parameters
    ----------
    path : str or path
    overscan : bool
        Whether the size is that of all that is stored, not of the display window alone.
    deep : bool
        Whether it may be deep, with many samples in a pixel.
    """
    with opened_picture(path, overscan=overscan, deep=deep) as opened:
        return Header(
            path=str(opened.path),
            size=opened.size,
            channels=tuple(opened.specification.channelnames),
            encoding=opened.encoding,
            display=opened.display,
            aspect=opened.aspect,
            rate=rate_of(opened.specification),
            curve=opened.specification.get_string_attribute("dpx:Transfer"),
            moves=(
                opened.reader.format_name() in ("gif", "webp") and opened.reader.seek_subimage(1, 0)
            ),
        )


@contextmanager
def opened_picture(
    path: str | os.PathLike[str], budget: Budget | None = None, *, overscan: bool = False,
    deep: bool = False,
) -> Iterator[Opened]:  # fmt: skip
    """Open a picture and find its colors."""
    flag("overscan", overscan)
    flag("deep", deep)
    found = plain_file(path)
    limits = Budget.of(budget)
    if found.stat().st_size == 0:
        raise OSError(f"{found}: the file is empty")
    require_whole_png(found, f"{found}: the picture is damaged or cut short")
    with libraries_silent():
        reader = reader_of(found, limits)
        try:
            part, spec = _part_with_color(found, reader, deep=deep)
            color, alpha = find_channels(spec.channelnames, spec.nchannels, spec.alpha_channel)
            opened = Opened(found, reader, spec, part, color, alpha, limits, overscan)
            for size in ((spec.width, spec.height), opened.size):
                limits.admit(found, size, 1)
            if spec.tile_width:
                limits.admit(found, (spec.tile_width, spec.tile_height), 1)
            yield opened
        except UnicodeDecodeError as error:
            raise OSError(
                f"{found}: the picture's header is damaged: a name is not text"
            ) from error
        finally:
            reader.close()


def reader_of(path: Path, budget: Budget) -> Any:
    library = openimageio()
    let_open(budget.bytes)
    wishes = library.ImageSpec()
    # As stored: without this, colors of PNG come multiplied by alpha and rounded to integers.
    wishes.attribute("oiio:UnassociatedAlpha", 1)
    reader = library.ImageInput.open(str(path), wishes)
    if reader is None:
        reason = last_error()
        if path.suffix.lower().lstrip(".") in _extensions(library):
            raise OSError(f"{path}: the picture cannot be read: {reason}")
        raise ValueError(f"{path}: not a picture of a known format")
    # Readers that were tried before the right one leave complaints in the global list. The reader's
    # own are kept: a progressive JPEG is decoded on opening, and tells then that it is cut short.
    last_error()
    if reader.format_name() in ("null", "term"):
        # The null format invents a black picture for any file with its extension.
        raise ValueError(f"{path}: not a picture of a known format")
    return reader


def find_channels(
    names: Sequence[str], count: int, stated_alpha: int = -1
) -> tuple[tuple[int, ...], int | None]:
    """Return the channels of the colors (one or three) and of the alpha, by their names."""
    # OpenImageIO's own note about alpha may point at a layer's, or past the end.
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


def _parts(reader: Any) -> list[Any]:
    """Return the specifications of all parts of a file, of a thousand at most."""
    stated = reader.spec(0).get_int_attribute("oiio:subimages", 1)
    return [reader.spec(part) for part in range(min(max(stated, 1), 1000))]


def _part_with_color(path: Path, reader: Any, *, deep: bool) -> tuple[int, Any]:
    """Return the first part of a picture that holds red, green and blue, or else its first."""
    parts = _parts(reader) if reader.format_name() == "openexr" else [reader.spec()]
    chosen = next((n for n, part in enumerate(parts) if {"R", "G", "B"} <= {*part.channelnames}), 0)
    spec = parts[chosen]
    if spec.deep and not deep:
        raise ValueError(f"{path}: deep pictures, with many samples in a pixel, are not supported")
    if {"RY", "BY"} & {*spec.channelnames}:
        raise ValueError(f"{path}: pictures in luminance and chroma are not supported")
    if spec.nchannels < 1:
        raise OSError(f"{path}: the picture has no channels")
    return chosen, spec


# What a header calls frames a second: OpenEXR, and OpenImageIO.
RATES = ("framesPerSecond", "FramesPerSecond")


def rate_of(specification: Any) -> Fraction | None:
    for name in RATES:
        value = specification.getattribute(name)
        if value is None:
            continue
        try:
            rate = Fraction(*value) if isinstance(value, tuple) else Fraction(float(value))
        except (TypeError, ValueError, ZeroDivisionError, OverflowError):
            continue
        if 0 < rate <= 1000:
            return rate.limit_denominator(100_000)
    return None


def upright(values: Array, orientation: int) -> Array:
    """Turn and mirror an array as its EXIF orientation asks."""
    if orientation in (5, 7):
        values = values.swapaxes(0, 1)
        return values if orientation == 5 else values[::-1, ::-1]
    if orientation in (2, 4):
        return values[:, ::-1] if orientation == 2 else values[::-1]
    return np.rot90(values, {3: 2, 6: -1, 8: 1}.get(orientation, 0))


def _extensions(library: Any) -> set[str]:
    listed = library.get_string_attribute("extension_list")
    return {name for group in listed.split(";") for name in group.partition(":")[2].split(",")}
