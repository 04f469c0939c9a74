"""What a picture's header says: a plate's words go into the frames that are made of it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from numbers import Integral, Real
from typing import Any

import numpy as np

from flurries._contract import PathLike, mapping
from flurries.io.color import Encoding
from flurries.io.files import Budget
from flurries.io.oiio import openimageio
from flurries.io.pictures.header import RATES, Window, opened_picture, rate_of
from flurries.io.timecode import TimeCode

PREFIX = "flurries:"

# OpenImageIO stamps the present moment into every header, and then no two runs make the same
# bytes. A moment that never changes says as much as a clock that nobody asked about.
FIXED_MOMENT = "2000:01:01 00:00:00"

_KEY = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,59}")
_MOMENT = re.compile(r"[0-9]{4}:[0-9]{2}:[0-9]{2} [0-9]{2}:[0-9]{2}:[0-9]{2}")

# How a file stores its pixels, or what is written anew: not the plate's any more.
_STORAGE = {
    "channels", "chunkcount", "compression", "datetime", "imagedescription", "lineorder",
    "multiview", "name", "orientation", "software", "type", "version", "view",
}  # fmt: skip
_STORAGE_PREFIXES = ("oiio:", "openexr:", "png:", "jpeg:", "tiff:", "thumbnail", PREFIX)

# What colors mean.
_COLOR = {
    "adoptedneutral", "chromaticities", "cicp", "colorinteropid", "colorspace", "gamma",
    "iccprofile", "whiteluminance",
}  # fmt: skip

_TIME = "smpte:TimeCode"
_VIDEO = ("dpx:Transfer", "dpx:Colorimetric")


@dataclass(frozen=True)
class Slate:
    """The header of a plate, to be handed on to frames."""

    attributes: tuple[tuple[str, str, Any], ...] = ()  # Names, OpenImageIO's types, values.
    encoding: Encoding = "display"  # Of the plate's numbers.
    origin: tuple[int, int] = (0, 0)  # (x, y) of its first pixel.
    display: Window | None = None  # Its display window; None where that is all of the picture.
    rate: Fraction | None = None  # Frames per second.
    bits: int | None = None  # Of a color.
    colored: bool = True  # Whether colors are in the plate's own space still.
    # The rows and columns that the plate has of a picture that is larger.
    crop: tuple[slice, slice] | None = None
    # What a DPX calls the curve of the numbers and their primaries, where the plate does not.
    video: tuple[str, str] = ("Unspecified video", "ITU-R 709-4")

    def value(self, name: str) -> Any:
        return next((value for known, _, value in self.attributes if known == name), None)

    @property
    def timecode(self) -> TimeCode | None:
        word = self.value(_TIME)
        if word is None or self.rate is None:
            return None
        return TimeCode.of_word(int(word[0]), self.rate)

    def _without(self, *names: str) -> tuple[tuple[str, str, Any], ...]:
        return tuple(one for one in self.attributes if one[0] not in names)

    def at(self, rate: Fraction, timecode: TimeCode | None = None) -> Slate:
        """Return the slate with a rate, and with a time code if one is given."""
        said: Any = [(RATES[0], "rational", (rate.numerator, rate.denominator))]
        if timecode is not None:
            said.append((_TIME, "timecode", (timecode.word, 0)))
        kept = self._without(*RATES, *(name for name, _, _ in said))
        return replace(self, attributes=(*kept, *said), rate=rate)

    def resized(self) -> Slate:
        """Return the slate of a picture of another size: its windows are its own."""
        kept = self._without("PixelAspectRatio", "screenWindowCenter", "screenWindowWidth")
        return replace(self, attributes=kept, origin=(0, 0), display=None, crop=None)

    def cropped(self) -> Slate:
        """Return the slate of the pixels that the plate has."""
        if self.crop is None:
            return self
        (top, left), (x, y) = (part.start for part in self.crop), self.origin
        return replace(self, origin=(x + left, y + top), crop=None)

    def put(
        self, specification: Any, format_name: str, encoding: str, strings: Mapping[str, str]
    ) -> None:
        """Write it and our own strings into the header of a picture that is about to be made."""
        exr, dpx = format_name == "openexr", format_name == "dpx"
        specification.attribute("DateTime", strings["DateTime"])
        specification.attribute("Software", "flurries")
        if exr or format_name == "png":
            # Numbers travel as strings too: OpenImageIO would round integers to 32 bits and floats
            # to single precision.
            for key, text in _own(strings).items():
                specification.attribute(key, text)
        elif text := description(strings):
            specification.attribute("ImageDescription", text)
        for name, said in zip(_VIDEO, self.video, strict=True) if dpx else ():
            specification.attribute(name, said)
        same = self.colored and encoding == self.encoding
        for name, kind, value in self.attributes:
            colored = name in _VIDEO or name.lower().partition(":")[0] in _COLOR
            meant = name not in _VIDEO or value not in ("Undefined", "User defined")
            # Others know no rates and no time codes; a DPX has a place for the latter.
            timed = kind in ("rational", "timecode") or name in RATES
            known = exr or (dpx and name == _TIME) or not timed
            if meant and known and (same or not colored) and (dpx or not name.startswith("dpx:")):
                # Bytes are taken as an array alone.
                given = np.array(value, np.uint8) if kind.startswith("uint8[") else value
                specification.attribute(name, openimageio().TypeDesc(kind), given)
        if exr and (self.display is not None or self.origin != (0, 0)):
            specification.x, specification.y = self.origin
            specification.full_x, specification.full_y = (self.display or self.origin)[:2]
            if self.display is not None:
                specification.full_width, specification.full_height = self.display[2:]


def read_slate(path: PathLike, *, budget: Budget | None = None) -> Slate:
    """Read what a picture says; windows are those of a picture with its overscan."""
    with opened_picture(path, budget, overscan=True) as opened:
        spec, found = opened.specification, []
        for one in spec.extra_attribs:
            lower, value = str(one.name).lower(), one.value
            if lower not in _STORAGE and not lower.startswith(_STORAGE_PREFIXES):
                many = hasattr(value, "__len__") and not isinstance(value, str)
                found.append((str(one.name), str(one.type), tuple(value) if many else value))
        left, top, _, _ = opened.window
        origin, display, crop = (0, 0), None, None
        if opened.is_exr and opened.orientation == 1:
            origin = (spec.x + left, spec.y + top)
            display = (spec.full_x, spec.full_y, spec.full_width, spec.full_height)
            if opened.window != (0, 0, spec.width, spec.height):
                crop = np.s_[-top : spec.height - top, -left : spec.width - left]
        usual = {"uint8": 8, "uint16": 16}.get(opened.stored_type)
        bits = spec.get_int_attribute("oiio:BitsPerSample") or usual
        return Slate(tuple(found), opened.encoding, origin, display, rate_of(spec), bits, crop=crop)


def checked_metadata(metadata: Mapping[str, object] | None) -> dict[str, str]:
    """Return the metadata as strings, keys without the prefix, ``DateTime`` always among them."""
    strings = {"DateTime": FIXED_MOMENT}
    for given, value in mapping("metadata", {} if metadata is None else metadata).items():
        if not isinstance(given, str):
            raise TypeError(f"metadata keys must be strings, got {given!r}")
        key = given.removeprefix(PREFIX)
        if not _KEY.fullmatch(key):
            known = "at most 60 letters, digits, '_', '.' or '-'"
            raise ValueError(f"metadata key {given!r} must be {known}")
        if not isinstance(value, (str, Integral, Real)):
            raise TypeError(f"metadata {key!r} must be a string or a number, got {value!r}")
        # NumPy's own words for a float name its type, too.
        text = str(value) if isinstance(value, (str, Integral)) else repr(float(value))
        if "\0" in text:
            raise ValueError(f"metadata {key!r} must not hold a NUL byte")
        if key == "DateTime" and not _MOMENT.fullmatch(text):
            raise ValueError(f"metadata 'DateTime' must read YYYY:MM:DD HH:MM:SS, got {text!r}")
        strings[key] = text
    return strings


def _own(strings: Mapping[str, str]) -> dict[str, str]:
    return {PREFIX + key: text for key, text in strings.items() if key != "DateTime"}


def description(strings: Mapping[str, str]) -> str:
    """Return checked metadata as the one text of formats that hold no more; empty if none."""
    return json.dumps(_own(strings), sort_keys=True) if _own(strings) else ""
