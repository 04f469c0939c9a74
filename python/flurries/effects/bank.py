"""Mist by its visibility: one extinction up to twice as far, even or with structure."""

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from flurries import _core, gas
from flurries._contract import Array
from flurries._trace import current
from flurries.effects.bank_density import COARSE, MARGIN, SIGMAS, Density, Rays, Slices
from flurries.effects.color import Base, base_of, even_shade
from flurries.effects.vapor import lit_by_sun, moved_with, needs_of_gas, optics_of
from flurries.frame.layer import Layer, Shade
from flurries.frame.needs import Needs
from flurries.frame.planes import blank, plane
from flurries.frame.view import Frame
from flurries.gas.optics import phase
from flurries.io.color import srgb_to_linear
from flurries.motion.keys import value_at

# Of a frame: opacity (H, W), the light (H, W, 3) of sky, sun and lamps multiplied by it, and the
# mean depth (H, W) of what shows.
Drawn: TypeAlias = tuple[Array, Array | None, Array | None]

CELL = 8  # Pixels of the cells in which light is found.

# The sine of the lowest sun: light that comes in flatter takes no longer way through mist.
LOWEST = 0.1

# Over which length gas shades: of the picture's height under the sky, of a bank's least side or the
# visibility in the sun; and where on it one looks, by the exponential law.
SKY, SUN = 1.0 / 16.0, 0.1
PLACES = (0.13, 0.47, 0.98, 2.08)

# The share of the light that gas takes from what lies deep below it, and how thick it must be for
# that: both by eye, on dark, bright and busy photographs. With more of either mist is smoke.
TAKEN, STEEP = 0.45, 0.5


