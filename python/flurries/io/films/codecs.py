"""How each kind of video is encoded: codecs, bits, qualities, frame rates."""

from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from flurries._contract import choice

_X265_LEAST = 64  # Below a coding block in both sides x265 writes past its own memory.


@dataclass(frozen=True)
class Codec:
    """The pixels and files that a codec can hold, and its settings."""

    library: str  # The video library's name of it.
    suffixes: tuple[str, ...]  # The files that hold it.
    pixels: dict[int, str]  # How a picture is stored, by its bits a color.
    options: dict[str, str] = field(default_factory=dict)
    qualities: dict[str, dict[str, str]] = field(default_factory=dict)
    alpha: str | None = None  # How a picture with alpha is stored.
    threading: str = "SLICE"  # Threads encode parts of a frame, or each a frame: "FRAME".


QUALITIES = ("high", "medium", "draft")


def _qualities(speed: str, *settings: tuple[str, str]) -> dict[str, dict[str, str]]:
    """Return the settings of each quality: the encoder's speed, and its constant rate factor."""
    both = zip(QUALITIES, settings, strict=True)
    return {quality: {speed: how, "crf": factor} for quality, (how, factor) in both}


_MP4, _420 = (".mp4", ".mov", ".mkv"), {8: "yuv420p", 10: "yuv420p10le"}
_X265 = {"x265-params": "log-level=error:frame-threads=1:pools=4:info=0"}
_HQ, _4444 = ({"profile": p, "vendor": "apl0", "alpha_bits": "0"} for p in ("hq", "4444"))
CODECS = {
    # With its macroblock tree x264 made other bytes in every run, even in one thread; x265's pool
    # may have any size. Over snow long searches find nothing that short ones of the same bytes miss
    # (docs/internals/encoders.md); x264's "ultrafast" makes blocks.
    "h264": Codec("libx264", _MP4, _420, {"mbtree": "0"}, threading="FRAME", qualities=_qualities(
        "preset", ("superfast", "17"), ("superfast", "22"), ("superfast", "28"))),
    "h265": Codec("libx265", _MP4, _420, _X265, _qualities(
        "preset", ("superfast", "16"), ("superfast", "22"), ("ultrafast", "26"))),
    "vp9": Codec("libvpx-vp9", (".webm", ".mkv"), {8: "yuv420p"}, {"b:v": "0", "row-mt": "1"}, {
        "high": {"deadline": "good", "cpu-used": "4", "crf": "18"},
        "medium": {"deadline": "realtime", "cpu-used": "6", "crf": "27"},
        "draft": {"deadline": "realtime", "cpu-used": "8", "crf": "38"},
    }),
    "ffv1": Codec("ffv1", (".mkv",), {8: "bgr0", 10: "gbrp10le", 16: "gbrp16le"}, {
        "level": "3", "slicecrc": "1",
    }),
    "prores-hq": Codec("prores_ks", (".mov",), {10: "yuv422p10le"}, _HQ, threading="FRAME"),
    "prores-4444": Codec("prores_ks", (".mov",), {10: "yuv444p10le"}, _4444,
                         alpha="yuva444p10le", threading="FRAME"),
    "dnxhr": Codec("dnxhd", (".mov",), {8: "yuv422p", 10: "yuv422p10le"}),
}  # fmt: skip
_USUAL = {".mp4": "h264", ".mov": "h264", ".webm": "vp9", ".mkv": "ffv1"}


@dataclass(frozen=True)
class Encoder:
    """A codec and its settings, as the video library takes them."""

    name: str  # The library's name of it.
    pixels: str  # How a picture is stored.
    options: dict[str, str]
    container: dict[str, str]  # Settings of the codec and of the file.
    bits: int = 8  # Of a color.
    tag: str | None = None  # What the file calls it, where programs know it under one name only.
    threading: str = "SLICE"

    @property
    def rgb(self) -> bool:
        return self.pixels.startswith(("bgr", "gbr"))


def _codec(suffix: str, codec: str | None) -> tuple[str, Codec]:
    name = _USUAL[suffix] if codec is None else choice("codec", codec, tuple(CODECS))
    return name, CODECS[name]


def encoder_for(
    suffix: str, quality: str, size: tuple[int, int], codec: str | None = None,
    bits: int | None = None, *, alpha: bool = False,
) -> Encoder:  # fmt: skip
    """Return the encoder for an extension; a number of threads always makes the same bytes."""
    name, kind = _codec(suffix, codec)
    if suffix not in kind.suffixes:
        raise ValueError(f"codec {name} goes into {', '.join(kind.suffixes)}, not {suffix}")
    if alpha and kind.alpha is None:
        able = [one for one, known in CODECS.items() if known.alpha is not None]
        raise ValueError(f"codec {name} holds no alpha; take {', '.join(able)} in a .mov")
    stored = next(iter(kind.pixels)) if bits is None else bits
    if stored not in kind.pixels:
        known = ", ".join(map(str, kind.pixels))
        able = [one for one, other in CODECS.items() if bits in other.pixels]
        hint = f"; {', '.join(able)} can" if able else ""
        raise ValueError(f"bits must be {known} for {name}, got {stored}{hint}")
    if name == "h265" and max(size) < _X265_LEAST:
        got = f"{size[0]} x {size[1]}"
        raise ValueError(f"codec h265 needs {_X265_LEAST} px in width or height, got {got}")
    # Without bitexact, the container is stamped with the library's version and random numbers.
    container = {"fflags": "+bitexact"}
    if suffix in (".mp4", ".mov"):
        container["movflags"] = "+faststart+write_colr"
    options = {**kind.qualities.get(quality, {}), **kind.options}
    if name == "ffv1":
        # Four slices are two by two, which a picture of one row has no room for.
        options["slices"] = "4" if min(size) > 1 else "1"
    elif name == "dnxhr":
        options["profile"] = "dnxhr_hq" if stored == 8 else "dnxhr_hqx"
    elif alpha:
        options["alpha_bits"] = "16"
    pixels = kind.alpha if alpha and kind.alpha is not None else kind.pixels[stored]
    tag = "hvc1" if name == "h265" and suffix != ".mkv" else None
    return Encoder(kind.library, pixels, options, container, stored, tag, kind.threading)


def bits_for(suffix: str, codec: str | None, least: int) -> int:
    """Return the fewest bits of a file's codec that hold a film's, or refuse."""
    _, kind = _codec(suffix, codec)
    enough = [bits for bits in kind.pixels if bits >= least]
    if not enough:
        raise ValueError(
            f"the film has {least} bits, the new one at most {max(kind.pixels)}: bits= (--bits) "
            "says that this is meant; ffv1 in a .mkv holds 16"
        )
    return min(enough)


def frame_rate(fps: float | Fraction) -> Fraction:
    """Return a frame rate as a fraction, the rates of television as what they stand for."""
    if isinstance(fps, bool) or not isinstance(fps, (int, float, Fraction, np.number)):
        raise TypeError(f"fps must be a number, got {fps!r}")
    if not 0 < fps <= 1000:
        raise ValueError(f"fps must be above 0 and at most 1000, got {fps!r}")
    if isinstance(fps, Fraction):
        return fps.limit_denominator(100_000)
    number = float(fps)
    nominal = round(number * 1.001)
    if not number.is_integer() and abs(nominal / 1.001 - number) < 0.005:
        return Fraction(nominal * 1000, 1001)
    return max(Fraction(number).limit_denominator(1000), Fraction(1, 1000))
