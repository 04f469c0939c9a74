"""How much weather an amount is.

"natural" is the weather of scenes, by their table: what it takes of a picture's contrast follows
from its rate or visibility. "hard" is a share of the contrast, for benchmarks, and more than that
at every step; the air has as much weather as takes it before the picture's own depths.
"""

import math
from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np

from flurries import gas
from flurries._contract import choice, real
from flurries._kept import kept
from flurries.effects import strength as scenes
from flurries.particles.sizes import RAIN, SNOW, Sizes

Profile: TypeAlias = Literal["natural", "hard"]
Kind: TypeAlias = Literal["snow", "rain", "fog"]
PROFILES = ("natural", "hard")
MATTERS = {"snow": SNOW, "rain": RAIN}

# Depths between which snow and rain fall, metres: nearer flakes would be out of focus.
NEAR, FAR = 1.5, scenes.BACKDROP

# The same of the hard profile, for a focal length of so many pixels, whatever a picture's size:
# a small picture has the same flakes in pixels, and stands for what is nearer.
_HARD_ENDS, _LENS = {"snow": (2.0, 4.5), "rain": (1.3, 7.0)}, 600.0

# Smallest and largest flakes and drops of the hard profile, metres, by the heaviest snow and rain:
# smaller ones would be a veil, larger flakes blobs, of 4 px and more. And how much brighter than
# its opacity a drop is, which gathers the light of half the sky.
_ENDS = {"snow": (0.003, 0.013), "rain": (0.002, 0.006)}
GAINS = {"snow": 1.0, "rain": 14.0}

# What bright drops cover over the sum of what each would: .77 to .9, by the exposure.
APART = {"snow": 1.0, "rain": 0.84}

# The contrast that the hard profile takes at the amounts 0, 0.2, ..., 1.
_HARD = {
    "snow": (0.0, 0.12, 0.21, 0.32, 0.45, 0.6),
    "rain": (0.0, 0.06, 0.1, 0.15, 0.21, 0.28),
    "fog": (0.0, 0.3, 0.5, 0.72, 0.9, 0.985),
}


def contrast_loss(amount: float, *, profile: Profile = "natural", weather: Kind = "snow") -> float:
    """Return the share of a picture's contrast that weather of an amount takes before the sky.

    Parameters
    ----------
    amount : float
        0 to 1. Severity n is the amount n / 5.
    profile : {"natural", "hard"}
        "natural" is the weather of :class:`flurries.Snow`, `Rain` and `Mist` of this severity,
        "hard" a scale of losses for benchmarks, above the natural one at every step.
    weather : {"snow", "rain", "fog"}

    Returns
    -------
    float
        1 - cov(seen, clear) / var(clear), the mean opacity, 0 to 1.
    """
    wanted = real("amount", amount, low=0.0, high=1.0)
    kind: Kind = choice("weather", weather, tuple(_HARD))  # type: ignore[assignment]
    if choice("profile", profile, PROFILES) == "hard":
        return hard_loss(kind, wanted)
    way = scenes.BACKDROP if kind == "fog" else FAR - NEAR
    return -math.expm1(-natural(kind, wanted) * way)


def strength(amount: float, profile: Profile, kind: Kind, focal: float) -> scenes.Strength:
    """Return the weather of an amount before a sky, of a picture of 512 px by the hard profile."""
    loss = contrast_loss(amount, profile=profile, weather=kind)
    near, far = depths_of(kind, profile, 512.0 * focal)
    extinction = -math.log1p(-loss) / (far - near)
    seen = gas.visibility(extinction) if extinction > 0.0 else math.inf
    if kind == "fog":
        return scenes.Strength(seen, loss)
    if profile == "natural":
        rate = _rate(kind, amount)
        area = area_of(MATTERS[kind].sizes(max(rate, scenes.LOWEST)))
        return scenes.Strength(seen, loss, rate, extinction / area)
    sizes = sizes_of(kind, 0)
    density = extinction / (GAINS[kind] * APART[kind] * area_of(sizes))
    return scenes.Strength(seen, loss, density * MATTERS[kind].flux(sizes), density)


def depths_of(kind: Kind, profile: Profile, focal: float) -> tuple[float, float]:
    """Return the depths between which weather lies, metres, for a focal length in pixels."""
    if kind == "fog":
        return 0.0, scenes.BACKDROP
    near, far = (end * focal / _LENS for end in _HARD_ENDS[kind])
    return (near, far) if profile == "hard" else (NEAR, FAR)


@kept(256)
def hard_loss(kind: Kind, amount: float) -> float:
    return _between(_HARD[kind], amount)


@kept(256)
def natural(kind: Kind, amount: float) -> float:
    """Return the extinction of natural weather, per metre."""
    if kind == "fog":
        return _between((0.0, *(gas.visibility(seen) for seen in scenes.VISIBILITIES)), amount)
    matter, rate = MATTERS[kind], _rate(kind, amount)
    sizes = matter.sizes(max(rate, scenes.LOWEST))
    return rate / matter.flux(sizes) * area_of(sizes)


def sizes_of(kind: Kind, tenths: int) -> Sizes:
    """Return the sizes of natural weather at tenths of the amount; at 0 the hard profile's."""
    matter = MATTERS[kind]
    if tenths:
        return matter.sizes(_rate(kind, 0.1 * tenths))
    smallest, largest = _ENDS[kind]
    return Sizes.with_slope(smallest, matter.slope(scenes.RATES[kind][-1]), largest)


def area_of(sizes: Sizes) -> float:
    """Return what one flake covers on average, square metres."""
    return scenes.OPACITY * 0.25 * math.pi * sizes.moment(2.0)


def _rate(kind: Kind, amount: float) -> float:
    return _between((0.0, *scenes.RATES[kind]), amount)


def _between(levels: Sequence[float], amount: float) -> float:
    return float(np.interp(scenes.SEVERITIES * amount, range(scenes.SEVERITIES + 1), levels))
