"""Mist, fog and clouds: a box of splatted particles that the wind moves (Johnson 2005)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, fields
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from flurries import _core, gas, particles
from flurries._contract import Array, Float64, choice, flag, integer, real, seed_of, vector
from flurries.effects.color import AMBIENT, as_color, color_at
from flurries.effects.knobs import knobs
from flurries.effects.looks import LOOKS, mist_density, severity_of
from flurries.effects.presets import MIST
from flurries.frame.costs import nanoseconds
from flurries.frame.layer import Layer
from flurries.frame.needs import PARTS, Cost, LeftOut, Needs, Saving, Step, has_keys
from flurries.frame.view import Frame
from flurries.gas.splatting import FINISHED, FOOTPRINTS, sorted_gas
from flurries.gas.visibility import count_for_visibility
from flurries.motion.keys import Keys, Number, Vector, as_number, as_vector, value_at

SCATTER = ("even", "rayleigh", "henyey")

# The steepest place of the sRGB encoding, at black: display values per linear light.
STEEPEST = 12.92

# The paper's fog: a radius of .45 in a box of 5.
RADIUS = 0.09

# A box whose fog hides what lies behind it, where a visibility is given and no box.
REACH = 1.2

# The outer share of the box, on each side, in which particles fade.
RIM = 0.075

MOST = 2_000_000


def _of_severity(value: object, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the density so that the gas takes a severity's share of what lies behind the box."""
    severity = severity_of(value)
    if given.get("visibility") is not None:
        raise TypeError("severity and visibility say the same: give one of them")
    if "density" in given:
        raise TypeError("severity and density say the same: give one of them")
    box = Mist(**{name: part for name, part in given.items() if name != "density"})
    return {"density": mist_density(severity, box.thickness(1.0))}


def _of_visibility(value: object, given: Mapping[str, Any]) -> dict[str, Any]:
    if "visibility" in given:
        raise TypeError("visibility_m and visibility say the same: give one of them")
    return {"visibility": real("visibility_m", value, above=0.0)}


