"""How the sun shades the gas of a mist, and where the gas scatters light to."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from flurries import gas
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries.effects.lighting import Base
from flurries.frame.view import Frame
from flurries.io.color import srgb_to_linear
from flurries.light.phase import DROPS, Optics

Law: TypeAlias = Literal["even", "rayleigh", "henyey"]
SCATTER = get_args(Law)


def brightest(mist: Any) -> float:
    """Return the most that the phase function of a `Mist` brightens white gas by."""
    if mist.scatter == "henyey":
        g: float = abs(mist.asymmetry)
        return (1.0 + g) / (1.0 - g) ** 2
    return 1.5 if mist.scatter == "rayleigh" else 1.0


def optics_of(mist: Any) -> Optics:
    """Return the optics of the particles, for the light of lamps."""
    return Optics(mist.asymmetry, 1.0) if mist.scatter == "henyey" else DROPS


def scattered(mist: Any, cosine: Any) -> Any:
    """Return the sun's light towards the eye over the mean of all directions."""
    if mist.scatter == "even":
        return 1.0
    return gas.phase(np.clip(cosine, -1.0, 1.0), kind=mist.scatter, asymmetry=mist.asymmetry)


def sunlit(mist: Any, frame: Frame, points: Float64, shown: Float64, base: Base) -> Array:
    """Return the linear color of particles at points of the eye, (n, 3), `base` in full light."""
    sun = frame.sun
    assert sun is not None
    # In house axes, so that a camera that only turns or moves has the same gas and light.
    world = points @ frame.camera.matrix().T + frame.path.place(frame.t, fps=frame.fps)
    x, y, z = sun.unit().tolist()
    places, density = np.round(world, 9).tobytes(), np.round(shown, 12).tobytes()
    light = _light_in(places, density, mist.radius, (x, y, z), mist.forward)
    eye = np.array(frame.camera.offset) - points
    away = np.linalg.norm(eye, axis=1)
    way = frame.to_camera(sun.unit())
    cosine = np.divide(eye @ way, away, out=np.zeros_like(away), where=away > 0.0)
    white = srgb_to_linear(np.asarray(sun.color, np.float64))
    lit = (1.0 - sun.ambient) * (light * scattered(mist, cosine))[:, None] * white
    if base.dim is base.sunny:
        return np.ascontiguousarray(base.dim * (sun.ambient + lit))
    return np.ascontiguousarray(base.dim * sun.ambient + base.sunny * lit)


@kept(8, by_mode=True)
def _light_in(
    centers: bytes, density: bytes, radius: float, way: tuple[float, float, float], forward: float
) -> Float64:
    places = np.frombuffer(centers).reshape(-1, 3)
    lit = gas.light(places, radius, np.frombuffer(density), way, forward=forward)
    lit.flags.writeable = False
    return lit
