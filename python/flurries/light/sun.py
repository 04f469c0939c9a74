"""The sun: one direction, one color, and how much light comes from the sky around."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries._contract import Float64, real, suggesting, vector
from flurries.io.color import parse_hex

__all__ = ["Sun"]


@suggesting
@dataclass(frozen=True)
class Sun:
    """A sun: light from far away for gas that is lit.

    Parameters
    ----------
    direction : (x, y, z)
        Direction in which the light travels, in house axes (x right, y down, z forward of a camera
        that is not turned); (0, 1, 0) shines from straight above, (0, 0, 1) from behind the camera,
        (0, 0, -1) into it. Of any length but 0.
    color : float, (r, g, b) or "#rrggbb"
        Display values, 0 to 1.
    ambient : float
        Share of the light that comes from all sides, 0 to 1.

    Raises
    ------
    ValueError, TypeError
        For a direction of length 0, or a number outside its range; the message names it.

    Examples
    --------
    >>> import flurries as fl
    >>> sun = fl.Sun((0.0, 3.0, 4.0), (1.0, 0.9, 0.8))
    >>> sun.unit().tolist()
    [0.0, 0.6, 0.8]
    """

    direction: tuple[float, float, float] = (0.4, 1.0, 0.3)
    color: Any = 1.0
    ambient: float = 0.3

    def __post_init__(self) -> None:
        settle = object.__setattr__
        way = vector("direction", self.direction, 3)
        if not np.abs(way).max() > 0.0:
            raise ValueError("direction must not be (0, 0, 0): light travels somewhere")
        settle(self, "direction", tuple(way.tolist()))
        if isinstance(self.color, str):
            settle(self, "color", tuple(part / 255 for part in parse_hex("color", self.color)))
        single = np.ndim(self.color) == 0
        given = [real("color", self.color)] * 3 if single else vector("color", self.color, 3)
        settle(self, "color", tuple(real("color", part, low=0.0, high=1.0) for part in given))
        settle(self, "ambient", real("ambient", self.ambient, low=0.0, high=1.0))

    def unit(self) -> Float64:
        """Return the direction of travel with length 1, (3,)."""
        # By the largest part first: squares of tiny or huge numbers leave the range of floats.
        way = np.array(self.direction) / np.abs(self.direction).max()
        return np.asarray(way / np.linalg.norm(way))
