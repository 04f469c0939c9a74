"""Mist, fog and clouds: a box of splatted particles that the wind moves (Johnson 2005)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, fields, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from flurries import gas
from flurries._contract import choice, flag, integer, real, seed_of, suggestion, vector
from flurries.effects.bank import Bank
from flurries.effects.checks import Check, length, one_of, optional, part, settle, share
from flurries.effects.cloud import MOST, Cloud
from flurries.effects.color import AMBIENT, LOCAL, Color, as_color, color_at, reads_of
from flurries.effects.described import Described
from flurries.effects.knobs import knobs
from flurries.effects.lighting import Base, even_shade
from flurries.effects.looks import LOOKS, mist_density, severity_of
from flurries.effects.presets import BANKS, MIST, MistLook
from flurries.effects.sunlight import SCATTER, Law, Scatter
from flurries.frame.costs import nanoseconds
from flurries.frame.layer import Layer
from flurries.frame.needs import Cost, LeftOut, Needs, Saving, Step, has_keys
from flurries.frame.view import Frame
from flurries.gas.splatting import FOOTPRINTS, Footprint
from flurries.gas.visibility import count_for_visibility
from flurries.io.color import linear_to_srgb
from flurries.motion.keys import Keys, Number, Vector, as_number, as_vector, value_at
from flurries.trace import stage

# The steepest place of the sRGB encoding, at black: display values per linear light.
STEEPEST = 12.92

# How many times as bright as white lamps may make it.
LAMPS = 100.0

BLACK = (0.0, 0.0, 0.0)

# The paper's fog: a radius of .45 in a box of 5.
RADIUS = 0.09

# A box whose fog hides what lies behind it, where a visibility is given and no box.
REACH = 1.2


_VISIBILITY: Check = optional(partial(as_number, above=0.0))
_CHECKS: dict[str, Check] = {
    "look": one_of(LOOKS),
    "amount": share,
    "density": share,
    "color": lambda _, value: as_color(value, (AMBIENT, LOCAL)),
    "wind": lambda name, value: as_vector(name, value, 3),
    "count": optional(partial(integer, low=0, high=MOST)),
    "radius": length,
    "center": optional(lambda name, value: tuple(vector(name, value, 3).tolist())),
    "depths": optional(lambda _, value: _depths(value)),
    "footprint": one_of(FOOTPRINTS),
    "near": length,
    "lit": flag,
    "forward": part,
    "scatter": one_of(SCATTER),
    "asymmetry": partial(real, low=-0.99, high=0.99),
    "structure": partial(real, low=0.0, high=2.0),
    "top": optional(real),
    "falloff": length,
    "seed": optional(lambda _, value: seed_of(value)),
}


def _of_severity(value: object, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the density so that the gas takes a severity's share of what lies behind the box."""
    severity = severity_of(value)
    if given.get("visibility") is not None:
        raise TypeError("severity and visibility say the same: give one of them")
    if "density" in given:
        raise TypeError("severity and density say the same: give one of them")
    box = Mist(**given)
    beta = gas.extinction(box.count or 0, box._volume, box.parts.radius, 1.0)
    return {"density": mist_density(severity, beta * box.parts.through)}


def _of_visibility(value: object, given: Mapping[str, Any]) -> dict[str, Any]:
    if "visibility" in given:
        raise TypeError("visibility_m and visibility say the same: give one of them")
    return {"visibility": real("visibility_m", value, above=0.0)}


