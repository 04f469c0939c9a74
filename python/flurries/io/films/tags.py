"""What a film says of itself: colors, pixels, time code."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flurries.io.timecode import TimeCode

UNSPECIFIED = 2

# Curves of light to numbers that are no display's: ITU-R BT.2100's.
_HDR = {16: "PQ", 18: "HLG"}

_FULL = 2


@dataclass(frozen=True)
class Tags:
    primaries: int = UNSPECIFIED
    transfer: int = UNSPECIFIED
    matrix: int = UNSPECIFIED  # As ITU-T H.273 counts them; 2 is not said.
    full: bool = False  # Whether numbers go from 0 to the largest, not from 16 to 235.
    aspect: Fraction = Fraction(1)  # Width of a pixel over its height.
    bits: int = 8  # Of a color.
    timecode: TimeCode | None = None  # Of the first frame.
    interlaced: bool = False  # Whether a frame holds two moments.

    @property
    def hdr(self) -> str | None:
        return _HDR.get(self.transfer)

    @staticmethod
    def of(container: Any, stream: Any, frame: Any) -> Tags:
        context = stream.codec_context

        def said(name: str) -> int:
            own = int(getattr(frame, name))
            return int(getattr(context, name)) if own in (0, UNSPECIFIED) else own

        aspect = Fraction(stream.sample_aspect_ratio or context.sample_aspect_ratio or 1)
        rate = stream.average_rate or stream.guessed_rate
        said_of = [container.metadata, *(one.metadata for one in container.streams)]
        texts = [text for one in said_of for key, text in one.items() if key.lower() == "timecode"]
        codes = [TimeCode.of_text(text, Fraction(rate)) for text in texts if rate]
        return Tags(
            primaries=said("color_primaries"),
            transfer=said("color_trc"),
            matrix=UNSPECIFIED if frame.format.is_rgb else said("colorspace"),
            full=said("color_range") == _FULL or frame.format.name.startswith("yuvj"),
            aspect=aspect if Fraction(1, 20) <= aspect <= 20 else Fraction(1),
            bits=max(part.bits for part in frame.format.components),
            timecode=next((code for code in codes if code is not None), None),
            interlaced=bool(frame.interlaced_frame),
        )
