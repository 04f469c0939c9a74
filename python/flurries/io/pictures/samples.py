"""The samples of a deep picture's pixels, and the two depths that these show most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import repeat

import numpy as np

from flurries._contract import Array, require
from flurries._warnings import warn_of_units
from flurries.io.oiio import last_error
from flurries.io.pictures.header import Opened

# Shares of a pixel that are none.
_NONE = 1e-4


def samples_of(opened: Opened, part: int, channels: Sequence[int]) -> tuple[Array, Array]:
    """Return the samples of each pixel, (H, W), and channels of all of them, (N, c) float32."""
    spec = opened.reader.spec(part)
    opened.budget.admit(opened.path, (spec.width, spec.height), 4 * len(channels))
    data = opened.reader.read_native_deep_image(part, 0)
    if data is None:
        reason = last_error(opened.reader) or "no reason given"
        raise OSError(f"{opened.path}: the picture is damaged or cut short: {reason}")
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


def two_depths(opened: Opened, part: int, depth: int) -> Array:
    """Return (H, W, 3): a near depth, the one behind it, and the near one's share of the pixel."""
    # Samples, and the infinity behind them, are parted where their inverse depths differ most.
    spec = opened.reader.spec(part)
    layer, dot, _ = spec.channelnames[depth].rpartition(".")
    alpha = [k for k, name in enumerate(spec.channelnames) if name == f"{layer}{dot}A"]
    counts, values = samples_of(opened, part, [depth, *alpha])
    called = f"{opened.path}: depth"
    far = values[:, 0].astype(np.float64)
    require(called, far, far > 0.0, "greater than 0 in all samples")
    cover = values[:, 1].astype(np.float64) if alpha else np.ones(len(far))
    whole = (cover >= 0.0) & (cover <= 1.0 + _NONE)
    require(f"{opened.path}: alpha", cover, whole, "from 0 to 1 in all samples")
    near, back, share = _parted(counts.ravel(), far, np.minimum(cover, 1.0))
    planes = [plane.astype(np.float32).reshape(counts.shape) for plane in (near, back, share)]
    shown = replace(opened, specification=spec).shown(np.stack(planes, axis=2), np.inf)
    shown[..., 2][np.isinf(shown[..., 2])] = 0.0
    warn_of_units("depth", shown[..., 0])
    return np.ascontiguousarray(shown)


def _parted(counts: Array, far: Array, cover: Array) -> tuple[Array, Array, Array]:
    """Return the near depth of each pixel, the one behind it, and the near one's share."""
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
        return np.where(share > 0.0, share / inner, back), back, share
