"""Mist, fog and clouds, by their visibility; or a box of splatted particles (Johnson 2005)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field
from functools import cached_property, partial
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np

from flurries import gas
from flurries._contract import choice, flag, integer, real, vector
from flurries.effects import checks
from flurries.effects.bank import Bank
from flurries.effects.color import AMBIENT, LOCAL, PlacedColor, as_color
from flurries.effects.presets import MIST, PAPER_MIST, MistLook
from flurries.effects.strength import BACKDROP, Strength, knob_of, reach
from flurries.effects.vapor import MOST, Law, Vapor
from flurries.gas.splatting import Footprint
from flurries.motion.keys import Number, Vector, as_number, as_vector, largest

Method: TypeAlias = Literal["slices", "particles"]

RADIUS = 0.09  # The paper's fog: a radius of .45 in a box of 5.
VISIBILITY = 200.0  # The visibility of mist of which nothing is said, metres.

# What only particles have: the paper's fog, in a box of 5, where nothing is said.
PARTICLES = {"count": 1200, "radius": None, "density": 0.4}


def _depths(_: str, depths: Any) -> tuple[float, float]:
    if not isinstance(depths, (tuple, list, np.ndarray)) or len(depths) != 2:
        raise TypeError(f"depths must be (near, far), got {depths!r}")
    near = real("depths[0]", depths[0], low=0.0)
    far = float(depths[1]) if isinstance(depths[1], (int, float, np.number)) else None
    if far is None or not far > near:
        raise ValueError(f"depths must be near < far, far may be infinite, got {depths!r}")
    # The near plane itself is the camera's affair.
    return (near if near > 0.0 else -np.inf), far


@checks.effect(
    "severity",
    law=lambda _, turned, given: {"visibility": knob_of("visibility", {**given, **turned})},
)
@dataclass(frozen=True, kw_only=True)
class Mist(metaclass=checks.Described):
    """Mist, fog and clouds.

    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres when
    the camera's places are.

    Parameters
    ----------
    preset : str, optional
        A look with structure: "mist", "fog", "clouds", "valley", "ground", "bank", "cumulus". Given
        fields replace its own. Of particles "clouds", "mist" and "fog" are the paper's (Johnson
        2005, section 4).
    amount : float
        Strength of the effect, 0 to 1; scales the density. Keyed.
    visibility : float, optional
        Metres at which a black object keeps 5 % of its contrast, in the mean over a picture; 200 if
        not given. Keyed.
    structure : float
        Detail at every scale, from the visibility, or the size of the bank, down to a pixel: the
        root mean square of the logarithm of the density in a slice of the gas, 0 (even) to 2.
    backdrop : float
        Without a depth the background is a wall this far away, metres; a `center` lies before it.
    color : float, (r, g, b), "#rrggbb", "ambient" or "local"
        Display values, 0 to 1. Keyed. "ambient" is white in the background's own light. "local" is
        one color for the picture, that of its sky: fog is never darker than the sky, and at night
        it is dark. The paper's presets have colors of their own.
    wind : (x, y, z)
        Air velocity, metres per second, x right, y down, z away from the camera. Keyed.
    box : float or (x, y, z), optional
        Sides of the box of a bank with a `center`, and of particles, metres; 5 for particles. Mist
        around the camera reaches as far as the last side: if not given, twice the visibility, and
        at least 60 m. What is farther is seen through all of it.
    center : (x, y, z), optional
        Middle of the box in the world, house axes, metres. If not given, the gas is all around the
        camera.
    top, falloff : float
        Height above which the mist thins, metres above the camera at frame 0, if any; and over how
        many metres the density falls there from .73 to .27.
    depths : (near, far), optional
        Only the gas between these depths, metres: one effect can stand behind flakes, and another
        of the same seed in front of them.
    lit : bool
        Whether the scene's sun lights the gas, not of particles; lamps always do.
    forward : float
        Share of the sun's light that the gas passes on to what is behind it, 0 to 1.
    scatter, asymmetry : {"rayleigh", "henyey", "even"}, float
        The phase function, see :func:`flurries.gas.phase`.
    method : {"slices", "particles"}, optional
        Slices of depth, or the paper's particles; if not given, particles where they have a count,
        radius or density.
    count, radius, density : int, float, float, optional
        Particles in the box, their three sigma in metres and the opacity of their middles, 0 to 1,
        keyed; 1200, 0.09 of the box and 0.4 if not given.
    footprint, near : str, float
        Of particles, see :func:`flurries.gas.splat`; those nearer than four radii are line
        integrals.
    look, seed
        As in :class:`TentSnow`.
    severity : int, optional
        1 to 5 are visibilities of 1000, 500, 200, 100 and 50 m. Scene files hold those.

    Examples
    --------
    >>> import flurries as fl
    >>> fog = fl.Mist("fog", wind=(0.4, 0.0, 0.0))
    >>> fog.visibility, round(fog.extinction(), 3)
    (100.0, 0.03)
    """

    preset: InitVar[MistLook | None] = field(default=None, kw_only=False)
    amount: Number = 1.0
    visibility: Number | None = None
    structure: float = 0.0
    backdrop: float = BACKDROP
    color: PlacedColor = "local"
    wind: Vector = (0.0, 0.0, 0.0)
    box: float | Sequence[float] | None = None
    center: Sequence[float] | None = None
    top: float | None = None
    falloff: float = 1.0
    depths: Sequence[float] | None = None
    lit: bool = True
    forward: float = 0.5
    scatter: Law = "rayleigh"
    asymmetry: float = 0.6
    method: Method | None = None
    count: int | None = None
    radius: float | None = None
    density: Number | None = None
    footprint: Footprint = "viewplane_c"
    near: float = 0.1
    look: str = "v1"
    seed: int | None = None
    severity: InitVar[int | None] = None

    CHECKS: ClassVar[dict[str, checks.Check]] = {
        "method": checks.one_of(Method), "density": checks.share,
        "color": lambda _, value: as_color(value, (AMBIENT, LOCAL)),
        "wind": partial(as_vector, length=3), "count": partial(integer, low=0, high=MOST),
        "backdrop": checks.length, "depths": _depths, "footprint": checks.one_of(Footprint),
        "center": lambda name, value: tuple(vector(name, value, 3).tolist()), "lit": flag,
        "forward": checks.part, "scatter": checks.one_of(Law), "top": real,
        "asymmetry": partial(real, low=-0.99, high=0.99), "falloff": checks.length,
        "structure": partial(real, low=0.0, high=2.0),
    }  # fmt: skip
    NAME: ClassVar[str] = "mist"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = MIST

    def __post_init__(self, *_: Any) -> None:
        keep = partial(object.__setattr__, self)
        own = [name for name in PARTICLES if getattr(self, name) is not None]
        usual: Any = "particles" if own else "slices"
        method = usual if self.method is None else self.method
        for name in own if method == "slices" else ("visibility", "top", "structure", "depths"):
            if getattr(self, name) not in (None, 0.0):
                does = "is not of particles" if method == "particles" else "is of particles alone"
                raise ValueError(f"{name} {does}; those have {', '.join(PARTICLES)}")
        keep("method", method)
        if method == "particles":
            keep("box", self._sides(5.0))
            fog = {**PARTICLES, "radius": RADIUS * min(self.box)}  # type: ignore[arg-type]
            for name in set(PARTICLES) - set(own):
                keep(name, fog[name])
        else:
            visible = VISIBILITY if self.visibility is None else self.visibility
            keep("visibility", as_number("visibility", visible, above=0.0))
            keep("box", self._sides(reach(self.farthest)))
        checks.settle(self)

    @cached_property
    def parts(self) -> Vapor | Bank:
        return Vapor(self) if self.method == "particles" else Bank(self)

    @property
    def farthest(self) -> float:
        """The largest visibility at any time, metres."""
        return largest(self.visibility)

    def _sides(self, usual: float) -> tuple[float, float, float]:
        box: Any = usual if self.box is None else self.box
        sides = [box] * 3 if np.ndim(box) == 0 else vector("box", box, 3).tolist()
        x, y, z = (real("box", side, above=0.0) for side in sides)
        return (x, y, z)

    @classmethod
    def of_preset(cls, name: str, changes: dict[str, Any]) -> dict[str, Any]:
        values = cls.PRESETS[choice("preset", name, tuple(cls.PRESETS))]
        if changes.get("method") == "particles" or set(PARTICLES) & set(changes):
            values = PAPER_MIST.get(name, values)
        elif changes.get("severity"):
            values = {key: value for key, value in values.items() if key != "visibility"}
        return {**values, **changes}

    def extinction(self, t: float = 0.0) -> float:
        """Return beta at `t`, per metre; see :func:`flurries.gas.extinction`."""
        return self.parts.extinction(t)

    def strength(self, t: float = 0.0) -> Strength:
        """Return visibility and cover at a frame, as :meth:`flurries.Snow.strength` does."""
        extinction = self.extinction(t)
        seen = gas.visibility(extinction) if extinction > 0.0 else np.inf
        if self.center is not None or self.top is not None or self.structure > 0.0:
            return Strength(seen)
        *_, way = self._sides(0.0)
        return Strength(seen, 1.0 - float(np.exp(-extinction * min(way, self.backdrop))))
