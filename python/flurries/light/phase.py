"""Where flakes and drops send the light that falls on them."""

from __future__ import annotations

import math
from typing import NamedTuple

# Asymmetry of snow's crystals and aggregates in visible light, a choice of ours that is less than
# that of drops, since rough crystals scatter wider: Räisänen et al. 2015, "Parameterization of
# single-scattering properties of snow" (The Cryosphere 9, 1277), fit rough droxtals, aggregates of
# plates and distorted fractals to angular measurements of blowing snow.
SNOW = 0.76

# Of water drops, a choice of ours: cloud droplets have some .85 in visible light ("Asymmetry
# factor", Glossary of Meteorology, American Meteorological Society), larger ones a little more.
WATER = 0.87


class Optics(NamedTuple):
    """The optics of particles: how they scatter light."""

    asymmetry: float  # Mean cosine of the angle between the light's ways before and after.
    albedo: float  # Share of the light that goes on.


# Ice hardly absorbs visible light: pure snow sends back .96 to .99 of it, with soot down to .15
# less (Warren and Wiscombe 1980, "A model for the spectral albedo of snow. II", J. Atmos. Sci. 37,
# 2734). A flake's .9 is a choice of ours among these.
FLAKES = Optics(SNOW, 0.9)
DROPS = Optics(WATER, 1.0)


def within(asymmetry: float, angle: float) -> float:
    """Return the share of light that leaves within an angle (radians) of straight on."""
    g = asymmetry
    if g == 0.0:
        return 0.5 * (1.0 - math.cos(angle))
    far = 1.0 / math.sqrt(1.0 + g * g - 2.0 * g * math.cos(angle))
    return (1.0 - g * g) / (2.0 * g) * (1.0 / (1.0 - g) - far)