@knobs(severity=_of_severity, visibility_m=_of_visibility)
@dataclass(frozen=True, kw_only=True)
class Mist(metaclass=Described):
    """Gas that one sees into: mist, fog, clouds.

    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres when
    the camera's places are.

    Parameters
    ----------
    amount : float
        How much of it, 0 to 1; scales the density. Keyed.
    count : int, optional
        Particles in the box. If neither this nor `visibility` is given, the fog's 1200.
    visibility : float, optional
        In place of a count: the distance in metres at which a black object keeps 5 % of its
        contrast, by :func:`flurries.gas.count_for_visibility`. Keyed: the density follows. With
        `count` the density follows from both, in place of `density`.
    radius : float, optional
        Three sigma of a particle, metres; 0.09 of the box if not given.
    density : float
        Opacity of a particle's middle, 0 to 1. Keyed.
    color : float, (r, g, b), "#rrggbb", "ambient" or "local"
        Display values, 0 to 1. Keyed. "ambient" is white in the background's own light. "local" is
        one color for the picture, that of its sky: fog is no smoke, and as dark as the night. The
        paper's presets have colors of their own.
    wind : (x, y, z)
        Air velocity, metres per second, x right, y down, z away from the camera. Keyed.
    box : float or (x, y, z), optional
        Sides of the box that the gas fills, metres. If not given, 5, or 1.2 times the visibility.
    center : (x, y, z), optional
        The middle of the box in the world, house axes, metres. If not given, the box goes with the
        camera, which stands inside; it is then made as wide as the view at its far end, with as
        many particles more.
    depths : (near, far), optional
        Only the gas between these depths, metres: one effect can stand behind flakes, and another
        of the same seed in front of them.
    footprint : str
        See :func:`flurries.gas.splat`. Particles nearer than four radii are always drawn by their
        line integral.
    near : float
        Depth before which nothing is drawn, metres.
    lit : bool
        Whether the scene's sun shades the gas and the gas itself. Lamps shine on it in any case.
    forward : float
        Share of the sun's light that a particle passes on to those behind it, 0 to 1.
    scatter : {"rayleigh", "henyey", "even"}
        Where light is scattered to, see :func:`flurries.gas.phase`.
    asymmetry : float
        Of "henyey", -0.99 to 0.99.
    structure : float
        Detail at every scale, from a bank's size down to 4 px: the root mean square of the
        logarithm of the density of a slice of the gas, 0 to 2. The gas is then no particles but a
        bank with soft ends whose mean extinction is the same. 0 is the paper's gas.
    top : float, optional
        With `structure`: height in the world above which the mist thins, metres, up; the camera
        begins at 0. Endless if not given.
    falloff : float
        How fast it thins there: over this many metres its density falls from .73 to .27.
    look : {"v1"}
        Version of the looks, as in :class:`TentSnow`.
    seed : int, optional
        Of this effect; the scene's if not given.
    severity : int, optional
        One knob: 1 to 5 take 6, 14, 25, 38 and 55 % of the contrast of what lies behind the box.
        Sets `density`. No field: what it makes is written out.
    visibility_m : float, optional
        One knob: the `visibility`, in metres.

    Raises
    ------
    ValueError, TypeError
        For an argument outside its range; the message names it.

    Notes
    -----
    Johnson 2005, section 4: the presets "clouds", "mist" and "fog" have the paper's numbers. The
    paper does not say how large its box was. With `structure` the logarithm of the density has the
    spectrum of a passive gas in turbulence, k^(-11/3) in each slice (Kolmogorov 1941).

    Examples
    --------
    >>> import flurries as fl
    >>> fog = fl.Mist.preset("fog", wind=(0.4, 0.0, 0.0))
    >>> fog.count, round(fog.extinction(), 3)
    (1200, 0.515)
    >>> round(fl.gas.visibility(fl.Mist(visibility=40.0).extinction()))
    40
    """

    amount: Number = 1.0
    count: int | None = None
    visibility: Number | None = None
    radius: float | None = None
    density: Number = 0.4
    color: Color = "local"
    wind: Vector = (0.0, 0.0, 0.0)
    box: float | Sequence[float] | None = None
    center: Sequence[float] | None = None
    depths: Sequence[float] | None = None
    footprint: Footprint = "viewplane_c"
    near: float = 0.1
    lit: bool = True
    forward: float = 0.5
    scatter: Law = "rayleigh"
    asymmetry: float = 0.6
    structure: float = 0.0
    top: float | None = None
    falloff: float = 1.0
    look: str = "v1"
    seed: int | None = None
    severity: InitVar[int | None] = None
    visibility_m: InitVar[float | None] = None

    NAME: ClassVar[str] = "mist"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = {**MIST, **BANKS}

    def __post_init__(self, *_: Any) -> None:
        if self.count is None and self.visibility is None:
            object.__setattr__(self, "count", 1200)
        object.__setattr__(self, "visibility", _VISIBILITY("visibility", self.visibility))
        object.__setattr__(self, "box", self._sides())
        if self.radius is None:
            object.__setattr__(self, "radius", RADIUS * min(self.box))  # type: ignore[arg-type]
        settle(self, _CHECKS)
        if self.top is not None and self.structure == 0.0:
            raise ValueError("top is of mist with structure: give a structure above 0 as well")
        for t in _times(self.density, self.visibility):
            self.particle_density(t)
        self.particles_in_box()

    @cached_property
    def parts(self) -> Cloud:
        """What it is made of: one cloud of particles."""
        sides, center, depths, radius = self.box, self.center, self.depths, self.radius
        return Cloud(
            wind=self.wind,
            sides=sides,  # type: ignore[arg-type]
            center=center,  # type: ignore[arg-type]
            depths=depths,  # type: ignore[arg-type]
            count=self.particles_in_box(),
            radius=radius,  # type: ignore[arg-type]
            footprint=self.footprint,
            near=self.near,
            scatter=Scatter(self.scatter, self.asymmetry, self.forward),
        )

    @cached_property
    def bank(self) -> Bank:
        """What it is made of where it has structure."""
        return Bank(
            wind=self.wind,
            sides=self.box,  # type: ignore[arg-type]
            center=self.center,  # type: ignore[arg-type]
            depths=self.depths,  # type: ignore[arg-type]
            near=self.near,
            extinction=gas.extinction(
                self.particles_in_box(), self._volume, self.parts.radius, self.particle_density(0.0)
            ),
            structure=self.structure,
            top=self.top,
            falloff=self.falloff,
            scatter=self.parts.scatter,
        )

    @property
    def _volume(self) -> float:
        return float(np.prod(self.box))  # type: ignore[arg-type]

    def _sides(self) -> tuple[float, float, float]:
        if self.box is None:
            far = 5.0 if self.visibility is None else REACH * max(_values(self.visibility))
            return (far, far, far)
        if np.ndim(self.box) == 0:
            side = real("box", self.box, above=0.0)
            return (side, side, side)
        x, y, z = (real("box", side, above=0.0) for side in vector("box", self.box, 3).tolist())
        return (x, y, z)

    @classmethod
    def preset(cls, name: MistLook, **changes: Any) -> Mist:
        """Return a look by name.

        "clouds", "mist" and "fog" are the paper's, made of particles; "valley", "ground", "bank"
        and "cumulus" have structure.

        Further arguments replace single values of it; a `visibility` replaces its count.
        """
        values: dict[str, Any] = dict(cls.PRESETS[choice("preset", name, tuple(cls.PRESETS))])
        if changes.get("visibility_m") is not None:
            if "visibility" in changes:
                raise TypeError("visibility_m and visibility say the same: give one of them")
            changes["visibility"] = real("visibility_m", changes.pop("visibility_m"), above=0.0)
        if changes.get("severity") is not None:
            # The rest of the look stays.
            values.pop("density", None)
        unknown = set(changes) - {f.name for f in fields(cls)} - {"severity"}
        if unknown:
            near = suggestion(min(unknown), [f.name for f in fields(cls)])
            raise TypeError(f"Mist has no field {min(unknown)!r}{near}")
        if changes.get("visibility") is not None:
            # The look keeps its grain: particles grow with the box.
            values.pop("count", None)
            if "radius" in values and "box" not in changes and "radius" not in changes:
                values["radius"] = (
                    values["radius"] / 5.0 * REACH * max(_values(changes["visibility"]))
                )
        return cls(**{**values, **changes})

    def particles_in_box(self) -> int:
        """Return how many particles the box of the given sides holds."""
        if self.count is not None:
            return self.count
        # Of keyed values the pair that needs the most.
        assert self.visibility is not None and self.radius is not None
        least, most = min(_values(self.visibility)), max(_values(self.density))
        if most == 0.0:
            return 0
        count = count_for_visibility(least, self._volume, self.radius, most)
        if count > MOST:
            raise ValueError(
                f"visibility: {least:g} m wants {count} particles of radius {self.radius:g} in the "
                f"box, at most {MOST} are drawn; a larger radius wants fewer"
            )
        return count

    def particle_density(self, t: float) -> float:
        """Return the opacity of a particle's middle at `t`, without `amount`."""
        density = float(value_at(self.density, t))
        if self.visibility is None:
            return density
        far = float(value_at(self.visibility, t))
        if self.count is None:
            return density * min(_values(self.visibility)) / far
        assert self.radius is not None
        try:
            return gas.density_for_visibility(far, max(self.count, 1), self._volume, self.radius)
        except ValueError as error:
            text = str(error).replace("distance", "visibility", 1)
            raise ValueError(text) from None

    def extinction(self, t: float = 0.0) -> float:
        """Return beta at `t`, per metre; see :func:`flurries.gas.extinction`."""
        assert self.radius is not None
        density = float(value_at(self.amount, t)) * self.particle_density(t)
        return gas.extinction(self.particles_in_box(), self._volume, self.radius, density)

    def needs(self, frame: Frame) -> Needs:
        """Return what a frame takes: one step, "gas", or "lit gas" with its colors and a sort."""
        cloud, density = self.parts, self.particle_density(frame.t)
        most = value_at(self.amount, frame.t) * density
        if most == 0.0 or cloud.count == 0:
            return Needs((), (LeftOut(self.NAME, "it has no density"),), most=0.0)
        lit = self._is_lit(frame) or bool(frame.lights)
        bright = LAMPS if frame.lights else 1.0
        bright = max(bright, cloud.scatter.brightest if self._is_lit(frame) else 1.0)
        # The background's light may change from frame to frame; without a sun or lamps it is no
        # more than the color of what is kept.
        moves = has_keys(self) or np.any(value_at(self.wind, 0.0))
        still = not (moves or frame.lights or (lit and isinstance(self.color, str)))

        if self.structure > 0.0:
            return Needs(
                (
                    Step(
                        "lit gas" if lit else "gas",
                        partial(self.bank.cost, frame, lit=lit),
                        once=still,
                    ),
                ),
                (LeftOut(f"{self.NAME}: particles", "it has structure, and is drawn in slices"),),
                reads_of(self.color),
                most=1.0,
                brightest=bright,
            )

        def cost(error: float | None = None) -> Cost:
            thickness = self.extinction(frame.t) * cloud.through
            return cloud.cost(frame, thickness, lit=lit, error=error)

        stop = Saving(
            "error",
            "particles behind what is opaque but for the error",
            # Colors of lit gas are encoded straight: they err as much as opacity does at black.
            1.0 + STEEPEST if lit else 1.0,
            lambda error: nanoseconds(cost().work) - nanoseconds(cost(error).work),
            setting=True,
        )
        return Needs(
            (Step("lit gas" if lit else "gas", cost, once=still),),
            () if lit else (LeftOut(f"{self.NAME}: sort", "its particles have one color"),),
            reads_of(self.color),
            most=min(most * cloud.filled(frame)[1], 1.0),
            by_rows=True,
            savings=(stop,),
            brightest=bright,
        )

    def _base(self, frame: Frame) -> Base:
        if self.color == LOCAL and frame.plate is not None:
            return Base.airlight(frame.plate)
        return Base.even(color_at(self.color, frame))

    def render(self, frame: Frame) -> Layer:
        """Return the layer of a frame."""
        run, lit = frame.run or frame.steps_of(self), self._is_lit(frame)
        local = self.color == LOCAL and frame.plate is not None
        base = self._base(frame)
        red, green, blue = linear_to_srgb(base.dim).tolist()
        color = (red, green, blue) if local else color_at(self.color, frame)
        density = value_at(self.amount, frame.t) * self.particle_density(frame.t)
        step = "lit gas" if lit or frame.lights else "gas"
        shade, thick = even_shade(frame, color), self.extinction(frame.t)
        top, bottom, left, right = frame.window
        alpha, light = np.zeros((bottom - top, right - left), np.float32), None
        if self.structure > 0.0:
            made = run(step, lambda: self.bank.draw(frame, thick, base, lit=lit))
            if made is not None:
                alpha, light, sky = made
                # What is kept of a picture has the light of the next.
                shade = sky.shade(frame, base.dim) if local else shade
        else:
            drawn = run(step, lambda: self.parts.draw(frame, density, base, lit=lit))
            alpha, light = drawn or (alpha, light)
        if lit and light is not None and self.structure > 0.0:
            # All of its light is a glow, which is mixed as light.
            layer = Layer(self.NAME, alpha, color, shade=even_shade(frame, BLACK), glow=light)
        elif lit and light is not None:
            layer = Layer(self.NAME, alpha, rgb=light)
        elif light is not None or local:
            layer = Layer(self.NAME, alpha, color, shade=shade, glow=light)
        else:
            layer = Layer(self.NAME, alpha, color)
        if not frame.whole:
            return layer
        with stage("passes"):
            motion, backward, depth = self.parts.passes(frame, density)
        return replace(layer, motion=motion, backward=backward, depth=depth)

    def _is_lit(self, frame: Frame) -> bool:
        return self.lit and frame.sun is not None


def _depths(depths: Any) -> tuple[float, float]:
    if not isinstance(depths, (tuple, list, np.ndarray)) or len(depths) != 2:
        raise TypeError(f"depths must be (near, far), got {depths!r}")
    near = real("depths[0]", depths[0], low=0.0)
    far = float(depths[1]) if isinstance(depths[1], (int, float, np.number)) else None
    if far is None or not far > near:
        raise ValueError(f"depths must be near < far, far may be infinite, got {depths!r}")
    # The near plane itself is the camera's affair.
    return (near if near > 0.0 else -np.inf), far


def _values(number: Any) -> list[float]:
    return [float(v) for _, v in number.keys] if isinstance(number, Keys) else [float(number)]


def _times(*numbers: Any) -> list[float]:
    """Return the frames at which keyed numbers have keys, or 0."""
    keyed = [t for number in numbers if isinstance(number, Keys) for t, _ in number.keys]
    return keyed or [0.0]
