"""A lens with an opening: how far out of focus a flake is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from flurries._contract import integer, real, suggesting
from flurries.motion.keys import Number, as_number, value_at


class Blur(NamedTuple):
    """A lens at one time, for a picture of a size."""

    strength: float  # The circle of confusion is strength * |focus - 1/z| px wide.
    focus: float  # One over the depth in focus, 1/m.
    blades: int  # Of the opening; 0 for a round one.
    turn: float  # Of the opening, radians.

    def circle(self, depth: Any) -> Any:
        """Return the diameter of the circle of confusion at depths in metres, px."""
        return self.strength * abs(self.focus - 1.0 / depth)


@suggesting
@dataclass(frozen=True)
class Lens:
    """A lens of finite opening: flakes and drops that are not in focus are soft, large and faint.

    Only the weather is blurred: the background is a picture that a lens has made already. The
    circle of confusion of a thin lens of focal length F, f-stop N, focused at s, at the depth z is
    F^2 / N * |z - s| / (z (s - F)) wide on the sensor. Its disc keeps a flake's energy.

    Parameters
    ----------
    focus : float
        Depth that is sharp, metres; ``math.inf`` for far away. Keyed.
    f_stop : float
        Focal length over the width of the opening. Keyed.
    sensor : float
        Width of the sensor, metres: how long the camera's focal length in pixels is.
    blades, turn : int, float
        Of the opening: 5 or more make discs with corners, 0 makes round discs; and its rotation,
        radians.

    Examples
    --------
    >>> import flurries as fl
    >>> lens = fl.camera.Lens(focus=4.0, f_stop=1.8, blades=6)
    >>> round(lens.circle(1.0, focal=1200.0, width=1000), 1)
    21.8
    """

    focus: Number
    f_stop: Number = 2.8
    sensor: float = 0.036
    blades: int = 0
    turn: float = 0.0

    def __post_init__(self) -> None:
        if not (isinstance(self.focus, float) and self.focus == math.inf):
            vars(self)["focus"] = as_number("focus", self.focus, above=0.0)
        blades = integer("blades", self.blades, low=0, high=64)
        if 0 < blades < 3:
            raise ValueError(f"blades must be 0 or from 3 on, got {blades}")
        vars(self).update(
            f_stop=as_number("f_stop", self.f_stop, above=0.0), blades=blades,
            sensor=real("sensor", self.sensor, above=0.0, high=1.0), turn=real("turn", self.turn),
        )  # fmt: skip

    def blur(self, t: float, *, focal: float, width: int) -> Blur:
        """Return the lens at frame `t` for a picture `width` px wide of a focal length in px."""
        long = focal * self.sensor / width
        focus, stop = float(value_at(self.focus, t)), float(value_at(self.f_stop, t))
        if focus <= long:
            wanted = f"farther than the lens is long, {long:.3g} m"
            raise ValueError(f"focus must be {wanted}, got {focus:g}")
        # s / (s - F) with s at infinity.
        ratio = 1.0 / (1.0 - long / focus)
        strength = long**2 / stop * ratio * width / self.sensor
        return Blur(strength, 1.0 / focus, self.blades, self.turn)

    def circle(self, depth: float, *, focal: float, width: int, t: float = 0.0) -> float:
        """Return the circle of confusion at a depth in metres, px; focal and width in px too."""
        blur = self.blur(t, focal=focal, width=width)
        return float(blur.circle(real("depth", depth, above=0.0)))


# The lens of photographs and films where none is given: one of 45 degrees by day. From 3 m on a
# picture 1000 px wide has circles of confusion of less than 2.3 px.
USUAL = Lens(focus=10.0, f_stop=5.6)