@knobs(severity=_of_severity, visibility_m=_of_visibility)
@dataclass(frozen=True, kw_only=True)
class Mist:
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
    color : float, (r, g, b) or "ambient"
        Display values, 0 to 1. Keyed. "ambient" is the background's own light.
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
        Whether the scene's sun shades the gas and the gas itself.
    forward : float
        Share of the sun's light that a particle passes on to those behind it, 0 to 1.
    scatter : {"rayleigh", "henyey", "even"}
        Where light is scattered to, see :func:`flurries.gas.phase`.
    asymmetry : float
        Of "henyey", -0.99 to 0.99.
    look : {"v1"}
        Version of the looks, as in :class:`Snow`.
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
    paper does not say how large its box was.

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
    color: Any = 0.7
    wind: Vector = (0.0, 0.0, 0.0)
    box: float | Sequence[float] | None = None
    center: Sequence[float] | None = None
    depths: Sequence[float] | None = None
    footprint: str = "viewplane_c"
    near: float = 0.1
    lit: bool = True
    forward: float = 0.5
    scatter: str = "rayleigh"
    asymmetry: float = 0.6
    look: str = "v1"
    seed: int | None = None
    severity: InitVar[int | None] = None
    visibility_m: InitVar[float | None] = None

    NAME: ClassVar[str] = "mist"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = MIST

    def __post_init__(self, *_: Any) -> None:
        def settle(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        choice("look", self.look, LOOKS)
        settle("amount", as_number("amount", self.amount, low=0.0, high=1.0))
        settle("density", as_number("density", self.density, low=0.0, high=1.0))
        settle("color", as_color(self.color))
        settle("wind", as_vector("wind", self.wind, 3))
        if self.count is None and self.visibility is None:
            settle("count", 1200)
        if self.count is not None:
            settle("count", integer("count", self.count, low=0, high=MOST))
        if self.visibility is not None:
            settle("visibility", as_number("visibility", self.visibility, above=0.0))
        settle("box", self._sides())
        if self.radius is None:
            settle("radius", RADIUS * min(self.box))  # type: ignore[arg-type]
        settle("radius", real("radius", self.radius, above=0.0))
        if self.center is not None:
            settle("center", tuple(vector("center", self.center, 3).tolist()))
        if self.depths is not None:
            settle("depths", _depths(self.depths))
        choice("footprint", self.footprint, FOOTPRINTS)
        settle("near", real("near", self.near, above=0.0))
        flag("lit", self.lit)
        settle("forward", real("forward", self.forward, low=0.0, high=1.0))
        choice("scatter", self.scatter, SCATTER)
        settle("asymmetry", real("asymmetry", self.asymmetry, low=-0.99, high=0.99))
        if self.seed is not None:
            settle("seed", seed_of(self.seed))
        for t in _times(self.density, self.visibility):
            self.particle_density(t)
        self.particles_in_box()

    def thickness(self, density: float) -> float:
        """Return the optical depth of the box for particles of a density."""
        assert self.radius is not None
        beta = gas.extinction(self.particles_in_box(), self._volume, self.radius, density)
        return beta * self._through()

    @property
    def _volume(self) -> float:
        return float(np.prod(self.box))  # type: ignore[arg-type]

    def _through(self) -> float:
        """Return how far one looks through the box, its fading rims half, metres."""
        assert self.box is not None and self.radius is not None
        depth: float = tuple(self.box)[2]  # type: ignore[arg-type]
        if self.center is not None:
            return depth * (1.0 - RIM)
        return max(depth * (1.0 - 1.5 * RIM) - self.radius, 0.0)

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
    def preset(cls, name: str, **changes: Any) -> Mist:
        """Return a look by name: "clouds", "mist" or "fog", the paper's.

        Further arguments replace single values of it; a `visibility` replaces its count.
        """
        values: dict[str, Any] = dict(MIST[choice("preset", name, tuple(MIST))])
        if changes.get("visibility_m") is not None:
            if "visibility" in changes:
                raise TypeError("visibility_m and visibility say the same: give one of them")
            changes["visibility"] = real("visibility_m", changes.pop("visibility_m"), above=0.0)
        if changes.get("severity") is not None:
            # The rest of the look stays.
            values.pop("density")
        unknown = set(changes) - {f.name for f in fields(cls)} - {"severity"}
        if unknown:
            raise TypeError(f"Mist has no field {sorted(unknown)[0]!r}")
        if changes.get("visibility") is not None:
            # The look keeps its grain: particles grow with the box.
            values.pop("count")
            if "box" not in changes and "radius" not in changes:
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
        name, density = self.NAME, self.particle_density(frame.t)
        most = value_at(self.amount, frame.t) * density
        if most == 0.0 or self.particles_in_box() == 0:
            return Needs((), (LeftOut(name, "it has no density"),), most=0.0)
        ambient = self.color == AMBIENT
        # The background's light may change from frame to frame.
        still = not (ambient or has_keys(self) or np.any(value_at(self.wind, 0.0)))
        lit = self.lit and frame.sun is not None
        step = Step("lit gas" if lit else "gas", lambda: self._cost(frame, lit), once=still)
        out = () if lit else (LeftOut(f"{name}: sort", "its particles have one color"),)

        def saved(error: float) -> float:
            return nanoseconds(self._cost(frame, lit).work) - nanoseconds(
                self._cost(frame, lit, error).work
            )

        stop = Saving(
            "error",
            "particles behind what is opaque but for the error",
            # Colors of lit gas are encoded straight: they err as much as opacity does at black.
            1.0 + STEEPEST if lit else 1.0,
            saved,
            setting=True,
        )
        most = min(most * self._filled(frame)[1], 1.0)
        reads = PARTS if ambient else PARTS - {"ambient"}
        bright = self._brightest() if lit else 1.0
        return Needs(
            (step,), out, reads, most=most, by_rows=True, savings=(stop,), brightest=bright
        )

    def _brightest(self) -> float:
        """Return the most that the phase function brightens white gas by."""
        if self.scatter == "henyey":
            g = abs(self.asymmetry)
            return (1.0 + g) / (1.0 - g) ** 2
        return 1.5 if self.scatter == "rayleigh" else 1.0

    def _cost(self, frame: Frame, lit: bool, error: float | None = None) -> Cost:
        """Return what a frame's particles and the pixels that they cover take."""
        assert self.radius is not None
        sides, count = self._filled(frame)
        if error is None:
            error = FINISHED["float32"] if frame.run is None else self._error(frame)
        # Front to back, up to where no more than the error is let through.
        thickness = self.extinction(frame.t) * self._through()
        share = min(-math.log(max(error, 1e-12)) / thickness, 1.0) if thickness > 0.0 else 1.0
        # Depths of equal numbers of particles, of a box that the camera looks into.
        depth = sides[2] * (np.arange(64) + 0.5) / 64.0
        focal, (height, width) = frame.camera.focal, frame.shape
        wide, high = width * depth / focal, height * depth / focal
        seen = np.minimum(sides[0] / wide, 1.0) * np.minimum(sides[1] / high, 1.0)
        inside = np.minimum(wide / sides[0], 1.0) * np.minimum(high / sides[1], 1.0)
        area = np.minimum((2.0 * focal * self.radius / depth) ** 2, height * width * seen)
        pixels = height * width
        work = {
            "gas placed": float(count),
            "lit gas pixel" if lit else "gas pixel": share * count * float((inside * area).mean()),
            "mask pixel": float(pixels),
        }
        size = f"{count} particles"
        if lit:
            # Its colors go through the curve to display values; arrays of float32 come and go.
            return Cost(work, size, 20 * pixels, 66 * pixels)
        return Cost(work, size, 4 * pixels, 80 * count)

    def render(self, frame: Frame) -> Layer:
        """Return this effect's layer of a frame."""
        run = frame.run or frame.steps_of(self)
        for name in ("gas", "lit gas"):
            layer = run(name, lambda: self._layer(frame))
            if layer is not None:
                return layer
        top, bottom, left, right = frame.window
        return Layer(self.NAME, np.zeros((bottom - top, right - left), np.float32))

    def _layer(self, frame: Frame) -> Layer:
        assert self.radius is not None
        lit = self.lit and frame.sun is not None
        sort = lambda: self._sorted(frame, lit=lit)  # noqa: E731
        found, colored = frame.once_each(self, "gas", sort)
        top, bottom, left, right = frame.window
        shape = (bottom - top, right - left)
        if not colored:
            alpha = np.empty(shape, np.float32)
            _core.gas_draw(alpha, found, frame.window, frame.depth)
            return Layer(self.NAME, alpha, color_at(self.color, frame))
        layer = np.empty((*shape, 4), np.float32)
        _core.gas_draw(layer, found, frame.window, frame.depth)
        return Layer(self.NAME, layer[..., 3], rgb=layer[..., :3])

    def _sorted(self, frame: Frame, *, lit: bool) -> tuple[_core.SortedGas, bool]:
        """Return the gas, to be drawn in any band of the frame, and whether it has colors."""
        assert self.radius is not None
        points, shown = frame.once(self, "particles", lambda: self.particles(frame))
        lit = lit and len(points) > 0
        colors = self._shaded(frame, points, shown) if lit else 0.0
        given = sorted_gas(
            frame.shape, points, self.radius, shown, colors, frame.camera,
            footprint=self.footprint, near=self.near, near_mode="exact", depth=frame.depth,
            error=self._error(frame),
        )  # fmt: skip
        return given, lit

    def _error(self, frame: Frame) -> float:
        """Return what is let through where nothing more is drawn."""
        allowed = {} if frame.run is None else frame.run.settings
        return max(allowed.get("error", 0.0), FINISHED["float32"])

    def particles(self, frame: Frame) -> tuple[Float64, Float64]:
        """Return middles in camera axes (n, 3) and the density that each shows (n,)."""
        sides, count = self._filled(frame)
        middle = self._middle(frame, sides)
        points = particles.positions(
            count,
            sides,
            seed=frame.seed,
            velocity=-frame.displacement(wind=self.wind),
            time=1.0,
            center=middle,
        )
        shown = particles.edge_fade(points, sides, center=middle)
        shown *= value_at(self.amount, frame.t) * self.particle_density(frame.t)
        local = frame.to_camera(points)
        if self.depths is not None:
            shown = shown * self._between(local[:, 2] - frame.camera.offset[2])
        seen = shown > 0.0
        return np.ascontiguousarray(local[seen]), shown[seen]

    def _filled(self, frame: Frame) -> tuple[Float64, int]:
        """Return the sides of the box and how many particles fill it."""
        sides = np.array(self.box, np.float64)
        count = self.particles_in_box()
        if self.center is not None:
            return sides, count
        # The path's lens, so that both eyes see the same gas.
        cx, cy = frame.path.widest.principal(frame.shape)
        height, width = frame.shape
        slopes = np.array([max(cx, width - cx), max(cy, height - cy)]) / frame.path.widest.focal
        # The outer part fades; the view's far corners stay inside of that. Up to 1 : 1 either way.
        wide = 2.0 * np.minimum(slopes, 1.0) * sides[2] * (1.0 - RIM) / (1.0 - 2.0 * RIM)
        grown = sides.copy()
        if not frame.path.turns and not np.any(frame.camera.rotation):
            grown[:2] = np.maximum(sides[:2], wide)
        return grown, min(round(count * float(np.prod(grown / sides))), 4 * MOST)

    def _middle(self, frame: Frame, sides: Float64) -> Float64:
        """Return the middle of the box, house axes, from the camera's place."""
        if self.center is not None:
            return np.array(self.center) - frame.path.place(frame.t, fps=frame.fps)
        assert self.radius is not None
        # The wall behind the camera fades where no particle reaches the eye any more.
        ahead = max(0.5 * sides[2] - RIM * sides[2] - self.radius, 0.0)
        return np.asarray(ahead * frame.camera.matrix()[:, 2])

    def _between(self, depth: Float64) -> Float64:
        """Return the share of particles that lies between the two depths."""
        assert self.depths is not None and self.radius is not None
        low, high = (_normal((limit - depth) * 3.0 / self.radius) for limit in self.depths)
        return np.asarray(high - low)

    def _lit(self, frame: Frame, points: Float64, shown: Float64) -> Float64:
        """Return the sun's light that reaches each particle, (n,)."""
        assert frame.sun is not None and self.radius is not None
        # In house axes, so that a camera that only turns or moves has the same gas and light.
        world = points @ frame.camera.matrix().T + frame.path.place(frame.t, fps=frame.fps)
        shown = np.round(shown, 12)
        return light_of(np.round(world, 9), self.radius, shown, frame.sun, self.forward)

    def _shaded(self, frame: Frame, points: Float64, shown: Float64) -> Array:
        """Return the linear color of each particle, (n, 3)."""
        from flurries.io import srgb_to_linear

        assert frame.sun is not None and self.radius is not None
        sun = frame.sun
        lit = frame.once(self, "light", lambda: self._lit(frame, points, shown))
        scattered = lit
        if self.scatter != "even":
            eye = np.array(frame.camera.offset) - points
            away = np.linalg.norm(eye, axis=1)
            way = frame.to_camera(sun.unit())
            cosine = np.divide(eye @ way, away, out=np.zeros_like(away), where=away > 0.0)
            scattered = lit * gas.phase(
                np.clip(cosine, -1.0, 1.0), kind=self.scatter, asymmetry=self.asymmetry
            )
        own, color = (
            srgb_to_linear(np.asarray(given, np.float64))
            for given in (color_at(self.color, frame), sun.color)
        )
        brightness = sun.ambient + (1.0 - sun.ambient) * scattered[:, None] * color
        return np.ascontiguousarray(own * brightness)


def light_of(
    centers: Float64, radius: float, density: Float64, sun: Any, forward: float
) -> Float64:
    """Return the sun's light that reaches each particle; the last gases and lights are kept."""
    x, y, z = sun.unit().tolist()
    return _light(centers.tobytes(), density.tobytes(), radius, (x, y, z), forward)


@lru_cache(maxsize=8)
def _light(
    centers: bytes, density: bytes, radius: float, way: tuple[float, float, float], forward: float
) -> Float64:
    places = np.frombuffer(centers).reshape(-1, 3)
    lit = gas.light(places, radius, np.frombuffer(density), way, forward=forward)
    lit.flags.writeable = False
    return lit


def _normal(u: Float64) -> Float64:
    """Return the normal law up to u."""
    from math import erfc

    return np.array([0.5 * erfc(-v * 0.7071067811865476) for v in u.tolist()])


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
