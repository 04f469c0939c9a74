"""Even veils of what is too far and too fine for anything else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flurries._contract import Array
from flurries.frame.needs import LeftOut, Needs, Step
from flurries.frame.view import Frame
from flurries.motion.keys import Number, value_at


@dataclass(frozen=True, eq=False)
class Veil:
    haze: Number  # Its opacity before the sky, 0 to 1.
    far: float  # The depth from which on it is whole, metres.

    def needs(self, frame: Frame, amount: float) -> Needs:
        haze = amount * float(value_at(self.haze, frame.t))
        if haze == 0.0:
            return Needs((), (LeftOut("veil", "its opacity is 0"),), most=0.0)
        deep = frame.deep or frame.depth is not None
        return Needs((Step("veil"),) if deep else (), most=haze)

    def alpha(self, frame: Frame, amount: float) -> Array:
        depth, haze = frame.depth, amount * float(value_at(self.haze, frame.t))
        assert depth is not None
        return frame.standing(self, haze, lambda: haze_before(frame.crop(depth), haze, self.far))


def haze_before(depth: Array, haze: float, far: float) -> Array:
    """Return the opacity of a veil: its optical depth grows with the way, up to `far`."""
    way = np.minimum(depth / np.float32(far), np.float32(1.0))
    return np.asarray(1.0 - (1.0 - haze) ** way, np.float32)
