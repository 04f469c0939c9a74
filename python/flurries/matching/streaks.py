"""Peaks of flakes that are found again in another frame: how far they went, and their streaks.

Waves tell the exposure by the few flakes that have most of the power; here each flake counts alike.
What blurs or hides streaks does so in the clip and in a candidate.
"""

from typing import NamedTuple

import numpy as np

from flurries._contract import Array

# Ways until another frame that are looked at, px; the least that tells a streak; the heights over
# those before at which a flake is the same; and the shares of the way that its streak is looked at.
_WAYS, _LEAST, _SAME = np.arange(1.0, 45.0, dtype=np.float32), 6.0, (0.6, 1.6)
_SHARES = np.linspace(-1.0, 1.0, 41, dtype=np.float32)


class Way(NamedTuple):
    """The direction of all flakes: (x, y) less `approach` times the place from the middle."""

    x: float
    y: float
    approach: float  # Over a pixel.

    def back(self) -> "Way":
        return Way(-self.x, -self.y, -self.approach)


def found_again(now: Array, other: Array, places: Array, way: Way) -> tuple[Array, Array]:
    """Return how far peaks (n, 2) go until another frame, px or 0, and exposures, frames or NaN."""
    last = np.array(now.shape) - 1
    step = (way.y, way.x) - way.approach * (places - 0.5 * last)
    step /= np.hypot(*step.T)[:, None]
    far, long = np.zeros(len(places)), np.full(len(places), np.nan)

    def seen(picture: Array, few: Array, px: Array) -> Array:
        """Return heights over the few peaks' own at px (n, m) along the way."""
        row, column = (
            np.rint(place[few, None] + px * by[few, None]).astype(np.int32)
            for place, by in zip(
                places.T.astype(np.float32), step.T.astype(np.float32), strict=True
            )
        )
        own = now[tuple(places[few].T)][:, None]
        return np.asarray(picture.take(row * now.shape[1] + column) / own)

    def inside(ends: Array) -> Array:
        return np.asarray(np.all((ends >= 0.0) & (ends <= last), axis=1))

    few = np.flatnonzero(inside(places + _WAYS[-1] * step))
    heights = seen(other, few, _WAYS)
    heights[heights >= _SAME[1]] = 0.0
    best = heights.argmax(axis=1)
    again = heights.max(axis=1) > _SAME[0]
    few, px = few[again], _WAYS[best[again]]
    far[few] = px
    # A streak is as long as a line of its peak's height would be.
    reach = px[:, None] * step[few]
    told = (px >= _LEAST) & inside(places[few] + reach) & inside(places[few] - reach)
    shares = seen(now, few[told], np.multiply.outer(px[told], _SHARES))
    long[few[told]] = 2.0 * np.clip(shares, -0.5, 1.2).mean(axis=1)
    return far, long
