"""The veil of a population: an even haze, and the air beyond the last flakes that are shown."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flurries._contract import Array
from flurries.effects.veil import veil_needs
from flurries.effects.weather import Weather
from flurries.frame.needs import Needs
from flurries.frame.view import Frame
from flurries.motion.keys import Number, value_at


@dataclass(frozen=True, eq=False)
class Haze:
    """A veil whose optical depth grows with the way through it."""

    # Beyond its last flakes the veil has the extinction of those that would be there.
    weather: Weather
    haze: Number  # Opacity of what is besides between the camera and the farthest flakes, 0 to 1.

    def needs(self, frame: Frame, amount: float) -> Needs:
        """Return its step before a scene with a depth; without one it takes nothing."""
        haze = amount * float(value_at(self.haze, frame.t))
        return veil_needs(frame, haze, before=1.0 - 1e-6)

    def alpha(self, frame: Frame, amount: float) -> Array:
        """Return the opacity before the scene's depth over the window, (h, w) float32."""
        assert frame.depth is not None
        return frame.here(self, "veil", lambda: self._before(frame, amount))

    def _before(self, frame: Frame, amount: float) -> Array:
        assert frame.depth is not None
        depth, far = frame.crop(frame.depth), self.weather.far
        # Plain floats keep arrays in float32, where exp is on vector lanes and expm1 is not.
        haze = min(amount * float(value_at(self.haze, frame.t)), 1.0 - 1e-9)
        emission = float(value_at(self.weather.emission, frame.t))
        beyond = amount * emission * self.weather.population.extinction
        thickness = np.maximum(depth - far, 0.0)
        # Where nothing stands the weather ends with its flakes.
        thickness[thickness == np.inf] = 0.0
        thickness *= beyond
        if haze > 0.0:
            thickness += np.minimum(depth * (1.0 / far), 1.0) * -math.log1p(-haze)
        np.exp(np.negative(thickness, out=thickness), out=thickness)
        return np.subtract(1.0, thickness, out=thickness)
