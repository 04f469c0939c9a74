"""Rain made of drops: one population, near drops drawn as streaks, far ones synthesized."""

from __future__ import annotations

from dataclasses import InitVar, dataclass, field
from functools import cached_property, partial
from typing import Any, ClassVar

from flurries.effects.checks import settle
from flurries.effects.flake_texture import FlakeTexture
from flurries.effects.knobs import knobs, looks
from flurries.effects.population import POPULATION, Falling, Mixture, parts_of, size_law
from flurries.effects.precipitation import Precipitation
from flurries.effects.presets import RAIN_LOOKS, RainLook
from flurries.effects.strength import solved
from flurries.light.phase import DROPS
from flurries.motion.keys import Keys, Number, Vector, as_number
from flurries.motion.wind import Wind
from flurries.particles.sizes import RAIN, Matter


@looks
@knobs("rate", "visibility", "severity", law=partial(solved, "rain", RAIN, "drop_size", size_law))
@dataclass(frozen=True, kw_only=True)
class Rain(Falling):
    """Rain, made of drops.

    One population fills the air: near drops are drawn as streaks, far ones are a texture of drops.

    Parameters
    ----------
    preset, density, opacity, amount, emission, fall, wind, haze, shutter, near, far, backdrop, \
cloud, handover, method, look, seed, severity, rate, visibility
        As in :class:`Snow`.
    color : float, (r, g, b), "#rrggbb", "ambient" or "local"
        As in :class:`Snow`. "local" is the light that a drop bends towards the camera, and `gain`
        does not count.
    drop_size : (smallest, mean, largest)
        As `flake_size` of :class:`Snow`.
    gain : float
        Light that a drop sends, divided by `color`. A drop shows the sky ahead, most of it higher
        than what the picture has: under clouds twice as bright as at the horizon. Keyed.
    shape : {"natural", "round"}
        Shape of a drop near the camera: "natural" is flattened by its fall, with a rim through
        which little light comes; "round" is a round dot.
    """

    preset: InitVar[RainLook | None] = field(default=None, kw_only=False)
    density: Number = 700.0
    drop_size: tuple[float, float, float] | Keys = (0.0005, 0.0009, 0.006)
    wind: Vector | Wind = (0.6, 0.0, 0.0)
    gain: Number = 2.0

    NAME: ClassVar[str] = "rain"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = RAIN_LOOKS
    MATTER: ClassVar[Matter] = RAIN

    def __post_init__(self, *_: Any) -> None:
        checks = {name: check for name, check in POPULATION.items() if name != "sway"}
        settle(
            self, {**checks, "drop_size": size_law, "gain": partial(as_number, low=0.0, high=100.0)}
        )

    @cached_property
    def parts(self) -> Precipitation[FlakeTexture] | Mixture:
        return parts_of(
            self,
            sizes=self.drop_size,
            speed=RAIN.speed,
            shape="drop" if self.shape == "natural" else "round",
            gain=self.gain,
            optics=DROPS,
        )
