"""Rain made of drops: one population, near drops drawn as streaks, far ones synthesized."""

from __future__ import annotations

from dataclasses import InitVar, dataclass, field
from functools import partial
from typing import Any, ClassVar

from flurries.effects.knobs import knobs, looks
from flurries.effects.population import Falling, size_law
from flurries.effects.presets import RAIN_LOOKS, RainLook
from flurries.effects.strength import solved
from flurries.light.phase import DROPS, Optics
from flurries.motion.keys import Keys, Number, Vector
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
    preset, density, opacity, amount, emission, fall, wind, haze, shutter, clumps, near, far, \
backdrop, cloud, handover, method, look, seed, severity, rate, visibility
        As in :class:`Snow`.
    color : float, (r, g, b), "#rrggbb", "ambient" or "local"
        As in :class:`Snow`. "local" is the light that a drop bends towards the camera, and `gain`
        does not count.
    drop_size : (smallest, mean, largest)
        As `flake_size` of :class:`Snow`.
    gain : float, optional
        Light that a drop sends, divided by `color`. A drop shows the sky ahead, most of it higher
        than what the picture has: under clouds twice as bright as at the horizon. If not given, 2
        where it pours, 4 in thin rain. Keyed.
    shape : {"natural", "round"}
        Shape of a drop near the camera: "natural" is flattened by its fall, with a rim through
        which little light comes; "round" is a round dot.
    """

    preset: InitVar[RainLook | None] = field(default=None, kw_only=False)
    density: Number = 700.0
    drop_size: tuple[float, float, float] | Keys = (0.0005, 0.0009, 0.006)
    wind: Vector | Wind = (0.6, 0.0, 0.0)
    gain: Number | None = None

    NAME: ClassVar[str] = "rain"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = RAIN_LOOKS
    MATTER: ClassVar[Matter] = RAIN
    SIZES: ClassVar[str] = "drop_size"
    NATURAL: ClassVar[str] = "drop"
    OPTICS: ClassVar[Optics] = DROPS
