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

# Depths and sizes that stand for all.
_DEPTHS, _SIZES = 40, 5

# Waves in cycles per diameter, and turns, that curves are tabled at.
_WAVES, _TURNS = np.linspace(0.0, 12.0, 481), np.linspace(0.0, 3.0, 301)


class Lens(NamedTuple):
    """What is known of a clip: the focal length in px, frames a second, and their number."""

    focal: float
    fps: float
    frames: int


class Air(NamedTuple):
    """What is looked for: sizes and how they move before a camera."""

    sizes: Sizes
    wind: float  # m/s to the right.
    shutter: float  # Frames.
    floor: float  # Opacity of a flake's brightest place of which half its power is lost.


def bessel(turns: Float64) -> Float64:
    """Return J0 of 2 pi turns: the mean over angles of a wave."""
    angles = np.pi * (np.arange(64) + 0.5) / 64
    return np.asarray(np.cos(2.0 * np.pi * turns[..., None] * np.cos(angles)).mean(axis=-1))


@cache
def tables() -> tuple[Float64, Float64]:
    """Return the transform of a ball of diameter 1 at `_WAVES`, and `bessel` at `_TURNS`."""
    r = 0.5 * (np.arange(96) + 0.5) / 96
    rings = -np.expm1(-_MIDDLE * np.sqrt(1.0 - 4.0 * r**2)) * 2.0 * np.pi * r * (0.5 / 96)
    return np.asarray(bessel(_WAVES[:, None] * r) @ rings), bessel(_TURNS)


def held(shift: Float64) -> Float64:
    """Return the share of what moved by px along a side that is in both of its Hann windows."""
    x = np.minimum(np.abs(shift) / WINDOW, 1.0)
    turn = 2.0 * np.pi * x
    return np.asarray((1.0 - x) * (2.0 + np.cos(turn)) / 3.0 + np.sin(turn) / (2.0 * np.pi))


def fan(air: Air, lens: Lens, angle: float, waves: tuple[Float64, Float64], lags: range) -> Float64:
    """Return the real part of the spectrum between frames of one flake per m3, (lags, n), px^2.

    Waves (n,) are in cycles per pixel, along an angle and across it.
    """
    sizes, cos, sin = air.sizes, math.cos(angle), math.sin(angle)
    edges = np.linspace(sizes.smallest, sizes.largest, _SIZES + 1)
    nodes = [sizes.nodes(low, high) for low, high in pairwise(edges.tolist())]
    power = np.array([share @ at**4 for at, share in nodes])
    diameter = (power / [share.sum() for _, share in nodes]) ** 0.25
    ends = np.geomspace(NEAR, FAR, _DEPTHS + 1)
    depth, thick = np.sqrt(ends[1:] * ends[:-1]), math.log(ends[1] / ends[0])
    # Of each depth and size: px that a metre has, a flake's width, its velocity, and their power.
    scale = lens.focal / depth[:, None]
    image = (scale * diameter).ravel()
    x, y = (scale / lens.fps * speed for speed in (np.full(_SIZES, air.wind), SNOW.speed(diameter)))
    u, v = (cos * x + sin * y).ravel(), (cos * y - sin * x).ravel()
    weight = (np.diff(ends)[:, None] * scale**2 * power).ravel()
    # A codec drops what is faint.
    disc = 0.25 * math.pi * image**2
    width = np.sqrt(disc + 1.0)
    peak = OPACITY * disc / (width * (width + np.hypot(u, v) * air.shutter))
    weight /= 1.0 + (air.floor / peak) ** 2
    (along, across), (ball, swinging) = waves, tables()
    turns = along[:, None] * u + across[:, None] * v
    single = np.interp(np.hypot(along, across)[:, None] * image, _WAVES, ball, right=0.0) ** 2
    single *= np.sinc(turns * air.shutter) ** 2 * weight
    # Pixels are squares.
    kx, ky = along * cos - across * sin, along * sin + across * cos
    box = (np.sinc(kx) * np.sinc(ky)) ** 2
    still: Float64 | float = 0.0
    if lens.frames > 1:
        # What stands still goes with the mean, and of the rest one part of all frames.
        still = np.maximum(np.sinc(lens.frames * turns) ** 2, 1.0 / lens.frames)
    swings = np.abs(kx)[:, None] * np.repeat(scale, _SIZES) * 2.0 * _SWAY
    found = []
    for lag in lags:
        # Depths that one stands for differ in what they turn by.
        seen = np.cos(2.0 * np.pi * lag * turns) * np.sinc(lag * turns * thick)
        if lag:
            swing = swings * math.sin(0.5 * _RATE * lag / lens.fps)
            seen *= np.interp(swing, _TURNS, swinging, right=0.0)
            seen *= held(lag * u * cos) * held(lag * u * sin)
        found.append(box * np.sum(single * (seen - still), axis=1))
    return np.array(found)
