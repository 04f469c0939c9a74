"""The light of a bank of mist: the sun's through the gas before it, and the sky's from above."""

from __future__ import annotations

import math
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from flurries._contract import Array
from flurries.effects.bank_density import SIGMAS, Density, Rays
from flurries.effects.bank_texture import COARSE, MARGIN
from flurries.effects.color import Base
from flurries.frame.layer import Shade
from flurries.frame.view import Frame
from flurries.gas.optics import phase
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
    return phase(np.clip(cosine, -1.0, 1.0), kind=mist.scatter, asymmetry=mist.asymmetry)


def lit_by_sun(mist: Any, frame: Frame) -> bool:
    return bool(mist.lit) and frame.sun is not None


# Pixels of the cells in which light is found.
CELL = 8

# The sine of the lowest sun: light that comes in flatter takes no longer way through mist.
LOWEST = 0.1

# Over which length gas shades: of the picture's height under the sky, of a bank's least side or the
# visibility in the sun; and where on it one looks, by the exponential law.
SKY, SUN = 1.0 / 16.0, 0.1
PLACES = (0.13, 0.47, 0.98, 2.08)

# The share of the light that gas takes from what lies deep below it, and how thick it must be for
# that: both by eye, on dark, bright and busy photographs. With more of either mist is smoke.
TAKEN, STEEP = 0.45, 0.5


def skylit(gas: Density, dense: Array, base: Base) -> Shade:
    """Return the sky's light on a slice, less below its own gas; `dense` is on the coarse grid."""
    shape = tuple(-(-side // CELL) for side in gas.frame.shape)
    above = _before(dense, shape, (0.0, SKY * len(dense))) / max(gas.extinction, 1e-30)
    colors = (1.0 - TAKEN * -np.expm1(-STEEP * above))[..., None] * base.dim
    return Shade(colors.astype(np.float32), float(CELL), (0, 0))


def sunny(gas: Density, depth: float, lumps: Array | None, base: Base) -> Shade:
    """Return the sun's light on a slice of opaque gas with a structure on the coarse grid."""
    frame, mist, rays = gas.frame, gas.mist, Rays(gas.frame, CELL)
    assert frame.sun is not None
    sun, x, y = frame.sun, rays.x, rays.y
    way = frame.to_camera(sun.unit())
    cosine = -(x * way[0] + y * way[1] + way[2]) / np.sqrt(1.0 + x * x + y * y)
    thick = gas.extinction * _sunward(gas, rays, depth)
    if lumps is not None:
        size = mist.farthest if mist.center is None else min(mist.box)
        reach = SUN * frame.camera.focal * size / depth / COARSE
        before = _before(lumps, thick.shape, (reach * way[0], reach * way[1]))
        # As lumps even out along the way, which is not only in the picture, they shade by half.
        thick *= 0.5 + 0.5 * before / max(float(before.mean()), 1e-12)
    reaches = np.exp((mist.forward - 1.0) * thick) * scattered(mist, cosine)
    white = (1.0 - sun.ambient) * srgb_to_linear(np.asarray(sun.color, np.float64))
    colors = sun.ambient * base.dim + reaches[..., None] * (white * base.sunny)
    return Shade(colors.astype(np.float32), float(CELL), (0, 0))


def _sunward(gas: Density, rays: Rays, depth: float) -> Array:
    """Return the metres of the sun's light through the mean gas to a depth, (rows, columns)."""
    assert gas.frame.sun is not None
    sun, way = gas.frame.sun.unit(), np.zeros((len(rays.y), rays.x.size), np.float32)
    if gas.mist.center is not None:
        # Through a Gaussian it is the tail of the normal law over its density (Mills' ratio).
        slant = -sun * SIGMAS / np.array(gas.mist.box)
        along = np.linalg.norm(slant)
        parts = gas.from_middle(rays, depth)
        place = sum(part * to for part, to in zip(parts, slant / along, strict=True))
        way += _mills(np.maximum(place, -6.0)) / along
    elif gas.mist.top is not None:
        height = gas.height(rays, depth)
        thick = gas.mist.falloff * np.log1p(np.exp(-height)) * (1.0 + np.exp(height))
        way += thick / max(sun[1], LOWEST)
    way *= gas.profile(rays, depth)
    return way


def _before(plane: Array, shape: tuple[int, ...], way: tuple[float, float]) -> Array:
    """Return the mean of a coarse plane on the way (x, y) of light to each cell."""
    # Not that of the cell itself: a lump that shaded itself would be a hole.
    total = np.zeros(shape, np.float32)
    for part in PLACES:
        down, across = (
            np.clip(np.arange(cells) * (CELL // COARSE) + MARGIN - round(part * to), 0, side - 1)
            for cells, to, side in zip(shape, way[::-1], plane.shape, strict=True)
        )
        total += plane[np.ix_(down, across)]
    return np.asarray(total / np.float32(len(PLACES)))


def _mills(a: Any) -> Any:
    """Return the tail of the normal law from `a` on over its density, to 1 % (Boyd 1959)."""
    far = np.abs(a)
    ratio = math.pi / ((math.pi - 1.0) * far + np.sqrt(far * far + math.tau))
    return np.where(a < 0.0, math.sqrt(math.tau) * np.exp(0.5 * far * far) - ratio, ratio)
