"""How each kind of video is encoded: codecs, qualities, frame rates."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from flurries import _core

# Threads of an encoder, at least. x264's result depends on their number a little: machines with no
# more cores than these make the same bytes, and in the reproducible mode all do.
THREADS = 4
_MOST_THREADS = 16

# Over snow x264's searches find little: "fast" takes a third of the time of "slow", loses .1 dB for
# 3 in 100 more bytes, and cannot be told from it at 1:1; "veryfast" loses 1.6 dB, and small flakes
# with it (benches/history.md).
_X264 = {
    "high": {"preset": "fast", "crf": "16"},
    "medium": {"preset": "fast", "crf": "21"},
    "draft": {"preset": "veryfast", "crf": "28"},
}
_VP9 = {
    "high": {"crf": "18", "cpu-used": "2"},
    "medium": {"crf": "28", "cpu-used": "4"},
    "draft": {"crf": "38", "cpu-used": "6"},
}
QUALITIES = tuple(_X264)


@dataclass(frozen=True)
class Encoder:
    """A codec and its settings, as the video library takes them."""

    name: str
    pixels: str
    options: dict[str, str]
    container: dict[str, str]


def encoder_threads() -> int:
    """Return how many threads an encoder gets: by the cores, or always as many."""
    if _core.reproducible():
        return THREADS
    return min(max(_core.threads(), THREADS), _MOST_THREADS)


def encoder_for(suffix: str, quality: str, size: tuple[int, int]) -> Encoder:
    """Return the encoder for an extension, with settings that make the same bytes every time."""
    # Without bitexact, the container is stamped with the library's version and random numbers.
    container = {"fflags": "+bitexact"}
    if suffix in (".mp4", ".mov"):
        # With its macroblock tree x264 made other bytes in every run, even in one thread.
        options = {**_X264[quality], "mbtree": "0"}
        return Encoder(
            "libx264", "yuv420p", options, {**container, "movflags": "+faststart+write_colr"}
        )
    if suffix == ".webm":
        options = {**_VP9[quality], "b:v": "0", "deadline": "good", "row-mt": "1"}
        return Encoder("libvpx-vp9", "yuv420p", options, container)
    # Four slices are two by two, which a picture of one row has no room for.
    slices = "4" if min(size) > 1 else "1"
    return Encoder("ffv1", "bgr0", {"level": "3", "slices": slices, "slicecrc": "1"}, container)


def frame_rate(fps: float | Fraction) -> Fraction:
    """Return a frame rate as a fraction, the rates of television as what they stand for.

    Raises
    ------
    ValueError
        If it is not above 0 and at most 1000.
    TypeError
        If it is not a number.
    """
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
