"""Rain made of drops: one population, near drops drawn as streaks, far ones synthesized."""

from __future__ import annotations

from dataclasses import InitVar, dataclass, field
from functools import cached_property, partial
from typing import Any, ClassVar

from flurries.effects.checks import settle
from flurries.effects.color import Color
from flurries.effects.described import Described
from flurries.effects.flake_texture import FlakeTexture
from flurries.effects.knobs import knobs, looks
from flurries.effects.population import POPULATION, Method, Mixture, Shape, parts_of, size_law
from flurries.effects.population_looks import RAIN, RainLook, rain_of_rate, rain_of_severity
from flurries.effects.precipitation import Precipitation
from flurries.light.phase import DROPS
from flurries.motion.keys import Keys, Number, Vector, as_number
from flurries.motion.wind import Wind
from flurries.particles.sizes import drop_speed


@looks
@knobs(severity=lambda value, _: rain_of_severity(value), rate=lambda value, _: rain_of_rate(value))
@dataclass(frozen=True, kw_only=True)
class Rain(metaclass=Described):
    """Rain, made of drops.

    One population fills the air: near drops are drawn as streaks, far ones are a texture of drops.
    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres.

    Parameters
    ----------
    preset : str, optional
        A look by name, of ``PRESETS``; given fields replace its own.
    density : float
        Drops per cubic metre. Keyed: as it changes, drops come and go one by one.
    drop_size : (smallest, mean, largest)
        Diameters in metres, exponentially distributed. Keyed, as in :class:`Snow`.
    opacity : float
        Mean opacity over the disc of a drop at rest, 0 to 0.99.
    gain : float
        Light that a drop sends, divided by `color`. A drop shows the sky ahead, most of it higher
        than what the picture has: under clouds twice as bright as at the horizon. Keyed.
    amount : float
        Share of the drops that are shown, 0 to 1. Keyed.
    emission : float
        Share of the drops that begin to fall, 0 to 1. Keyed.
    fall : float, optional
        Fall speed of a drop of the mean size, metres per second; larger drops fall faster. If not
        given, the measured speed of drops of this size. Keyed.
    wind : (x, y, z) or Wind
        Air velocity, metres per second, x right, y down, z away from the camera. Keyed.
    color : float, (r, g, b), "#rrggbb", "ambient" or "local"
        Display values, 0 to 1. Keyed. As in :class:`Snow`; "local" is the light that a drop bends
        towards the camera, and `gain` does not count.
    haze : float
        Opacity of an even veil beside the drops, 0 to 1. Keyed.
    shutter : float, optional
        Exposure in frames, centred on the frame: how long the streaks are. Keyed. If not
        given, 0.5, and 1/250 s in a still; see `fps` of :class:`flurries.Scene`.
    near, far : float
        Depths in metres between which there are drops, as in :class:`Snow`.
    cloud : float
        Height above the camera in metres at which drops begin to fall, for `emission`.
    shape : {"natural", "round"}
        Shape of a drop near the camera: "natural" is flattened by its fall, with a rim through
        which little light comes; "round" is a round dot.
    handover, method, look, seed
        As in :class:`Snow`, with `TentRain` and `ConeRain`.
    severity : int, optional
        1 to 5. Sets other fields; scene files hold those and not the severity.
    rate : float, optional
        Rate of rain in mm/h. Sets `density` and `drop_size` so that the drops carry this rate.

    Examples
    --------
    >>> import flurries as fl
    >>> fl.Rain(rate=10.0).density > fl.Rain(rate=1.0).density
    True
    """

    preset: InitVar[RainLook | None] = field(default=None, kw_only=False)
    density: Number = 700.0
    drop_size: tuple[float, float, float] | Keys = (0.0005, 0.0009, 0.006)
    opacity: float = 0.9
    gain: Number = 2.0
    amount: Number = 1.0
    emission: Number = 1.0
    fall: Number | None = None
    wind: Vector | Wind = (0.6, 0.0, 0.0)
    color: Color = "ambient"
    haze: Number = 0.0
    shutter: Number | None = None
    near: float = 0.4
    far: float = 60.0
    cloud: float = 10.0
    handover: float | None = None
    method: Method = "flakes"
    shape: Shape = "natural"
    look: str = "v2"
    seed: int | None = None
    severity: InitVar[int | None] = None
    rate: InitVar[float | None] = None

    NAME: ClassVar[str] = "rain"
    PRESETS: ClassVar[dict[str, dict[str, Any]]] = RAIN

    def __post_init__(self, *_: Any) -> None:
        checks = {name: check for name, check in POPULATION.items() if name != "sway"}
        settle(
            self, {**checks, "drop_size": size_law, "gain": partial(as_number, low=0.0, high=100.0)}
        )

    @cached_property
    def parts(self) -> Precipitation[FlakeTexture] | Mixture:
        """The parts of the effect."""
        return parts_of(
            self,
            sizes=self.drop_size,
            speed=drop_speed,
            shape="drop" if self.shape == "natural" else "round",
            gain=self.gain,
            optics=DROPS,
        )
