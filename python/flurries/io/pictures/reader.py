"""Reading pictures: any format that OpenImageIO knows, as colors and alpha, or as depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

import numpy as np

from flurries._contract import Array, PathLike, depths, require
from flurries._warnings import warn_of_units
from flurries.io.color import Encoding, to_unit
from flurries.io.files import Budget
from flurries.io.pictures.header import FLOATS, Opened, Window, opened_picture

_GREEN, _BLUE = np.float32(0.7152), np.float32(0.0722)  # What luminance is made of, Rec. 709.

# What programs call depth, alone or at the end of a layer's name.
_DEPTHS = ("Z", "z", "depth", "Depth", "DEPTH")

_NONE = 1e-4  # Shares of a pixel that are none.


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture as it was read.

    Attributes
    ----------
    pixels : ndarray
        (H, W, 3), uint8, uint16 or float32. Grey pictures have three equal channels.
    alpha : ndarray or None
        (H, W) float32 from 0 to 1, or None if the picture has none.
    encoding : str
        ``"display"``: the numbers are what a screen is sent (sRGB). ``"linear"``: they are
        proportional to light.
    path : str
        The file that it came from.
    premultiplied : bool
        Whether `pixels` are multiplied by `alpha` already, as in EXR; PNG's are not.
    display : (left, top, width, height) or None
        Where the display window lies in a picture that was read with its overscan.
    """

    pixels: Array
    alpha: Array | None
    encoding: Encoding
    path: str
    premultiplied: bool = False
    display: Window | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in px."""
        return self.pixels.shape[1], self.pixels.shape[0]

    def rgba(self) -> Array:
        """Return (H, W, 4) in the pixels' dtype, floats multiplied by alpha; opaque without one."""
        result = np.empty((*self.pixels.shape[:2], 4), self.pixels.dtype)
        result[..., :3] = self.pixels
        opaque = np.iinfo(result.dtype).max if result.dtype.kind == "u" else 1
        if self.alpha is None:
            result[..., 3] = opaque
        elif result.dtype.kind == "u":
            np.rint(self.alpha * np.float32(opaque), out=result[..., 3], casting="unsafe")
        else:
            result[..., 3] = self.alpha
            if not self.premultiplied:
                result[..., :3] *= result[..., 3:]
        return result


def read_picture(
    path: PathLike, *, budget: Budget | None = None, overscan: bool = False
) -> Picture:
    """Read a picture: PNG, JPEG, EXR, TIFF, HDR, WebP, or what else OpenImageIO reads.

    Of an EXR comes its display window: pixels outside it are cut off, pixels of it that are not
    stored are black and transparent; of its channels R, G, B and A, or else those of its first
    layer. Orientation marks are honoured. Floats are linear light, half becomes float32; integers
    are display values: 8 and 16 bits stay as they are, other widths become float32 from 0 to 1. A
    `budget` says how large it may be, ``Budget()`` if not given. With `overscan` all that is stored
    comes, and the display window is where `Picture.display` says.
    """
    with opened_picture(path, budget, overscan=overscan) as opened:
        stored = opened.stored_type
        # A grey picture gets its one channel three times.
        groups = [opened.color if len(opened.color) == 3 else opened.color * 3]
        groups += [] if opened.alpha is None else [(opened.alpha,)]
        kind = stored if stored in ("uint8", "uint16") else "float"
        pixels, *cover = map(opened.shown, opened.read(kind, *groups))
        alpha = np.ascontiguousarray(to_unit(cover[0][..., 0])) if cover else None
        straight = opened.specification.get_int_attribute("oiio:UnassociatedAlpha") != 0
        multiplied = opened.is_exr or (opened.reader.format_name() == "tiff" and not straight)
        return Picture(
            np.ascontiguousarray(pixels), alpha, opened.encoding, str(opened.path),
            alpha is not None and multiplied, opened.display,
        )  # fmt: skip


def luminance(picture: Picture) -> Array:
    """Return (H, W) float32 from 0 to 1: the luminance of the numbers as stored."""
    values = np.clip(np.nan_to_num(to_unit(picture.pixels), nan=0.0), 0.0, 1.0)
    red, green, blue = np.moveaxis(values, -1, 0)
    # Written as differences, so that grey pictures give their grey level exactly.
    grey: Array = red + _GREEN * (green - red) + _BLUE * (blue - red)
    return grey


def read_depth(path: PathLike, *, budget: Budget | None = None, overscan: bool = False) -> Array:
    """Read the depth channel of a picture, (H, W) float32, as `read_picture` does.

    It is an EXR or TIFF with a float channel named "Z" or "depth", alone or at the end of a layer's
    name (``ViewLayer.Depth.Z``), in any part; or with a single float channel. Outside an EXR's data
    window depth is infinity. A deep EXR has two depths in a pixel: (H, W, 3), a near one, that of
    what is seen behind it, and the share of the pixel that the near one hides.
    """
    with opened_picture(path, budget, overscan=overscan, deep=True) as opened:
        part, channel = _find_depth(opened)
        if part.specification.deep:
            return _two_depths(part, channel)
        [plane] = part.read("float", [channel])
        shown = np.ascontiguousarray(part.shown(plane, np.inf)[..., 0])
    warn_of_units("depth", shown)
    return depths(f"{opened.path}: depth", shown)


