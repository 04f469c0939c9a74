"""What a plate says of itself, carried into the frames that are made of it.

Everything in its header goes through but what is about how the file stores its pixels, and what is
flurries' own. What describes colors goes where the colors are the plate's still.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from flurries.io.color import Encoding
from flurries.io.files import Budget
from flurries.io.oiio import openimageio
from flurries.io.pictures.header import RATES, opened_picture, rate_of
from flurries.io.pictures.metadata import PREFIX, put_strings
from flurries.io.timecode import TimeCode

# How a file stores its pixels, or what is written anew: not the plate's any more.
_STORAGE = {
    "channels", "chunkcount", "compression", "datetime", "imagedescription", "lineorder",
    "multiview", "name", "orientation", "software", "type", "version", "view",
}  # fmt: skip
_STORAGE_PREFIXES = ("oiio:", "openexr:", "png:", "jpeg:", "tiff:", "thumbnail", PREFIX)

# What colors mean.
_COLOR = {"chromaticities", "cicp", "colorinteropid", "iccprofile", "whiteluminance"}
_COLOR |= {"adoptedneutral", "colorspace", "gamma"}

_TIME = "smpte:TimeCode"
_VIDEO = ("dpx:Transfer", "dpx:Colorimetric")


@dataclass(frozen=True)
class Slate:
    """The header of a plate, to be handed on to frames.

    Attributes
    ----------
    attributes : tuple of (name, type, value)
        As OpenImageIO calls them.
    encoding : {"display", "linear"}
        Encoding of the plate's numbers.
    origin : (x, y)
        Where its first pixel lies, px.
    display : (x, y, width, height) or None
        Its display window; None where that is all of the picture.
    rate : Fraction or None
        Frames per second, if the header has them.
    bits : int or None
        Bits of a color, if the plate's header has them.
    colored : bool
        Whether colors are in the plate's own space still.
    crop : (rows, columns) or None
        The pixels that the plate has of a picture that is larger, as slices.
    video : (str, str)
        What a DPX calls the curve of the numbers and their primaries, where the plate does not.
    """

    attributes: tuple[tuple[str, str, Any], ...] = ()
    encoding: Encoding = "display"
    origin: tuple[int, int] = (0, 0)
    display: tuple[int, int, int, int] | None = None
    rate: Fraction | None = None
    bits: int | None = None
    colored: bool = True
    crop: tuple[slice, slice] | None = None
    video: tuple[str, str] = ("Unspecified video", "ITU-R 709-4")

    def value(self, name: str) -> Any:
        return next((value for known, _, value in self.attributes if known == name), None)

    @property
    def timecode(self) -> TimeCode | None:
        word = self.value(_TIME)
        if word is None or self.rate is None:
            return None
        return TimeCode.of_word(int(word[0]), self.rate)

    def at(self, rate: Fraction, timecode: TimeCode | None = None) -> Slate:
        """Return the slate with a rate, and with a time code if one is given."""
        kept = [one for one in self.attributes if one[0] not in RATES]
        kept.append(("framesPerSecond", "rational", (rate.numerator, rate.denominator)))
        if timecode is not None:
            kept = [one for one in kept if one[0] != _TIME]
            kept.append((_TIME, "timecode", (timecode.word, 0)))
        return replace(self, attributes=tuple(kept), rate=rate)

    @staticmethod
    def of(slate: object) -> Slate:
        """Return a slate that a writer is given, or one that says nothing."""
        if slate is None:
            return NOTHING
        if not isinstance(slate, Slate):
            raise TypeError(f"slate must be a flurries.io.Slate, got {type(slate).__name__}")
        return slate

    def resized(self) -> Slate:
        """Return the slate of a picture of another size: its windows are its own."""
        gone = ("PixelAspectRatio", "screenWindowCenter", "screenWindowWidth")
        kept = tuple(one for one in self.attributes if one[0] not in gone)
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
        put_strings(specification, strings, format_name)
        same = self.colored and encoding == self.encoding
        if format_name == "dpx":
            for name, said in zip(_VIDEO, self.video, strict=True):
                specification.attribute(name, said)
        for name, kind, value in self.attributes:
            if name in _VIDEO and (not same or value in ("Undefined", "User defined")):
                continue
            if name.lower().partition(":")[0] in _COLOR and not same:
                continue
            if name.startswith("dpx:") and format_name != "dpx":
                continue
            # Others know no such words; a DPX has a place for a time code.
            own = format_name == "openexr" or (format_name == "dpx" and name == _TIME)
            if not own and (kind in ("rational", "timecode") or name in RATES):
                continue
            if kind.startswith("uint8["):
                # Bytes are taken as an array alone.
                value = np.array(value, np.uint8)
            specification.attribute(name, openimageio().TypeDesc(kind), value)
        if format_name == "openexr" and (self.display is not None or self.origin != (0, 0)):
            specification.x, specification.y = self.origin
            if self.display is not None:
                left, top, width, height = self.display
                specification.full_x, specification.full_y = left, top
                specification.full_width, specification.full_height = width, height
            else:
                specification.full_x, specification.full_y = self.origin

    @property
    def profile(self) -> bytes | None:
        value = self.value("ICCProfile")
        return None if value is None or not self.colored else bytes(value)


NOTHING = Slate()


def read_slate(path: str | os.PathLike[str], *, budget: Budget | None = None) -> Slate:
    """Read what a picture says of itself; windows are those of a picture with its overscan.

    `path`, `budget` and errors are those of `read_picture`.
    """
    with opened_picture(path, budget, overscan=True) as opened:
        spec = opened.specification
        found = []
        for one in spec.extra_attribs:
            name = str(one.name)
            lower = name.lower()
            if lower in _STORAGE or lower.startswith(_STORAGE_PREFIXES):
                continue
            value = one.value
            kept = (
                tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value
            )
            found.append((name, str(one.type), kept))
        left, top, _, _ = opened.frame_window
        origin, display, crop = (0, 0), None, None
        if opened.reader.format_name() == "openexr" and opened.orientation == 1:
            origin = (spec.x + left, spec.y + top)
            display = (spec.full_x, spec.full_y, spec.full_width, spec.full_height)
            if opened.frame_window != (0, 0, spec.width, spec.height):
                crop = np.s_[-top : spec.height - top, -left : spec.width - left]
        bits = spec.get_int_attribute("oiio:BitsPerSample") or None
        if bits is None and opened.stored_type in ("uint8", "uint16"):
            bits = 8 if opened.stored_type == "uint8" else 16
        return Slate(tuple(found), opened.encoding, origin, display, rate_of(spec), bits, crop=crop)
