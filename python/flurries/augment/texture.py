"""The spectral texture of what falls far away, the same at every size of the picture.

A small picture, which has no room for the short waves, gets the texture of a larger one averaged
over its pixels, as if the larger picture had been made smaller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flurries._contract import Array, Float64
from flurries.augment.calibration import mean_square
from flurries.camera.lens import Camera
from flurries.spectral.frame import alpha_of, request

# Of a picture 1024 px long.
_BAND = (3.0, 24.0)
_LONG = 1024.0

# Length from which on a picture is left alone: there only the shortest of its waves, from 1.5 px
# on, are under two pixels. And the most pixels of a larger one.
_ENOUGH = 512.0
_MOST_PIXELS = 2**22


@dataclass(frozen=True)
class Texture:
    """A look of the texture.

    Attributes
    ----------
    amount, mean, spread, exponent : float
        See :func:`flurries.spectral.alpha`; its `power` is 2.
    near : float
        Depth in metres that the longest wave stands for.
    """

    amount: float
    mean: float
    spread: float
    exponent: float
    near: float

    def cover(self) -> float:
        """Return its mean opacity before the sky."""
        return self.amount * mean_square(self.mean, 0.5 / self.spread)

    def share(self, depth: Array | Float64) -> Array:
        """Return how much of it lies before depths: equal for every octave of its waves."""
        share = np.log(depth * np.float32(1.0 / self.near)) / math.log(_BAND[1] / _BAND[0])
        return np.asarray(np.clip(share, 0.0, 1.0))

    def typical(self) -> float:
        """Return the depth that moves as the mean of its waves, by their power, metres."""
        ratio, e = _BAND[1] / _BAND[0], self.exponent

        def power(p: float) -> float:
            return math.log(ratio) if abs(p) < 1e-12 else (ratio**p - 1.0) / p

        return self.near * power(2.0 - 2.0 * e) / power(1.0 - 2.0 * e)

    def alpha(
        self,
        shape: tuple[int, int],
        camera: Camera,
        *,
        seed: int,
        velocity: Float64,
        time: float,
        exposure: float,
        fps: float,
    ) -> Array:
        """Return its opacity before the sky, (H, W) float32.

        Parameters
        ----------
        velocity : (3,)
            Of what falls, metres per second.
        time, exposure : float
            Seconds.
        fps : float
            Frames per second, for what is too fast for them.
        """
        times = enlargement(shape)
        large = (times * shape[0], times * shape[1])
        scale = max(large) / _LONG
        band = (max(_BAND[0] * scale, 2.0), max(_BAND[1] * scale, 4.0))
        tile = 8 * math.ceil(band[1] / 3.0 - 1e-9)
        pixels = times * camera.focal / self.near
        moved = velocity[:2] * time - np.array(camera.offset[:2])
        asked = request(
            large,
            drift=pixels * moved,
            shift=times * np.array(camera.center_shift),
            velocity=pixels / fps * velocity[:2],
            seed=seed,
            tile=tile,
            overlap=tile // 6,
            wavelengths=band,
            exponent=self.exponent,
            alias="soft",
            shutter=exposure * fps,
        )
        mapped = (self.mean, self.spread, 2.0, self.amount)
        return averaged(alpha_of(asked, mapped, preserve_mean=True), times)


def longest_wave(shape: tuple[int, int]) -> float:
    """Return the length in pixels of the texture's longest wave in a picture."""
    return _BAND[1] * max(shape) / _LONG


def enlargement(shape: tuple[int, int]) -> int:
    """Return how many times larger the picture is that a small one's texture is averaged from."""
    wanted = math.ceil(_ENOUGH / max(shape))
    most = int(math.sqrt(_MOST_PIXELS / (shape[0] * shape[1])))
    return max(min(wanted, most), 1)


def averaged(plane: Array, times: int) -> Array:
    """Return means over squares of `times` px."""
    if times == 1:
        return plane
    # Whole rows first: NumPy is slow along short axes.
    rows = plane[::times].copy()
    for first in range(1, times):
        rows += plane[first::times]
    sums = rows[:, ::times].copy()
    for first in range(1, times):
        sums += rows[:, first::times]
    sums *= np.float32(1.0 / times**2)
    return np.asarray(np.minimum(sums, np.float32(1.0), out=sums))