def require_depth(path: Path, budget: Budget | None) -> None:
    """Refuse a file without depth, before any frame is asked for."""
    with opened_picture(path, budget, deep=True) as opened:
        _find_depth(opened)


def _find_depth(opened: Opened) -> tuple[Opened, int]:
    """Return the part that has depth, and its channel."""
    found = [
        (name, part, channel)
        for part, spec in enumerate(opened.parts)
        for channel, name in enumerate(spec.channelnames)
        if str(spec.channelformat(channel)) in FLOATS
    ]
    for ending in (False, True):
        for wanted in _DEPTHS:
            for name, part, channel in found:
                if (name.rpartition(".")[2] if ending else name) == wanted:
                    return opened.at(part), channel
    names = [name for spec in opened.parts for name in spec.channelnames]
    if len(found) == len(names) == 1:
        return opened.at(0), 0
    raise ValueError(
        f"{opened.path}: no float channel 'Z' or 'depth' among {', '.join(names)}; a grey picture "
        "becomes depths through DepthMap"
    )


def samples_of(opened: Opened, channels: Sequence[int]) -> tuple[Array, Array]:
    """Return the samples of each pixel, (H, W), and channels of all of them, (N, c) float32."""
    spec = opened.specification
    opened.budget.admit(opened.path, (spec.width, spec.height), 4 * len(channels))
    data = opened.reader.read_native_deep_image(opened.part, 0)
    if data is None:
        raise opened.damage()
    pixels = spec.width * spec.height
    counts = np.fromiter(map(data.samples, range(pixels)), np.int64, pixels)
    total = int(counts.sum())
    opened.budget.admit(opened.path, (max(total, 1), 1), 4 * len(channels))
    pixel = np.repeat(np.arange(pixels), counts)
    number = np.arange(total) - np.repeat(np.cumsum(counts) - counts, counts)
    # OpenImageIO hands samples over one number at a time.
    places = pixel.tolist(), number.tolist()
    values = np.empty((total, len(channels)), np.float32)
    for column, channel in enumerate(channels):
        read = map(data.deep_value, places[0], repeat(channel), places[1])
        values[:, column] = np.fromiter(read, np.float32, total)
    return counts.reshape(spec.height, spec.width), values


def _two_depths(opened: Opened, depth: int) -> Array:
    """Return (H, W, 3): a near depth, the one behind it, and the near one's share of the pixel."""
    # Samples, and the infinity behind them, are parted where their inverse depths differ most.
    names = opened.specification.channelnames
    layer, dot, _ = names[depth].rpartition(".")
    alpha = [k for k, name in enumerate(names) if name == f"{layer}{dot}A"]
    counts, values = samples_of(opened, [depth, *alpha])
    far = values[:, 0].astype(np.float64)
    require(f"{opened.path}: depth", far, far > 0.0, "greater than 0 in all samples")
    cover = values[:, 1].astype(np.float64) if alpha else np.ones(len(far))
    whole = (cover >= 0.0) & (cover <= 1.0 + _NONE)
    require(f"{opened.path}: alpha", cover, whole, "from 0 to 1 in all samples")
    parted = _parted(counts.ravel(), far, np.minimum(cover, 1.0)).astype(np.float32)
    shown = opened.shown(np.moveaxis(parted.reshape(3, *counts.shape), 0, 2), np.inf)
    shown = np.ascontiguousarray(shown)
    shown[..., 2][np.isinf(shown[..., 2])] = 0.0
    warn_of_units("depth", shown[..., 0])
    return shown


def _parted(counts: Array, far: Array, cover: Array) -> Array:
    """Return (3, n): the near depth of each pixel, the one behind it, and the near one's share."""
    order = np.lexsort((far, np.repeat(np.arange(len(counts)), counts)))
    close, cover, first = 1.0 / far[order], cover[order], np.cumsum(counts) - counts
    most = int(counts.max(initial=0))
    rounds = [(own, first[own] + k) for k in range(most) for own in [np.flatnonzero(counts > k)]]
    # Of the samples so far: how much they hide, and their inverse depths by that.
    hidden, total = np.zeros(len(counts)), np.zeros(len(counts))
    sums = np.empty((len(far), 2))
    for own, at in rounds:
        shown = (1.0 - hidden[own]) * cover[at]
        hidden[own] += shown
        total[own] += shown * close[at]
        sums[at] = np.stack([hidden[own], total[own]], axis=1)
    best, share, inner = (np.zeros(len(counts)) for _ in range(3))
    for own, at in rounds:
        part, inside = sums[at].T
        ends = np.clip(part * (1.0 - part), _NONE, None)
        score = np.where(part < 1.0 - _NONE, (inside - part * total[own]) ** 2 / ends, 0.0)
        better = score > best[own]
        own = own[better]
        best[own], share[own], inner[own] = score[better], part[better], inside[better]
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = np.where(hidden - share < _NONE, 0.0, total - inner)
        back = np.where(share > 0.0, (1.0 - share) / rest, 1.0 / total)
        return np.stack([np.where(share > 0.0, share / inner, back), back, share])
