"""The scene's sun and lamps, and where flakes and drops send the light that falls on them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from flurries import _core
from flurries._contract import LARGEST, Float64, flag, real, suggesting, vector
from flurries.io.color import parse_hex
from flurries.motion.keys import Keys, Number, as_number, as_vector, value_at

# Numbers of a lamp in a row for kernels: kind, place, way, color, two cosines, radius, and the
# extinction of the air from the lamp to a particle and from there to the eye.
ROW = 15


class Optics(NamedTuple):
    """The optics of particles: how they scatter light."""

    asymmetry: float  # Mean cosine of the angle between the light's ways before and after.
    albedo: float  # Share of the light that goes on.


# Choices of ours. Rough crystals scatter wider than drops: Räisänen et al. 2015 (The Cryosphere 9,
# 1277) fit droxtals, aggregates and fractals to blowing snow. Pure snow sends back .96 to .99 of
# visible light, with soot down to .15 less: Warren and Wiscombe 1980 (J. Atmos. Sci. 37, 2734).
FLAKES = Optics(0.76, 0.9)
# Cloud droplets have some .85 (AMS, Glossary of Meteorology), larger ones a little more.
DROPS = Optics(0.87, 1.0)


@suggesting
@dataclass(frozen=True)
class Sun:
    """A sun: light from far away for gas that is lit.

    Parameters
    ----------
    direction : (x, y, z)
        Direction in which the light travels, of any length but 0, in house axes (x right, y down, z
        forward): (0, 1, 0) shines from straight above, (0, 0, -1) into a camera that is not turned.
    color, ambient : float, (r, g, b) or "#rrggbb"; float
        Display values, 0 to 1; and the share of the light that comes from all sides, 0 to 1.
    """

    direction: tuple[float, float, float] = (0.4, 1.0, 0.3)
    color: Any = 1.0
    ambient: float = 0.3

    def __post_init__(self) -> None:
        settle = object.__setattr__
        settle(self, "direction", tuple(_way(vector("direction", self.direction, 3)).tolist()))
        color = self.color
        if isinstance(color, str):
            color = [part / 255 for part in parse_hex("color", color)]
        given = [color] * 3 if np.ndim(color) == 0 else vector("color", color, 3)
        settle(self, "color", tuple(real("color", part, low=0.0, high=1.0) for part in given))
        settle(self, "ambient", real("ambient", self.ambient, low=0.0, high=1.0))

    def unit(self) -> Float64:
        """Return the direction of travel with length 1, (3,)."""
        # By the largest part first: squares of tiny or huge numbers leave the range of floats.
        way = np.array(self.direction) / np.abs(self.direction).max()
        return np.asarray(way / np.linalg.norm(way))


@suggesting
@dataclass(frozen=True)
class Lamp:
    """Light that falls on flakes and drops.

    With a `place` alone it shines to all sides, with a `direction` alone it is a sun; with both and
    an `angle` it is a spot.

    Parameters
    ----------
    place : (x, y, z), optional
        Metres, house axes: x right, y down, z forward of the camera at frame 0. Keyed.
    direction : (x, y, z), optional
        Direction in which the light travels, of any length but 0. Keyed.
    angle, soft : float
        Angle of a spot's cone from rim to rim, radians, and the share of the cone over which it
        fades at its rim, 0 to 1.
    color : float or (r, g, b)
        Color in linear light. Keyed.
    power : float
        Radiant intensity: a white wall at 1 m, lit straight on, is power / pi as bright as paper
        white. For a sun the irradiance. Keyed.
    radius : float
        Radius of the lamp itself, metres. Nothing is lit more brightly than the lamp's surface.
    carried : bool
        Whether place and direction are in the camera's axes and go with it, as headlights do.

    Examples
    --------
    >>> import flurries as fl
    >>> street = fl.scene.Lamp((2.0, -3.0, 8.0), color=(1.0, 0.6, 0.25), power=60.0)
    >>> car = fl.scene.Lamp((0.6, 0.8, 0), direction=(0, 0, 1), angle=0.6, power=300, carried=True)
    """

    place: Any = None
    direction: Any = None
    angle: float | None = None
    soft: float = 0.3
    color: Any = 1.0
    power: Number = 10.0
    radius: float = 0.05
    carried: bool = False

    def __post_init__(self) -> None:
        settle = object.__setattr__
        if self.place is None and self.direction is None:
            raise ValueError("a lamp needs a place, a direction (a sun), or both (a spot)")
        if self.place is not None:
            settle(self, "place", as_vector("place", self.place, 3))
        if self.direction is not None:
            settle(self, "direction", as_vector("direction", self.direction, 3))
            keyed = isinstance(self.direction, Keys)
            for way in [v for _, v in self.direction.keys] if keyed else [self.direction]:
                _way(np.asarray(way))
        spot = self.place is not None and self.direction is not None
        if spot != (self.angle is not None):
            raise ValueError("a spot has a place, a direction and an angle; other lamps no angle")
        if self.angle is not None:
            settle(self, "angle", real("angle", self.angle, above=0.0, high=2.0 * math.pi))
        settle(self, "soft", real("soft", self.soft, low=0.0, high=1.0))
        settle(self, "color", as_light("color", self.color))
        settle(self, "power", as_number("power", self.power, low=0.0))
        settle(self, "radius", real("radius", self.radius, above=0.0))
        settle(self, "carried", flag("carried", self.carried))

    def row(self, t: float, matrix: Float64, eye: Float64) -> Float64:
        """Return the lamp at frame `t` as kernels read it, in the axes of a camera at a place."""
        row = np.zeros(ROW)
        turn = np.eye(3) if self.carried else matrix
        if self.place is None:
            row[0] = 1.0
        else:
            place = np.asarray(value_at(self.place, t), np.float64)
            row[1:4] = (place - (0.0 if self.carried else eye)) @ turn
        if self.direction is not None:
            way = np.asarray(value_at(self.direction, t), np.float64)
            row[4:7] = way / np.linalg.norm(way) @ turn
        color = np.asarray(value_at(self.color, t), np.float64) * value_at(self.power, t)
        row[7:10] = np.broadcast_to(color, 3)
        row[10:12] = -1.0
        if self.angle is not None:
            rim = 0.5 * self.angle
            row[10:12] = math.cos(rim * (1.0 - self.soft)), math.cos(rim)
        row[12] = self.radius
        return row


def _way(direction: Float64) -> Float64:
    if not np.abs(direction).max() > 0.0:
        raise ValueError("direction must not be (0, 0, 0): light travels somewhere")
    return direction


def as_light(name: str, value: Any, high: float = math.inf) -> Any:
    """Return one grey or (r, g, b), plain or keyed, from 0 on."""
    if isinstance(value, Keys):
        for _, part in value.keys:
            as_light(name, part, high)
        return value
    if not isinstance(value, (list, tuple)) and np.ndim(value) == 0:
        return real(name, value, low=0.0, high=high)
    most, plain = min(high, LARGEST), isinstance(value, tuple) and len(value) == 3
    if plain and all(isinstance(part, float) and 0.0 <= part <= most for part in value):
        return value
    return tuple(real(name, part, low=0.0, high=high) for part in vector(name, value, 3).tolist())


def radiance(points: Float64, rows: Float64, optics: Optics, eye: Float64) -> Float64:
    """Return the light of particles at points (n, 3) towards an eye, (n, 3); camera axes."""
    found = np.empty((len(points), 3))
    x, y, z = (float(part) for part in eye)
    _core.lamp_light(found, np.ascontiguousarray(points, np.float64), rows, optics, (x, y, z))
    return found


def within(asymmetry: float, angle: float) -> float:
    """Return the share of light that leaves within an angle (radians) of straight on."""
    g = asymmetry
    if g == 0.0:
        return 0.5 * (1.0 - math.cos(angle))
    far = 1.0 / math.sqrt(1.0 + g * g - 2.0 * g * math.cos(angle))
    return (1.0 - g * g) / (2.0 * g) * (1.0 / (1.0 - g) - far)
