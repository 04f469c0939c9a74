"""The axes of what lies over the texture: flakes, layers, gas, the cone, depth."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from accuracy_ways import Array, Way, axis, both, largest, rms

from flurries import Camera, Scene, TentSnow, gas, particles, spectral
from flurries import composite as mixing
from flurries import cone as drum


@axis("of opacity, rms", "each flake's Gaussian integrated over the pixels, float64")
def flakes() -> Iterator[Way]:
    """2,000 flakes of 0.3 to 2 px, 512 x 512."""
    shape, eye = (512, 512), Camera(600.0)
    rng = np.random.default_rng(4)
    depth = rng.uniform(4.0, 20.0, 2000)
    px = rng.uniform(10.0, 502.0, (2000, 2))
    sigma = rng.uniform(0.3, 2.0, 2000)
    points = np.column_stack([(px - 256.0) * depth[:, None] / eye.focal, depth])
    radius = 3.0 * sigma * depth / eye.focal

    def drawn(spot: Callable[[Array, Array, float], Array], reach: float) -> Array:
        through = np.ones(shape)
        for (x, y), s in zip(px, sigma, strict=True):
            far = math.ceil(reach * s)
            rows, cols = (
                np.arange(max(int(at) - far, 0), min(int(at) + far, 511) + 1) for at in (y, x)
            )
            through[np.ix_(rows, cols)] *= 1.0 - 0.5 * spot(rows - y, cols - x, s)
        return 1.0 - through

    off = rms(drawn(_integrated, 8.0))
    splat = partial(particles.splat, shape, points, radius, eye, opacity=0.5)
    yield from both("splat", splat, off)
    for cut in (2.0, 3.0, 4.0):
        samples = partial(drawn, partial(_sampled, cut), cut)
        yield Way(f"NumPy, samples to {cut:g} sigma", samples, off)


def _integrated(y: Array, x: Array, s: float) -> Array:
    """Return a Gaussian's mean over pixels whose first edges are at y and x, by error functions."""

    def mean(edges: Array) -> Array:
        values = [math.erf(edge / (s * math.sqrt(2.0))) for edge in (*edges, edges[-1] + 1)]
        return np.asarray(math.sqrt(math.pi / 2.0) * s * np.diff(values))

    return np.outer(mean(y), mean(x))


def _sampled(cut: float, y: Array, x: Array, s: float) -> Array:
    """Return a Gaussian at the pixels' centres, cut off."""
    square = ((y + 0.5) ** 2)[:, None] + (x + 0.5) ** 2
    return np.asarray(np.exp(-square / (2.0 * s * s)) * (square <= (cut * s) ** 2))


@axis("of 255, largest", "the same layers in float64, one after the other")
def composite() -> Iterator[Way]:
    """Six layers in 8 bits or in floats, 512 x 512."""
    shape = (512, 512)
    picture = np.random.default_rng(1).integers(0, 256, (*shape, 3), np.uint8)
    layer = partial(spectral.alpha, shape, mean=0.1, dtype=np.float64)
    layers = [layer(drift=(3.0 * i, 9.0), seed=i) for i in range(6)]
    narrow = [layer.astype(np.float32) for layer in layers]
    exact = picture / 255.0
    for alpha in layers:
        exact = (250.0 / 255.0) * alpha[..., None] + (1.0 - alpha[..., None]) * exact
    off = largest(255.0 * exact)

    def chain(start: Array, alphas: list[Array]) -> Array:
        for alpha in alphas:
            start = mixing.snow(start, alpha)
        return start

    for name, start, alphas, scale in (
        ("uint8 each", picture, narrow, 1.0),
        ("uint16 each", picture.astype(np.uint16) * np.uint16(257), narrow, 1.0 / 257.0),
        ("float16 each", (picture / 255.0).astype(np.float16), narrow, 255.0),
        ("float32", (picture / 255.0).astype(np.float32), narrow, 255.0),
        ("float64", picture / 255.0, layers, 255.0),
    ):
        make = partial(chain, start, alphas)
        yield Way(name, make, lambda made, scale=scale: off(scale * made.astype(np.float64)))
    yield Way("joined, then uint8, float32", lambda: mixing.snow(picture, mixing.join(narrow)), off)


GAS, LENS = (240, 320), Camera(280.0)


def _cloud(count: int) -> Array:
    box = np.random.default_rng(2).uniform(-2.5, 2.5, (count, 3))
    return np.asarray(box + np.array([0.0, 0.0, 5.5]))


@axis("of opacity, mean", "the line integral through every particle at every pixel, float64")
def footprint() -> Iterator[Way]:
    """Footprints of gas, 300 particles, 320 x 240."""
    centers = _cloud(300)
    centers = centers[centers[:, 2] > 3.2]
    exact = _line_integrals(centers, 0.45, 0.4)
    models = ("viewplane", "viewplane_c", "viewpoint", "volume", "table")
    kinds: list[tuple[str, Any, str]] = [(model, np.float32, "taper") for model in models]
    kinds += [("viewplane_c", np.float32, "square"), ("volume", np.float64, "taper")]
    for model, kind, edge in kinds:
        how: dict[str, Any] = {"footprint": model, "edge": edge, "dtype": kind}
        name = f"{model}, {kind.__name__}{', square' if edge == 'square' else ''}"
        make = partial(gas.alpha, GAS, centers, 0.45, 0.4, LENS, **how)
        yield Way(name, make, lambda made: float(np.mean(np.abs(made - exact))))


