"""What a population's flakes make of the space-time spectrum: a fan of planes, one for each depth.

All planes share the line of waves that lie across the motion. Flakes of diameter D at depth Z are
f D / Z px wide and move by f v(D) / Z: the fan's opening is v / D, which the law of fall turns into
metres. What varies is the optical density of a Poisson process, whose spectrum is the sum of those
of its flakes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from flurries._contract import Float64
from flurries.particles.sizes import Matter, Sizes

# Depths and sizes that stand for all.
_DEPTHS, _SIZES = 40, 5

# The spectrum of a ball of an opacity by waves, in cycles per diameter.
_WAVES = np.linspace(0.0, 12.0, 481)


# Bessel's J0 of turns: flakes that swing at RATE radians a second, each with a phase of its own.
RATE = 4.0
_TURNS = np.linspace(0.0, 3.0, 301)
_BESSEL = np.cos(2.0 * np.pi * _TURNS[:, None] * np.cos(np.pi * (np.arange(64) + 0.5) / 64)).mean(
    axis=1
)


@dataclass(frozen=True)
class Air:
    """What is looked for: a population and how it moves before a camera."""

    density: float  # Per cubic metre.
    sizes: Sizes
    wind: tuple[float, float]  # m/s, right and down, relative to the camera.
    shutter: float  # Frames.
    sway: float  # Amplitude of its swinging, metres.
    floor: float = 0.0  # Opacity of a flake's brightest place of which half its power is lost.


@dataclass(frozen=True)
class Lens:
    """What is known: the focal length in px, frames a second, depths in metres, the opacity."""

    focal: float
    fps: float
    near: float
    far: float
    opacity: float
    matter: Matter
    window: int  # Width in px of the windows that spectra were taken of.
    frames: int  # Whose mean was taken off.


def middle_depth(opacity: float) -> float:
    """Return the optical depth of a ball's middle that covers `opacity` of its disc."""
    low, high = 0.0, 100.0
    for _ in range(100):
        tau = 0.5 * (low + high)
        cover = 1.0 - 2.0 * (1.0 - (1.0 + tau) * math.exp(-tau)) / tau**2
        low, high = (tau, high) if cover < opacity else (low, tau)
    return 0.5 * (low + high)


@cache
def ball(opacity: float) -> Float64:
    """Return the transform of a ball of diameter 1 at `_WAVES`."""
    # Rings of its radius: J0 as a mean over angles.
    r = 0.5 * (np.arange(96) + 0.5) / 96
    profile = -np.expm1(-middle_depth(opacity) * np.sqrt(1.0 - 4.0 * r**2))
    angles = np.pi * (np.arange(48) + 0.5) / 48
    rings = np.cos(2.0 * np.pi * _WAVES[:, None, None] * r[:, None] * np.cos(angles)).mean(axis=2)
    return np.asarray(rings @ (profile * 2.0 * np.pi * r) * (0.5 / 96))


def faded(window: int, shift: Float64) -> Float64:
    """Return the share that a window of Hann holds of what moved by shifts, px."""
    # Along one axis: the window's correlation with itself.
    x = np.minimum(np.abs(shift) / window, 1.0)
    return np.asarray(
        (1.0 - x) * (2.0 + np.cos(2 * np.pi * x)) / 3.0 + np.sin(2 * np.pi * x) / (2.0 * np.pi)
    )


def fan(
    air: Air, lens: Lens, angle: float, waves: tuple[Float64, Float64], lags: tuple[int, ...]
) -> Float64:
    """Return the real part of the spectrum between frames, (lags, n), px^2, at waves (n,).

    Waves are in cycles per pixel, along an angle and across it.
    """
    sizes, law = air.sizes, lens.matter.speed
    step = (sizes.largest - sizes.smallest) / _SIZES
    edges = sizes.smallest + step * np.arange(_SIZES + 1)
    nodes = [sizes.nodes(a, b) for a, b in pairwise(edges)]
    share = np.array([part.sum() for _, part in nodes])
    diameter = np.array([(part @ at**4 / part.sum()) ** 0.25 for at, part in nodes])
    power = np.array([part @ at**4 / part.sum() for at, part in nodes]) / diameter**4
    ends = np.geomspace(lens.near, lens.far, _DEPTHS + 1)
    depth, thick = np.sqrt(ends[1:] * ends[:-1]), math.log(ends[1] / ends[0])
    volume = np.diff(ends) * depth**2 / lens.focal**2
    image = (lens.focal * diameter / depth[:, None]).ravel()  # (depths * sizes,)
    weight = (air.density * volume[:, None] * (share * power)).ravel() * image**4
    # Of each size: along and across the motion of the mean one.
    fall = law(diameter)
    (along, across), unit = waves, np.array([math.cos(angle), math.sin(angle)])
    velocity = np.stack([np.full(_SIZES, air.wind[0]), air.wind[1] + fall])
    scale = lens.focal / lens.fps / depth[:, None]
    u = (scale * (unit @ velocity)).ravel()
    v = (scale * (np.array([-unit[1], unit[0]]) @ velocity)).ravel()
    k = np.hypot(across, along)
    table = ball(lens.opacity)
    single = np.interp(k[:, None] * image, _WAVES, table, right=0.0) ** 2
    turns = along[:, None] * u + across[:, None] * v
    if air.floor > 0.0:
        # A codec drops what is faint.
        disc = 0.25 * math.pi * image**2
        width, length = np.sqrt(disc + 1.0), np.hypot(u, v) * air.shutter
        peak = lens.opacity * disc / (width * (width + length))
        weight = weight / (1.0 + (air.floor / peak) ** 2)
    single *= np.sinc(turns * air.shutter) ** 2 * weight
    # A picture's pixels are squares.
    kx, ky = along * unit[0] - across * unit[1], along * unit[1] + across * unit[0]
    box = (np.sinc(kx) * np.sinc(ky)) ** 2
    # What stands still goes with the mean, and of the rest one part of all frames.
    still = np.maximum(np.sinc(lens.frames * turns) ** 2, 1.0 / lens.frames)
    swings = kx[:, None] * np.repeat(lens.focal / depth, _SIZES) * 2.0 * air.sway
    found = []
    for lag in lags:
        held = faded(lens.window, lag * u * unit[0]) * faded(lens.window, lag * u * unit[1])
        # Depths that one stands for differ in what they turn by.
        seen = np.cos(2.0 * np.pi * lag * turns) * np.sinc(lag * turns * thick)
        if lag:
            swing = swings * math.sin(0.5 * RATE * lag / lens.fps)
            seen *= held * np.interp(np.abs(swing), _TURNS, _BESSEL, right=0.0)
        found.append(box * np.sum(single * (seen - still), axis=1))
    return np.array(found)
