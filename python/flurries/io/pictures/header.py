"""Opening a picture: what it holds and where its colors are, before any pixel is decoded."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from flurries._contract import Array, PathLike, flag
from flurries.io.color import Encoding
from flurries.io.files import Budget, given, plain_file
from flurries.io.oiio import last_error, let_open, libraries_silent, openimageio

Window: TypeAlias = tuple[int, int, int, int]  # Left, top, width and height, px.

# Pixels that are decoded at a time, in whole blocks of compression of so many rows.
_CHUNK, _ROWS = 1 << 20, 256

# NumPy's names for the types of numbers, where OpenImageIO's are others.
_DTYPES = {"half": "float16", "float": "float32", "uint": "uint32"}

FLOATS = ("half", "float", "double")

# What a header calls frames a second: OpenEXR, and OpenImageIO.
RATES = ("framesPerSecond", "FramesPerSecond")


@dataclass(frozen=True)
class Opened:
    """A part of a picture that is open, and where in it the colors are."""

    path: Path
    reader: Any
    budget: Budget
    frame: Window  # What comes, as the header counts: the display window, or overscan too.
    orientation: int
    part: int
    specification: Any
    color: tuple[int, ...]
    alpha: int | None

    def at(self, part: int) -> Opened:
        """Return another part, of which the same window comes."""
        spec = self.reader.spec(part)
        color, alpha = _channels(spec)
        return replace(self, part=part, specification=spec, color=color, alpha=alpha)

    @property
    def parts(self) -> list[Any]:
        """The specifications of all parts, of a thousand at most."""
        stated = self.reader.spec(0).get_int_attribute("oiio:subimages", 1)
        return [self.reader.spec(part) for part in range(min(max(stated, 1), 1000))]

    @property
    def stored_type(self) -> str:
        """The type of the color channels in the file, as OpenImageIO calls it."""
        return str(self.specification.channelformat(self.color[0]))

    @property
    def encoding(self) -> Encoding:
        return "linear" if self.stored_type in FLOATS else "display"

    @property
    def is_exr(self) -> bool:
        return bool(self.reader.format_name() == "openexr")

    @property
    def window(self) -> Window:
        """The window of what comes, from the part's first stored pixel."""
        (left, top, *size), spec = self.frame, self.specification
        first, above = (spec.x, spec.y) if self.is_exr else (0, 0)
        return left - first, top - above, size[0], size[1]

    @property
    def display(self) -> Window | None:
        """The display window's place in the picture with its overscan; None without any."""
        (left, top, *_), shown = self.frame, _display_of(self.specification, self.is_exr)
        return None if shown == self.frame else (shown[0] - left, shown[1] - top, *shown[2:])

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) as the user sees it: of what comes, turned upright."""
        _, _, width, height = self.frame
        return (height, width) if self.orientation >= 5 else (width, height)

    @property
    def aspect(self) -> float:
        """Width of a pixel over its height."""
        said = self.specification.get_float_attribute("PixelAspectRatio", 1.0)
        aspect = said if 0.05 <= said <= 20.0 else 1.0
        return 1.0 / aspect if self.orientation >= 5 else aspect

    def read(self, kind: str, *groups: Sequence[int]) -> list[Array]:
        """Return groups of channels as stored, each (h, w, c); the file is decoded once."""
        ends = np.cumsum([len(group) for group in groups])[:-1]
        made: list[Array] = []
        for rows, band in self.bands([channel for group in groups for channel in group], kind):
            parts = np.split(band, ends, axis=2)
            height = self.specification.height
            made = made or [np.empty((height, *one.shape[1:]), band.dtype) for one in parts]
            for plane, values in zip(made, parts, strict=True):
                plane[rows] = values
        return made

    def bands(
        self, channels: Sequence[int], kind: str, step: int = 0
    ) -> Iterator[tuple[slice, Array]]:
        """Yield channels as stored, some rows at a time: where, and (rows, w, c)."""
        spec = self.specification
        size = np.dtype(_DTYPES.get(kind, kind)).itemsize * len(channels)
        # What is shown is another array where it is not what is stored.
        whole = self.window == (0, 0, spec.width, spec.height) and self.orientation == 1
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
                band = self.reader.read_tiles(self.part, 0, *box, first, last, kind)
            else:
                band = self.reader.read_scanlines(self.part, 0, *rows, 0, first, last, kind)
            # libjpeg fills what is missing with grey, returns it as a success, leaves a message.
            if band is None or self.reader.has_error:
                raise self.damage()
            band = band.reshape(bottom - top, spec.width, last - first)
            yield slice(top, bottom), band if in_order else band[..., wanted]

    def damage(self) -> OSError:
        reason = last_error(self.reader) or "no reason given"
        return OSError(f"{self.path}: the picture is damaged or cut short: {reason}")

    def shown(self, values: Array, outside: float = 0.0) -> Array:
        """Return the shown part of stored values (h, w, c): the display window, upright."""
        left, top, width, height = self.window
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


@contextmanager
def opened_picture(
    path: PathLike, budget: Budget | None = None, *, overscan: bool = False, deep: bool = False
) -> Iterator[Opened]:
    """Open a picture, at the first part with red, green and blue, or else its first."""
    flag("overscan", overscan)
    flag("deep", deep)
    found = plain_file(path)
    limits = given("budget", budget, Budget)
    if found.stat().st_size == 0:
        raise OSError(f"{found}: the file is empty")
    data = found.read_bytes() if found.suffix.lower() == ".png" else b""
    if data.startswith(b"\x89PNG") and b"IEND\xaeB`\x82" not in data:
        raise OSError(f"{found}: the picture is damaged or cut short: it lacks its end")
    with libraries_silent():
        reader = _reader_of(found, limits)
        try:
            opened = Opened(found, reader, limits, (0, 0, 0, 0), 1, 0, None, (), None).at(0)
            names = [{*spec.channelnames} for spec in opened.parts] if opened.is_exr else []
            if places := [place for place, own in enumerate(names) if {"R", "G", "B"} <= own]:
                opened = opened.at(places[0])
            spec = opened.specification
            turned = spec.get_int_attribute("Orientation", 1)
            turned = turned if 1 <= turned <= 8 else 1
            frame = _display_of(spec, opened.is_exr)
            if overscan and turned == 1 and opened.is_exr:
                first, above = min(frame[0], spec.x), min(frame[1], spec.y)
                last = max(frame[0] + frame[2], spec.x + spec.width)
                below = max(frame[1] + frame[3], spec.y + spec.height)
                frame = first, above, last - first, below - above
            opened = replace(opened, frame=frame, orientation=turned)
            if spec.deep and not deep:
                raise ValueError(f"{found}: deep pictures, with many samples in a pixel, are not "
                                 "supported")  # fmt: skip
            if {"RY", "BY"} & {*spec.channelnames}:
                raise ValueError(f"{found}: pictures in luminance and chroma are not supported")
            if spec.nchannels < 1:
                raise OSError(f"{found}: the picture has no channels")
            for size in ((spec.width, spec.height), opened.size):
                limits.admit(found, size, 1)
            if spec.tile_width:
                limits.admit(found, (spec.tile_width, spec.tile_height), 1)
            yield opened
        except UnicodeDecodeError as error:
            raise OSError(f"{found}: the header is damaged: a name is not text") from error
        finally:
            reader.close()


def _display_of(spec: Any, is_exr: bool) -> Window:
    # Offsets in other formats are about printing several pictures on one page.
    shown = spec.full_x, spec.full_y, spec.full_width, spec.full_height
    return shown if is_exr else (0, 0, spec.width, spec.height)


def _reader_of(path: Path, budget: Budget) -> Any:
    library = openimageio()
    let_open(budget.bytes)
    wishes = library.ImageSpec()
    # As stored: without this, colors of PNG come multiplied by alpha and rounded to integers.
    wishes.attribute("oiio:UnassociatedAlpha", 1)
    reader = library.ImageInput.open(str(path), wishes)
    if reader is None:
        reason = last_error()
        known = re.split("[:;,]", library.get_string_attribute("extension_list"))
        if path.suffix.lower().lstrip(".") in known:
            raise OSError(f"{path}: the picture cannot be read: {reason}")
    # Readers that were tried before the right one leave complaints in the global list. The reader's
    # own are kept: a progressive JPEG is decoded on opening, and tells then that it is cut short.
    last_error()
    # The null format invents a black picture for any file with its extension.
    if reader is None or reader.format_name() in ("null", "term"):
        raise ValueError(f"{path}: not a picture of a known format")
    return reader


def _channels(spec: Any) -> tuple[tuple[int, ...], int | None]:
    """Return the channels of the colors (one or three) and of the alpha, by their names."""
    # OpenImageIO's own note about alpha may point at a layer's, or past the end.
    places = {name: place for place, name in reversed(list(enumerate(spec.channelnames)))}
    layers = dict.fromkeys(name.rpartition(".")[0] for name in spec.channelnames)
    for prefix in ["", *(f"{layer}." for layer in layers if layer)]:
        for wanted in (("R", "G", "B"), ("r", "g", "b"), ("Y",)):
            color = tuple(places[prefix + name] for name in wanted if prefix + name in places)
            if len(color) == len(wanted):
                return color, places.get(f"{prefix}A", places.get(f"{prefix}a"))
    color = (0, 1, 2) if spec.nchannels >= 3 else (0,)
    return color, spec.alpha_channel if len(color) <= spec.alpha_channel < spec.nchannels else None


def rate_of(specification: Any) -> Fraction | None:
    for name in RATES:
        value = specification.getattribute(name)
        with suppress(TypeError, ValueError, ZeroDivisionError, OverflowError):
            rate = Fraction(*value) if isinstance(value, tuple) else Fraction(float(value))
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