@dataclass(frozen=True, eq=False)
class Bank:
    mist: Any  # A `Mist`, settled.

    def extinction(self, t: float) -> float:
        """Return the extinction of an even gas of the same mean transmittance at `t`, per metre."""
        visible = float(value_at(self.mist.visibility, t))
        return float(value_at(self.mist.amount, t)) * gas.visibility(visible)

    def air(self, t: float) -> float:
        return 0.0 if self._topped else self.extinction(t)

    @property
    def _topped(self) -> bool:
        return self.mist.center is not None or self.mist.top is not None

    def needs(self, frame: Frame) -> Needs:
        mist = self.mist
        out = {"particles": "it has a visibility, and is drawn in slices"}
        if mist.center is None and not frame.deep:
            out["depth"] = f"nobody gave one: mist takes a wall at {mist.backdrop:g} m (backdrop)"
        shows = self.extinction(frame.t) > 0.0
        return needs_of_gas(mist, frame, out, shows=shows, most=1.0, by_rows=False)

    def render(self, frame: Frame) -> Layer:
        mist = self.mist
        base, color, local = base_of(mist.color, frame)
        # Under the plate's sky gas with a top is dimmer below its own.
        lit = lit_by_sun(mist, frame) or (local and self._topped)
        step = "lit gas" if lit_by_sun(mist, frame) or frame.lights else "gas"
        make = partial(self._drawn, frame, base, lit=lit)
        made = frame.run(self, step, frame.once, self, "bank", make, eye=True, depth=True)
        if made is None:
            return Layer(mist.NAME, np.zeros(frame.size, np.float32), color)
        alpha, light, depth = (None if plane is None else frame.crop(plane) for plane in made)
        assert alpha is not None
        # All light of what is lit is a glow, which is mixed as light.
        own = even_shade(frame, (0.0, 0.0, 0.0) if lit else color)
        shade = own if lit or local or light is not None else None
        layer = Layer(mist.NAME, alpha, color, shade=shade, glow=light)
        if depth is None:
            return layer
        with current.get().stage("passes"):
            return moved_with(layer, depth, frame, mist.wind)

    def _drawn(self, frame: Frame, base: Base, *, lit: bool) -> Drawn:
        mist, slopes, extinction = self.mist, Rays(frame).slopes, self.extinction(frame.t)

        def make() -> tuple[Density, list[Slices]]:
            density = Density(mist, frame, extinction, gas.visibility(mist.farthest))
            return density, list(density.slices())

        density, parts = frame.once(self, "density", make, eye=True)
        alpha, plain = plane(frame.shape), not (lit or frame.lights or frame.whole)
        # Opacity alone is found where the window is, in whole coarse rows.
        top, bottom = frame.window[:2] if plain else (0, frame.shape[0])
        first, last = top // COARSE, -(-bottom // COARSE)
        rows = slice(first * COARSE, last * COARSE)
        ground = None if frame.depth is None else frame.depth[rows]
        groups: list[Any] = []
        for part in parts:
            near = np.ascontiguousarray(part.dense[:, first : last + 2 * MARGIN])
            detail = part.detail and (part.detail[0][rows], part.detail[1])
            groups.append((near, part.edges, ground, (slopes[0], slopes[1][rows]), detail))
        _core.gas_slices(alpha[rows], groups)
        if plain:
            return alpha, None, None
        light = blank((*frame.shape, 3)) if lit or frame.lights else None
        far = np.full(frame.shape, np.inf, np.float32) if frame.whole else None
        if not parts:
            return alpha, light, far
        dense = np.concatenate([part.dense for part in parts])
        edges = [edge for number, part in enumerate(parts) for edge in part.edges[number > 0 :]]
        places = [place for part in parts for place in part.places]
        if lit and light is not None:
            total, lumps = blank(frame.shape), [one for part in parts for one in part.lumps]
            for number, place in enumerate(places):
                one = dense[number][None], edges[number : number + 2], frame.depth, slopes, None
                taken = plane(frame.shape)
                _core.gas_slices(taken, [one])
                taken *= 1.0 - total
                total += taken
                shade = skylit(density, dense[number], base)
                if lit_by_sun(mist, frame):
                    shade = sunny(density, place, lumps[number], base)
                _core.shade_add(light, taken, shade.given())
            # Slices are lit without their short waves, which the opacity has.
            scale = alpha / np.maximum(total, np.float32(1e-6))
            for channel in range(3):  # Three at once take longer.
                light[..., channel] *= scale
        if frame.lights or frame.whole:
            whole, grid = (dense, edges, frame.depth, slopes, None), density.rays.slopes
            lamps, eye = frame.lamps(without=self.air(frame.t)), frame.camera.offset
            glow = light if frame.lights else None
            _core.gas_glow(glow, far, alpha, whole, grid, places, lamps, optics_of(mist), eye)
        return alpha, light, far


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
    reaches = np.exp((mist.forward - 1.0) * thick)
    if mist.scatter != "even":
        cosine = np.clip(cosine, -1.0, 1.0)
        reaches = reaches * phase(cosine, kind=mist.scatter, asymmetry=mist.asymmetry)
    white = (1.0 - sun.ambient) * srgb_to_linear(np.asarray(sun.color, np.float64))
    colors = sun.ambient * base.dim + reaches[..., None] * (white * base.sunny)
    return Shade(colors.astype(np.float32), float(CELL), (0, 0))


def _sunward(gas: Density, rays: Rays, depth: float) -> Array:
    """Return the metres of the sun's light through the mean gas to a depth, (rows, columns)."""
    assert gas.frame.sun is not None
    sun, way = gas.frame.sun.unit(), np.zeros((len(rays.y), rays.x.size), np.float32)
    if gas.mist.center is not None:
        # Through a Gaussian: Mills' ratio, the tail over the density, to 1 % (Boyd 1959).
        slant = -sun * SIGMAS / np.array(gas.mist.box)
        along = np.linalg.norm(slant)
        parts = gas.from_middle(rays, depth)
        place = sum(part * to for part, to in zip(parts, slant / along, strict=True))
        place = np.maximum(place, -6.0)
        far = np.abs(place)
        ratio = math.pi / ((math.pi - 1.0) * far + np.sqrt(far * far + math.tau))
        whole = math.sqrt(math.tau) * np.exp(0.5 * far * far)
        way += np.where(place < 0.0, whole - ratio, ratio) / along
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
