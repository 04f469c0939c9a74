"""What snow and rain have in common: a texture, particles and a veil, of one color."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import InitVar, dataclass, fields, replace
from typing import Any, ClassVar, TypeVar

import numpy as np

from flurries._contract import Array, choice, flag, integer, real, seed_of, vector
from flurries._core import snowfall
from flurries.composite import join
from flurries.effects.demand import needs_of_falling
from flurries.effects.knobs import Knobs
from flurries.effects.limited import deepened, veil
from flurries.effects.looks import look_of
from flurries.effects.peopled import Peopled
from flurries.effects.resolution import map_at
from flurries.effects.seen import seen
from flurries.frame.layer import Frame, Layer, Light
from flurries.frame.needs import Needs
from flurries.motion.keys import Keys, Number, as_number, as_vector, value_at
from flurries.motion.wind import Wind
from flurries.spectral.tables import ALIAS, band_of
from flurries.spectral.tiles import BLEND
from flurries.trace import count, stage

DEPTH_MODES = ("tile", "pixel")

# What `color` says instead of a color: the background's own light.
AMBIENT = "ambient"

_Kind = TypeVar("_Kind", bound="Falling")


@dataclass(frozen=True, kw_only=True)
class Falling(Peopled, Knobs, ABC):
    """Snow and rain. The fields are described in `Snow` and `Rain`."""

    amount: Number = 1.0
    color: Any = 0.98
    haze: Number = 0.04
    texture: Number = 0.8
    mean: Number = 0.05
    spread: Number = 2.0
    power: Number = 2.0
    depth_mode: str = "tile"
    look: str = "v1"
    seed: int | None = None
    severity: InitVar[int | None] = None
    rate_mm_h: InitVar[float | None] = None

    NAME: ClassVar[str] = ""
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = {}
    KNOBS: ClassVar[tuple[str, ...]] = ("severity", "rate_mm_h")

    def __post_init__(self, severity: int | None, rate_mm_h: float | None) -> None:
        def settle(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        look_of(self.look)
        knob = self._turned(severity=severity, rate_mm_h=rate_mm_h)
        self._set(knob, self._look(severity, rate_mm_h), *self._instead())
        for name in ("amount", "haze", "texture"):
            settle(name, as_number(name, getattr(self, name), low=0.0, high=1.0))
        for name in ("fall", "mean"):
            settle(name, as_number(name, getattr(self, name)))
        for name in ("spread", "power"):
            settle(name, as_number(name, getattr(self, name), above=0.0))
        settle("shutter", as_number("shutter", self.shutter, low=0.0))
        if not isinstance(self.wind, Wind):
            settle("wind", as_vector("wind", self.wind, 3))
        settle("color", settled_color(self.color))
        settle("exponent", real("exponent", self.exponent))
        settle("near_depth", real("near_depth", self.near_depth, above=0.0))
        if self.wavelengths is not None:
            low, high = band_of(self.wavelengths)
            if not 2.0 <= low < high:
                raise ValueError(f"wavelengths must be 2 <= shortest < longest, got {(low, high)}")
            settle("wavelengths", (low, high))
        if self.tile is not None:
            settle("tile", integer("tile", self.tile, low=5, high=2**15))
        if self.overlap is not None:
            settle("overlap", integer("overlap", self.overlap, low=0, high=2**15))
            if self.tile is not None and self.overlap >= self.tile:
                raise ValueError(
                    f"overlap must be less than the tile ({self.tile} px), got {self.overlap}"
                )
        choice("blend", self.blend, BLEND)
        choice("alias", self.alias, ALIAS)
        choice("depth_mode", self.depth_mode, DEPTH_MODES)
        flag("jitter", self.jitter)
        if self.seed is not None:
            settle("seed", seed_of(self.seed))

    @abstractmethod
    def _look(self, severity: int | None, rate_mm_h: float | None) -> dict[str, Any]:
        """Return the fields that a knob sets."""

    def _instead(self) -> tuple[str, ...]:
        """Return fields that say the same as one that a knob sets."""
        return ()

    def _settle_particles(self, number: str, size: str, density: str) -> None:
        """Check how many particles there are, and how large."""
        count = integer(number, getattr(self, number), low=0, high=100_000_000)
        object.__setattr__(self, number, count)
        many = getattr(self, density)
        if many is not None:
            object.__setattr__(self, density, real(density, many, low=0.0, high=1e6))
        sizes = vector(size, getattr(self, size), 2).tolist()
        if not 0.0 < sizes[0] <= sizes[1]:
            raise ValueError(f"{size} must be 0 < smallest <= largest, got {tuple(sizes)}")
        object.__setattr__(self, size, tuple(sizes))

    @classmethod
    def preset(cls: type[_Kind], name: str, **changes: Any) -> _Kind:
        """Return a look by name; further arguments replace single values of it."""
        values: dict[str, Any] = dict(cls.PRESETS[choice("preset", name, tuple(cls.PRESETS))])
        unknown = set(changes) - {f.name for f in fields(cls)}
        if turned := unknown & set(cls.KNOBS):
            knob = sorted(turned)[0]
            raise TypeError(f"{knob} and a preset set the same fields: give one of them")
        if unknown:
            raise TypeError(f"{cls.__name__} has no field {sorted(unknown)[0]!r}")
        return cls(**{**values, **changes})

    def mapped(self, frame: Frame, amount: float) -> tuple[float, float, float, float]:
        """Return mean, spread, power and amount of the texture's map to opacity."""
        t = frame.t
        power = value_at(self.power, t)
        mean, spread = map_at(
            value_at(self.mean, t), value_at(self.spread, t), power, self.power_share(frame.shape)
        )
        return mean, spread, power, amount * value_at(self.texture, t)

    def needs(self, frame: Frame) -> Needs:
        """Return what a frame takes: see :mod:`flurries.effects.demand`."""
        return needs_of_falling(self, frame)

    def render(self, frame: Frame) -> Layer:
        """Return this effect's layer of a frame."""
        amount, run = value_at(self.amount, frame.t), frame.running(self)
        haze = amount * value_at(self.haze, frame.t)
        depth = frame.depth
        planes = [
            run("texture", lambda: deepened(self, frame, self.mapped(frame, amount))),
            run("flakes", lambda: self.particles(frame, amount)),
        ]
        if depth is not None:
            near, far = frame.crop(depth), self.far_depth(frame.shape)
            once = lambda: frame.here(self, "veil", lambda: veil(haze, near, far))  # noqa: E731
            planes.append(run("veil", once))
            haze = 0.0
        parts = [plane for plane in planes if plane is not None]
        if not parts:
            top, bottom, left, right = frame.window
            parts.append(np.zeros((bottom - top, right - left), np.float32))
        with stage("join"):
            alpha = join(parts, haze=haze)
        layer = Layer(self.NAME, alpha, self._color_of(frame))
        if not frame.whole:
            return layer
        return replace(layer, **seen(self, frame, amount, planes[0], planes[1])._asdict())

    def over(self, frame: Frame, behind: Array, light: Light) -> Array | None:
        """Return this effect over a picture, the bits of its layer over it, in one pass.

        None where that pass has no way to do it: no texture, or a scene that ends.
        """
        amount, run = value_at(self.amount, frame.t), frame.running(self)
        # A texture that never moves is kept as a plane.
        if frame.depth is not None or "texture" not in run.steps or run.keeps("texture"):
            return None
        flakes = run("flakes", lambda: self.sorted(frame, amount))
        result = np.empty_like(behind)
        with stage("texture"):
            made = snowfall(
                result,
                behind,
                self.texture_request(frame),
                self.mapped(frame, amount),
                self.preserves_mean,
                amount * value_at(self.haze, frame.t),
                light(self._color_of(frame)),
                flakes,
            )
            count("tiles", made)
        return result

    def _color_of(self, frame: Frame) -> tuple[float, float, float]:
        if self.color == AMBIENT:
            return frame.ambient or (1.0, 1.0, 1.0)
        color = value_at(self.color, frame.t)
        return (color,) * 3 if isinstance(color, float) else color


def settled_color(value: object) -> Any:
    """Return one grey or (r, g, b), plain or keyed, in 0 to 1, or the word for ambient light."""
    if isinstance(value, Keys):
        if value.width not in (None, 3):
            raise ValueError(f"color must be keyed with numbers or (r, g, b), got {value!r}")
        for _, v in value.keys:
            settled_color(v)
        return value
    if isinstance(value, str):
        return choice("color", value, (AMBIENT,))
    if isinstance(value, (float, int, np.number, bytes)) or value is None:
        return real("color", value, low=0.0, high=1.0)
    parts = vector("color", value, 3).tolist()
    return tuple(real("color", part, low=0.0, high=1.0) for part in parts)
