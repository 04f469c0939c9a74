"""How the sun shades a gas, and where the gas scatters its light to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np

from flurries import gas
from flurries._contract import Array, Float64
from flurries._threads import kept_by_mode
from flurries.frame.view import Frame
from flurries.io.color import srgb_to_linear
from flurries.light.phase import DROPS, Optics

Law: TypeAlias = Literal["even", "rayleigh", "henyey"]
SCATTER = get_args(Law)


@dataclass(frozen=True, eq=False)
class Scatter:
    """The scattering of light by particles.

    Attributes
    ----------
    kind : {"even", "rayleigh", "henyey"}
        The phase function, see :func:`flurries.gas.phase`.
    asymmetry : float
        Of "henyey".
    forward : float
        Share of the sun's light that a particle passes on to those behind it.
    """

    kind: str
    asymmetry: float
    forward: float

    @property
    def brightest(self) -> float:
        """The most that the phase function brightens white gas by."""
        if self.kind == "henyey":
            g = abs(self.asymmetry)
            return (1.0 + g) / (1.0 - g) ** 2
        return 1.5 if self.kind == "rayleigh" else 1.0

    @property
    def optics(self) -> Optics:
        """The optics of the particles, for the light of lamps."""
        return Optics(self.asymmetry, 1.0) if self.kind == "henyey" else DROPS

    def colors(
        self, frame: Frame, points: Float64, shown: Float64, radius: float, dim: Float64,
        sunny: Float64,
    ) -> Array:  # fmt: skip
        """Return the linear color of each particle, (n, 3), of gas of these colors (3,)."""
        assert frame.sun is not None
        sun = frame.sun
        light = frame.once(self, "light", lambda: self._light(frame, points, shown, radius))
        scattered = light
        if self.kind != "even":
            eye = np.array(frame.camera.offset) - points
            away = np.linalg.norm(eye, axis=1)
            way = frame.to_camera(sun.unit())
            cosine = np.divide(eye @ way, away, out=np.zeros_like(away), where=away > 0.0)
            scattered = light * gas.phase(
                np.clip(cosine, -1.0, 1.0), kind=self.kind, asymmetry=self.asymmetry
            )
        white = srgb_to_linear(np.asarray(sun.color, np.float64))
        lit = (1.0 - sun.ambient) * scattered[:, None] * white
        if dim is sunny:
            return np.ascontiguousarray(dim * (sun.ambient + lit))
        return np.ascontiguousarray(dim * sun.ambient + sunny * lit)

    def _light(self, frame: Frame, points: Float64, shown: Float64, radius: float) -> Float64:
        """Return the sun's light that reaches each particle, (n,)."""
        assert frame.sun is not None
        # In house axes, so that a camera that only turns or moves has the same gas and light.
        world = points @ frame.camera.matrix().T + frame.path.place(frame.t, fps=frame.fps)
        x, y, z = frame.sun.unit().tolist()
        places, density = np.round(world, 9).tobytes(), np.round(shown, 12).tobytes()
        return _light_in(places, density, radius, (x, y, z), self.forward)


@kept_by_mode(8)
def _light_in(
    centers: bytes, density: bytes, radius: float, way: tuple[float, float, float], forward: float
) -> Float64:
    """Return the light in a gas; the last gases and lights are kept."""
    places = np.frombuffer(centers).reshape(-1, 3)
    lit = gas.light(places, radius, np.frombuffer(density), way, forward=forward)
    lit.flags.writeable = False
    return lit
