"""What can be made in several ways, how wrong each is, and the references: slow and independent.

The reference of the texture is the sum of waves in extended precision. It takes the table of hashed
phases from the package, since that is data, and nothing else.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import Camera, gas, particles, settings, spectral
from flurries import composite as mixing

Array = npt.NDArray[Any]


class Way(NamedTuple):
    """One way: its name, what is timed, and the error of what that makes."""

    setting: str
    make: Callable[[], Any]
    error: Callable[[Any], float]


class Axis(NamedTuple):
    """One thing that can be made in several ways: what varies, the error's unit, its reference."""

    name: str
    title: str
    unit: str
    reference: str
    ways: Callable[[], Iterator[Way]]


def axis(unit: str, reference: str) -> Callable[[Callable[[], Iterator[Way]]], Axis]:
    """Make an axis of a function that yields ways; its docstring is the title."""
    return lambda ways: Axis(
        ways.__name__, (ways.__doc__ or "").removesuffix("."), unit, reference, ways
    )


def largest(reference: Array) -> Callable[[Any], float]:
    """Return the largest difference from a reference as an error."""
    return lambda made: float(np.max(np.abs(np.asarray(made, reference.dtype) - reference)))


def rms(reference: Array) -> Callable[[Any], float]:
    """Return the root mean square difference from a reference as an error."""
    return lambda made: float(np.sqrt(np.mean(np.asarray(made - reference, reference.dtype) ** 2)))


def both(setting: str, make: Callable[..., Any], error: Callable[[Any], float]) -> Iterator[Way]:
    """Yield a way in float32 and in float64."""
    for kind in (np.float32, np.float64):
        yield Way(f"{setting}, {kind.__name__}", partial(make, dtype=kind), error)


Long = np.longdouble
HALF_TURN = np.arctan2(Long(0), Long(-1))

SIZE, BAND = 256, (4.0, 32.0)
DRIFT = np.array([37.25, 411.5])
TORUS = spectral.Texture(tile=SIZE, overlap=0)
frame: Callable[..., Array] = partial(spectral.field, (SIZE, SIZE), seed=7, texture=TORUS)


def amplitude(size: int, band: tuple[float, float]) -> tuple[Array, Array, Array]:
    """Return 1/|k| in the band, squares summing to 1, and (ky, kx) / |k|, in fftfreq order."""
    k = np.fft.fftfreq(size, 1.0 / size).astype(Long)
    ky, kx = np.meshgrid(k, k, indexing="ij")
    length = np.hypot(ky, kx)
    length[0, 0] = 1
    inside = (length * Long(band[0]) < size) & (length * Long(band[1]) >= size)
    inside[0, 0] = False
    share = inside / length
    return share / np.sqrt(np.sum(share**2)), ky / length, kx / length


def torus(size: int, seed: int, drift: Array, band: tuple[float, float] = BAND) -> Array:
    """Return a tile after a drift (x, y) px of the longest wave: the real part of its sum."""
    share, down, right = amplitude(size, band)
    moved = (Long(drift[0]) * right + Long(drift[1]) * down) / Long(band[1])
    turns = spectral.random_phase((size, size), seed=seed).astype(Long) - moved
    angle = 2 * HALF_TURN * (turns - np.floor(turns))
    spectrum = share * (np.cos(angle) + 1j * np.sin(angle))
    return np.asarray(np.fft.ifft2(spectrum, norm="forward").real)


@axis("in sigma, largest", "phases and transform in extended precision")
def precision() -> Iterator[Way]:
    """Precision, kernels and modes of the texture, one tile of 256 px."""
    off = largest(torus(SIZE, 7, DRIFT))
    fused = partial(frame, drift=DRIFT)
    yield from both("field", fused, off)
    yield from both("field, reproducible", partial(_reproducible, fused), off)
    yield from both("step by step", _steps, off)
    yield from both("plain NumPy", _plain, off)


def _reproducible(make: Any, dtype: Any) -> Any:
    with settings(reproducible=True):
        return make(dtype=dtype)


def _steps(dtype: Any) -> Array:
    shape = (SIZE, SIZE)
    phase = spectral.advance_phase(spectral.random_phase(shape, seed=7), DRIFT)
    return spectral.inverse_transform(spectral.band_amplitude(shape), phase, dtype=dtype)


