"""Mist, fog and clouds: a box of splatted particles that the wind moves (Johnson 2005)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from flurries._contract import choice, flag, integer, real, seed_of, vector
from flurries.effects.checks import Check, length, one_of, optional, part, settle, share
from flurries.effects.color import AMBIENT, LOCAL, Color, as_color
from flurries.effects.described import Described
from flurries.effects.knobs import knobs, looks
from flurries.effects.looks import LOOKS
from flurries.effects.presets import BANKS, MIST, MistLook
from flurries.effects.severity import visibility_of_severity
from flurries.effects.sunlight import SCATTER, Law
from flurries.effects.vapor import MOST, Vapor, values_of
from flurries.gas.splatting import FOOTPRINTS, Footprint
from flurries.motion.keys import Number, Vector, as_number, as_vector

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
    if given.get("visibility") is not None:
        raise TypeError("severity and visibility say the same: give one of them")
    return {"visibility": visibility_of_severity(value)}


@looks
@knobs(severity=_of_severity)
@dataclass(frozen=True, kw_only=True)
class Mist(metaclass=Described):
    """Mist, fog and clouds.

    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres when
    the camera's places are.

    Parameters
    ----------
    preset : str, optional
        A look: "clouds", "mist" and "fog" are the paper's, of particles (Johnson 2005, section 4);
        "valley", "ground", "bank" and "cumulus" have structure. Given fields replace its own.
    amount : float
        Strength of the effect, 0 to 1; scales the density. Keyed.
    count : int, optional
        Particles in the box. If neither this nor `visibility` is given, the fog's 1200.
    visibility : float, optional
        Distance in metres at which a black object keeps 5 % of its contrast, in place of a count.
        Keyed: the density follows. With `count` the density follows from both.
    radius : float, optional
        Three sigma of a particle, metres; 0.09 of the box if not given.
    density : float
        Opacity in the middle of a particle, 0 to 1. Keyed.
    color : float, (r, g, b), "#rrggbb", "ambient" or "local"
        Display values, 0 to 1. Keyed. "ambient" is white in the background's own light. "local" is
        one color for the picture, that of its sky: fog is never darker than the sky, and at night
        it is dark. The paper's presets have colors of their own.
    wind : (x, y, z)
        Air velocity, metres per second, x right, y down, z away from the camera. Keyed.
    box : float or (x, y, z), optional
        Sides of the box that the gas fills, metres. If not given, 5, or 1.2 times the visibility.
    center : (x, y, z), optional
        Middle of the box in the world, house axes, metres. If not given, the box goes with the
        camera, which stands inside, and is as wide as the view at its far end.
    depths : (near, far), optional
        Only the gas between these depths, metres: one effect can stand behind flakes, and another
        of the same seed in front of them.
    footprint : str
        See :func:`flurries.gas.splat`; particles nearer than four radii are line integrals.
    near : float
        Depth before which nothing is drawn, metres.
    lit : bool
        Whether the scene's sun lights the gas, and the gas shades itself. Lamps always light it.
    forward : float
        Share of the sun's light that a particle passes on to those behind it, 0 to 1.
    scatter, asymmetry : {"rayleigh", "henyey", "even"}, float
        The phase function, see :func:`flurries.gas.phase`.
    structure : float
        Detail at every scale, from the size of the bank down to 4 px: the root mean square of the
        logarithm of the density in a slice of the gas, 0 to 2. The gas is then no particles but a
        bank with soft ends and the same mean extinction. 0 is the paper's gas.
    top : float, optional
        Height above which the mist thins, metres above the camera at frame 0, with `structure`.
    falloff : float
        Height in metres over which the density falls from .73 to .27 at the top.
    look : {"v1"}
        Version of the presets, as in :class:`TentSnow`.
    seed : int, optional
        Seed of this effect; the scene's seed if not given.
    severity : int, optional
        1 to 5 are visibilities of 1000, 500, 200, 100 and 50 m.

    Raises
    ------
    ValueError, TypeError
        For an argument outside its range; the message names it.

    Examples
    --------
    >>> import flurries as fl
    >>> fog = fl.Mist("fog", wind=(0.4, 0.0, 0.0))
    >>> fog.count, round(fog.extinction(), 3)
    (1200, 0.515)
    """

    preset: InitVar[MistLook | None] = field(default=None, kw_only=False)
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
        self.parts.require()

    @cached_property
    def parts(self) -> Vapor:
        """The parts of the effect."""
        return Vapor(self)

    def _sides(self) -> tuple[float, float, float]:
        if self.box is None:
            far = 5.0 if self.visibility is None else REACH * max(values_of(self.visibility))
            return (far, far, far)
        if np.ndim(self.box) == 0:
            side = real("box", self.box, above=0.0)
            return (side, side, side)
        x, y, z = (real("box", side, above=0.0) for side in vector("box", self.box, 3).tolist())
        return (x, y, z)

    @classmethod
    def of_preset(cls, name: str, changes: dict[str, Any]) -> dict[str, Any]:
        """Return the fields of a preset with changes."""
        values: dict[str, Any] = dict(cls.PRESETS[choice("preset", name, tuple(cls.PRESETS))])
        far = changes.get("visibility")
        if changes.get("severity") is not None:
            far = visibility_of_severity(changes["severity"])
        if far is not None:
            # The look keeps its grain: particles grow with the box.
            values.pop("count", None)
            values.pop("visibility", None)
            if "radius" in values and "box" not in changes:
                box = REACH * max(values_of(_VISIBILITY("visibility", far)))
                values["radius"] = values["radius"] / 5.0 * box
        return {**values, **changes}

    def particles_in_box(self) -> int:
        """Return the number of particles in the box of the given sides."""
        return self.parts.count

    def extinction(self, t: float = 0.0) -> float:
        """Return beta at `t`, per metre; see :func:`flurries.gas.extinction`."""
        return self.parts.extinction(self.parts.density(t))


def _depths(depths: Any) -> tuple[float, float]:
    if not isinstance(depths, (tuple, list, np.ndarray)) or len(depths) != 2:
        raise TypeError(f"depths must be (near, far), got {depths!r}")
    near = real("depths[0]", depths[0], low=0.0)
    far = float(depths[1]) if isinstance(depths[1], (int, float, np.number)) else None
    if far is None or not far > near:
        raise ValueError(f"depths must be near < far, far may be infinite, got {depths!r}")
    # The near plane itself is the camera's affair.
    return (near if near > 0.0 else -np.inf), far