def _line_integrals(centers: Array, radius: float, density: float) -> Array:
    """alpha = 1 - prod (1 - rho g(q)), q = 3 |C x d| / r for the ray d of each pixel."""
    rays, rim = _rays(GAS, LENS.focal, 0.5, 0.5), np.exp(-4.5)
    through = np.ones(GAS)
    for center in centers:
        along = rays @ center
        square = 9.0 * np.maximum(center @ center - along**2, 0.0) / radius**2
        g = np.maximum((np.exp(-0.5 * square) - rim) / (1.0 - rim), 0.0)
        through *= 1.0 - density * g * (along > 0.0)
    return 1.0 - through


def _rays(shape: tuple[int, int], focal: float, down: float, right: float) -> Array:
    """Return the unit ray through a point of each pixel."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float64)
    x, y = (x + right - shape[1] / 2) / focal, (y + down - shape[0] / 2) / focal
    rays = np.stack([x, y, np.ones(shape)], -1)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


@axis("of opacity, largest", "no early stop, float64")
def stop() -> Iterator[Way]:
    """Stopping early in gas, 2,000 particles, 320 x 240."""
    make = partial(gas.alpha, GAS, _cloud(2000), 0.6, 0.8, LENS)
    off = largest(make(error=None, dtype=np.float64))
    for error in (1e-1, 1e-2, 1.0 / 255.0, 1e-3, 1e-4):
        yield Way(f"until {error:.2g} is left", partial(make, error=error), off)
    yield Way("to the end, float32", partial(make, error=None), off)


@axis("of opacity, rms", "16 x 16 samples in each pixel, nearest texels")
def cone() -> Iterator[Way]:
    """Filter of the double cone, 240 x 180."""
    tile = drum.rain_tile(512, seed=4, dtype=np.float64)
    off = rms(_nearest(tile, 16))

    def sampled(count: int, kind: Any) -> Array:
        shape, own = (count * CONE[0], count * CONE[1]), tile.astype(kind)
        fine = drum.layer(shape, Camera(200.0 * count), own, dtype=kind, **DRUM)
        return np.asarray(fine.reshape(CONE[0], count, CONE[1], count).mean(axis=(1, 3)))

    for count, kind in ((1, np.float32), (1, np.float64), (2, np.float32), (3, np.float32)):
        yield Way(f"box x {count} x {count}, {kind.__name__}", partial(sampled, count, kind), off)
    for count, name in ((1, ""), (2, " x 2 x 2"), (4, " x 4 x 4")):
        yield Way(f"nearest texel{name}, NumPy", partial(_nearest, tile, count), off)


CONE = (180, 240)
# Some seven texels to a pixel: what a filter is for.
DRUM: dict[str, Any] = {
    "axis": (0.3, 1.0, 0.4), "phase": 0.37, "slope": 0.2, "repeats": 16
}  # fmt: skip


def _nearest(tile: Array, count: int) -> Array:
    """The tile at count^2 points in each pixel, from the mapping's equations (docs/cone.md)."""
    total = np.zeros(CONE)
    axes = drum.frame(np.array(DRUM["axis"]) / np.linalg.norm(DRUM["axis"]))
    repeats, slope, size = DRUM["repeats"], DRUM["slope"], tile.shape[0]
    for i, j in np.ndindex(count, count):
        rays = _rays(CONE, 200.0, (i + 0.5) / count, (j + 0.5) / count)
        s, ex, ey = (rays @ one for one in axes)
        across = np.hypot(ex, ey)
        u = np.arctan2(ey, ex) / (2.0 * np.pi) % 1.0 * repeats
        w = s / (across + slope * np.abs(s))
        v = repeats / (2.0 * np.pi) * w - DRUM["phase"]
        row, col = ((np.floor(at * size) % size).astype(int) for at in (v, u))
        part = np.clip((slope * np.abs(w) - 0.6) / 0.35, 0.0, 1.0)
        total += tile[row, col] * (1.0 - part * part * (3.0 - 2.0 * part))
    return total / count**2


@axis("of opacity, rms", "96 pictures of walls at one depth each, taken pixel by pixel")
def depth() -> Iterator[Way]:
    """Depth by tile or by pixel, 320 x 240."""
    floor = np.repeat(np.geomspace(120.0, 8.0, 240, dtype=np.float32)[:, None], 320, axis=1)

    def alpha(mode: str, depth: Any) -> Array:
        snow = TentSnow(flakes=0, haze=0.0, depth_mode=mode, wavelengths=(2.0, 16.0))
        scene = Scene((320, 240), effects=[snow], depth=depth, seed=3)
        return np.asarray(scene.render(40, layers=True).alpha)

    levels = np.geomspace(120.0, 8.0, 96)
    nearest = np.argmin(np.abs(np.log(floor[..., None]) - np.log(levels)), axis=-1)
    walls = np.stack([alpha("tile", float(level)) for level in levels])
    off = rms(np.take_along_axis(walls, nearest[None], axis=0)[0].astype(np.float64))
    ways: tuple[tuple[str, str, Any], ...] = (
        ("by tile", "tile", floor), ("by pixel", "pixel", floor), ("no depth", "tile", None),
    )  # fmt: skip
    for name, mode, wall in ways:
        yield Way(name, partial(alpha, mode, wall), off)