def _plain(dtype: Any) -> Array:
    """Return a tile all in one precision, the phase too."""
    half = (slice(None), slice(SIZE // 2 + 1))
    share, down, right = (part[half].astype(dtype) for part in amplitude(SIZE, BAND))
    moved = (DRIFT[0].astype(dtype) * right + DRIFT[1].astype(dtype) * down) / dtype(BAND[1])
    start = spectral.random_phase((SIZE, SIZE), seed=7)[half]
    turns = (2 * np.pi * (start - moved)).astype(dtype)
    spectrum = share * (np.cos(turns) + 1j * np.sin(turns))
    whole = spectrum.astype(np.result_type(dtype, np.complex64))
    return np.fft.irfft2(whole, s=(SIZE, SIZE), norm="forward").astype(dtype)


@axis("in sigma, rms", "16 Gauss-Legendre nodes over the exposure")
def shutter() -> Iterator[Way]:
    """Shutter by sinc or by sub-frames, 256 x 256."""
    velocity = np.array([2.0, 8.0])
    # Waves turn by a quarter of a cycle at most: 16 nodes are exact to the last bits.
    nodes, weights = np.polynomial.legendre.leggauss(16)
    moments = (torus(SIZE, 7, DRIFT + velocity * n / 2) for n in nodes)
    off = rms(np.asarray(sum(w / 2 * one for w, one in zip(weights, moments, strict=True))))

    def parts(count: int) -> Array:
        total = np.zeros((SIZE, SIZE), np.float32)
        for at in (np.arange(count) + 0.5) / count - 0.5:
            total += frame(drift=DRIFT + velocity * at)
        return np.asarray(total / np.float32(count))

    blurred = spectral.Texture(tile=SIZE, overlap=0, shutter=1.0)
    yield from both("sinc", partial(frame, drift=DRIFT, velocity=velocity, texture=blurred), off)
    for count in (1, 2, 4, 8, 16, 64):
        yield Way(f"{count} sub-frames", partial(parts, count), off)


# The look: octaves, tile size, blending -----------------------------------------------------------

SHAPE = (512, 512)
LAGS = np.arange(1, 33)


def _way(setting: str, error: float, texture: spectral.Texture) -> Way:
    """Return a frame whose error does not depend on its pixels."""

    def make() -> Array:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            return spectral.field(SHAPE, drift=(3.0, 11.0), seed=3, texture=texture)

    return Way(setting, make, lambda _: error)


def continuum(low: float, high: float) -> Array:
    """Return the autocorrelation of a 1/f band of all directions: J0's mean over log frequency."""
    log_f = np.linspace(np.log(1.0 / high), np.log(1.0 / low), 2001)
    angle = (np.arange(256) + 0.5) * np.pi / 256.0
    across = 2.0 * np.pi * np.exp(log_f)[:, None] * np.cos(angle)
    bessel = np.array([np.cos(lag * across).mean(axis=1) for lag in LAGS])
    # The trapezoidal rule: the ends count half.
    return np.asarray((bessel[:, 1:] + bessel[:, :-1]).mean(axis=1) / 2.0)


def lattice(size: int, band: tuple[float, float]) -> Array:
    """Return the autocorrelation of a tile along x and along y: a sum over its waves."""
    along = np.asarray(amplitude(size, band)[0] ** 2, np.float64).sum(axis=0)
    return np.asarray(np.cos(2.0 * np.pi * np.outer(LAGS, np.fft.fftfreq(size))) @ along)


@axis("of the autocorrelation, rms", "the four-octave 1/f band in the continuum: an integral of J0")
def octaves() -> Iterator[Way]:
    """Octaves of waves, 512 x 512."""
    off = rms(continuum(2.0, 32.0))
    for count in (0.5, 1.0, 2.0, 3.0, 4.0):
        band = (32.0 / 2.0**count, 32.0)
        texture = spectral.Texture(tile=128, overlap=20, wavelengths=band)
        yield _way(f"{count:g} octaves, tile 128", off(lattice(128, band)), texture)


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


@axis("of opacity, mean", "the line integral through every particle at every pixel, float64")
def footprint() -> Iterator[Way]:
    """Footprints of gas, 300 particles, 320 x 240."""
    centers = np.random.default_rng(2).uniform(-2.5, 2.5, (300, 3))
    centers[:, 2] += 5.5
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
    rays, rim = _rays(GAS, LENS.focal), np.exp(-4.5)
    through = np.ones(GAS)
    for center in centers:
        along = rays @ center
        square = 9.0 * np.maximum(center @ center - along**2, 0.0) / radius**2
        g = np.maximum((np.exp(-0.5 * square) - rim) / (1.0 - rim), 0.0)
        through *= 1.0 - density * g * (along > 0.0)
    return 1.0 - through


def _rays(shape: tuple[int, int], focal: float) -> Array:
    """Return the unit ray through the middle of each pixel."""
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    rays = np.stack([(x - shape[1] / 2) / focal, (y - shape[0] / 2) / focal, np.ones(shape)], -1)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))
