"""What a population's flakes make of the space-time spectrum: a fan of planes, one for each depth.

All planes share the line of waves that lie across the motion. Flakes of diameter D at depth Z are
f D / Z px wide and move by f v(D) / Z: the fan's opening is v / D, which the law of fall turns into
metres. What varies is the optical density of a Poisson process, whose spectrum is the sum of those
of its flakes.
"""

import math
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flurries._contract import Float64
from flurries.matching.direction import WINDOW
from flurries.particles.sizes import SNOW, Sizes

# Depths in metres between which snow is taken to be, and the opacity of its flakes, which is that
# of balls whose middle has the optical depth: those of `Snow`. So is how far flakes swing, metres,
# at radians a second and each with a phase of its own.
NEAR, FAR, OPACITY, _MIDDLE = 0.4, 60.0, 0.9, 4.3096
_SWAY, _RATE = 0.02, 4.0

# Depths and sizes that stand for all; so many depths are one group with each of the sizes.
_DEPTHS, _SIZES, _FEWER = 40, 5, 10
GROUPS = _FEWER * _SIZES

# Waves in cycles per diameter that a ball is tabled at.
_WAVES = np.linspace(0.0, 12.0, 481)


class Lens(NamedTuple):
    """What is known of a clip: the focal length in px, frames a second, their number and size."""

    focal: float
    fps: float
    frames: int
    size: tuple[int, int]  # (width, height)


class Air(NamedTuple):
    """What is looked for: sizes and how they move before a camera."""

    sizes: Sizes
    wind: float  # m/s to the right.
    shutter: float  # Frames.
    floor: float  # Opacity of a flake's brightest place of which half its power is lost.


@cache
def ball() -> Float64:
    """Return the transform of a ball of diameter 1 at `_WAVES`."""
    r, angles = 0.5 * (np.arange(96) + 0.5) / 96, np.pi * (np.arange(64) + 0.5) / 64
    rings = -np.expm1(-_MIDDLE * np.sqrt(1.0 - 4.0 * r**2)) * 2.0 * np.pi * r * (0.5 / 96)
    turns = 2.0 * np.pi * _WAVES[:, None] * r
    return np.asarray(np.cos(turns[..., None] * np.cos(angles)).mean(axis=-1) @ rings)


def held(shift: Float64) -> Float64:
    """Return the share of what moved by px along a side that is in both of its Hann windows."""
    x = np.minimum(np.abs(shift) / WINDOW, 1.0)
    turn = 2.0 * np.pi * x
    return np.asarray((1.0 - x) * (2.0 + np.cos(turn)) / 3.0 + np.sin(turn) / (2.0 * np.pi))


def fan(
    air: Air, lens: Lens, angle: float, waves: tuple[Float64, Float64], lags: range
) -> tuple[Float64, Float64]:
    """Return the real part of the spectrum between frames of one flake per m3, px^2.

    It is (lags, n, `GROUPS`), by groups of depths and sizes; waves (n,) are in cycles per pixel,
    along an angle and across it. The second is the number of flakes in a group: a few near and
    large ones have most of the power.
    """
    sizes, cos, sin = air.sizes, math.cos(angle), math.sin(angle)
    edges = np.linspace(sizes.smallest, sizes.largest, _SIZES + 1)
    nodes = [sizes.nodes(low, high) for low, high in pairwise(edges.tolist())]
    power = np.array([share @ at**4 for at, share in nodes])
    shares = np.array([share.sum() for _, share in nodes])
    diameter = (power / shares) ** 0.25
    ends = np.geomspace(NEAR, FAR, _DEPTHS + 1)
    depth, thick = np.sqrt(ends[1:] * ends[:-1]), math.log(ends[1] / ends[0])
    # Of each depth and size: px that a metre has, a flake's width, its velocity, and their power.
    scale, deep = lens.focal / depth[:, None], np.diff(ends)[:, None]
    image = (scale * diameter).ravel()
    x, y = (scale / lens.fps * speed for speed in (np.full(_SIZES, air.wind), SNOW.speed(diameter)))
    u, v = (cos * x + sin * y).ravel(), (cos * y - sin * x).ravel()
    weight = (deep * scale**2 * power).ravel()
    # A codec drops what is faint.
    disc = 0.25 * math.pi * image**2
    width = np.sqrt(disc + 1.0)
    peak = OPACITY * disc / (width * (width + np.hypot(u, v) * air.shutter))
    weight /= 1.0 + (air.floor / peak) ** 2
    along, across = waves
    turns = along[:, None] * u + across[:, None] * v
    single = np.interp(np.hypot(along, across)[:, None] * image, _WAVES, ball(), right=0.0) ** 2
    single *= np.sinc(turns * air.shutter) ** 2 * weight
    # Pixels are squares.
    kx, ky = along * cos - across * sin, along * sin + across * cos
    box = (np.sinc(kx) * np.sinc(ky)) ** 2
    still: Float64 | float = 0.0
    if lens.frames > 1:
        # What stands still goes with the mean, or what moves by whole waves from frame to frame.
        part = turns - np.rint(turns)
        still = (np.sinc(lens.frames * part) / np.sinc(part)) ** 2
    found = []
    for lag in lags:
        # Depths that one stands for differ in what they turn by, and each flake swings.
        seen = np.cos(2.0 * np.pi * lag * turns) * np.sinc(lag * turns * thick)
        if lag:
            swing = 2.0 * np.pi * _SWAY * math.sin(0.5 * _RATE * lag / lens.fps)
            seen *= np.exp(-((swing * kx[:, None] * np.repeat(scale, _SIZES)) ** 2))
            seen *= held(lag * u * cos) * held(lag * u * sin)
        planes = (single * (seen - still)).reshape(len(along), _FEWER, -1, _SIZES).sum(axis=2)
        found.append(box[:, None] * planes.reshape(len(along), -1))
    wide, high = lens.size
    area = wide * high + (lens.frames - 1) * (np.abs(x) * high + np.abs(y) * wide)
    number = (area / scale**2 * deep * shares).reshape(_FEWER, -1, _SIZES).sum(axis=1)
    return np.array(found), number.ravel()
