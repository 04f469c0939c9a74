"""The texture of flakes: a spectrum with the phases of flakes, moved layer by layer."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _contract as check
from flurries import _core
from flurries._contract import LARGEST, MOST_ELEMENTS, OVERLAP, Array, ArrayLike, Float64
from flurries.spectral.tiles import starts

# Larger flakes are drawn one by one: in a texture they would cost a second each.
_LARGEST_FLAKE = 1000.0

_MOST_SHEAR = 1.0  # A torus that is sheared by a whole tile is the straight one.
_MOST_GAIN = 1e30  # Products of gains and patterns stay finite in float32.
_MOST_TERMS = 2**26  # Some gigabytes of what tiles choose.


class Request(NamedTuple):
    """A frame as the kernel reads it; arrays of tiles begin (1, 1) where all are alike."""

    overlap: int
    shear: float
    pattern: npt.NDArray[np.int32]  # (rows, cols, L): pattern p of layer l is number l P + p.
    # (rows, cols, L, 2) px: of torus and displacement together, and while the shutter is open.
    shift: Float64
    streak: Float64 | None
    gain: Float64  # (L,), of patterns without their mean.
    mean: float  # Of the optical depth.


def flake_patterns(
    tile: int, *, counts: ArrayLike, diameters: ArrayLike, opacity: float = 0.9,
    patterns: int = 8, shear: float = 0.0, seed: int, dtype: npt.DTypeLike = np.complex64,
) -> Array:  # fmt: skip
    """Spectra (L, P, M, M // 2 + 1) of flakes at random places, for the layers of a texture.

    They are Fourier coefficients, unnormalised, in the order of ``numpy.fft.rfft2``, complex64 or
    complex128. The wave of row b and column a has ``(a, b - shear a) / M`` cycles/px, x right and y
    down. Waves of half a cycle are 0. Every ``[l, p, 0, 0]`` is the layer's mean coverage of a tile
    in square pixels, ``counts[l] * opacity * pi / 12 * (a^2 + a b + b^2)`` for diameters a to b.

    Parameters
    ----------
    tile, patterns : int
        M, size of a tile in pixels, and P, patterns of each layer.
    counts : (L,)
        Mean number of flakes in a tile of each layer; a pattern has the whole number beside it.
    diameters : (L, 2)
        Image diameters in pixels lie evenly between the two. A flake of diameter d is a Gaussian of
        deviation d / sqrt(8), at least 0.3 px, integral ``opacity pi d^2 / 4``; pixels are means.
    opacity : float
        Opacity in the middle of a flake, 0 to 1.
    shear : float
        h / M: the torus repeats at (M, 0) and (h, M) px, so that snow which falls straight down
        does not meet itself again. From -1 to 1; 0.382 is good.
    """
    (size, _), _ = check.tile_of(check.integer("tile", tile, low=1, high=2**15), 0)
    numbers = check.table("counts", counts, ndim=1)
    check.require("counts", numbers, (numbers >= 0.0) & (numbers <= 1e9), "from 0 to 1e9")
    sizes = check.table("diameters", diameters, ndim=2)
    if not numbers.size or sizes.shape != (numbers.size, 2):
        raise ValueError(
            f"diameters must be two for each of one or more counts, got {sizes.shape} for "
            f"{numbers.size} counts"
        )
    good = (sizes > 0.0) & (sizes <= _LARGEST_FLAKE) & (sizes[:, :1] <= sizes)
    wanted = f"above 0, at most {_LARGEST_FLAKE:g} px and the smaller one first"
    check.require("diameters", sizes, good, wanted)
    middle = check.real("opacity", opacity, low=0.0, high=1.0)
    number = check.integer("patterns", patterns, low=1, high=2**16)
    slant = check.real("shear", shear, low=-_MOST_SHEAR, high=_MOST_SHEAR)
    shape = (numbers.size, number, size, size // 2 + 1)
    if np.prod(shape, dtype=float) > MOST_ELEMENTS:
        raise ValueError(f"patterns must hold at most {MOST_ELEMENTS} waves, got {shape}")
    result = np.empty(shape, check.float_dtype(dtype, ("complex64", "complex128")))
    _core.flake_patterns(result, numbers, sizes, (slant, middle, check.seed_of(seed)))
    return result


def _spectra(value: object) -> Array:
    """Return patterns as C-contiguous complex64 or complex128."""
    array = check.rectangular("patterns", value)
    if array.dtype.kind not in "iufc" or array.dtype.itemsize > 16:
        raise TypeError(f"patterns must be an array of complex numbers, got {array.dtype}")
    wide = np.complex64 if array.dtype in (np.complex64, np.float32, np.float16) else np.complex128
    shape = array.shape
    fits = len(shape) == 4 and 0 not in shape and shape[3] == shape[2] // 2 + 1
    if not fits or shape[2] > 2**15:
        raise ValueError(f"patterns must be (L, P, M, M // 2 + 1), got {shape}")
    return check.aligned(array, wide)


def _vectors(name: str, value: object, layers: int, tiles: tuple[int, int]) -> Float64:
    """Return (rows or 1, cols or 1, L, 2)."""
    array = check.bounded(name, value)
    if array.shape == (layers, 2):
        return array.reshape(1, 1, layers, 2)
    if array.shape == (*tiles, layers, 2):
        return array
    raise ValueError(
        f"{name} must have shape ({layers}, 2) or ({tiles[0]}, {tiles[1]}, {layers}, 2), "
        f"got {array.shape}"
    )


def optical_depth(
    shape: tuple[int, int], patterns: ArrayLike, *, drift: ArrayLike,
    velocity: ArrayLike | None = None, shutter: float = 0.0, gain: ArrayLike | None = None,
    shear: float = 0.0, seed: int | None, overlap: int = OVERLAP, dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:  # fmt: skip
    """Optical depth (H, W) of layers of flakes, in overlapping tiles, 0 or more.

    ``1 - exp(-depth)`` is the joint opacity of the flakes. Tiles without their mean are blended by
    the power law, the mean is added, and what is below 0 is 0. The same bits for any number of
    threads.

    Parameters
    ----------
    patterns : (L, P, M, M // 2 + 1) complex
        Of :func:`flake_patterns`, with their `shear`. Waves of half a cycle are left out.
    drift : (L, 2) or (rows, cols, L, 2)
        Displacement (x, y), px, of each layer since time 0, for all or each of `tile_starts`.
    velocity, shutter : like `drift`, and float
        Its change per frame, and frames that the shutter is open, which needs it.
    gain : (L,), optional
        Factor of each layer; None is 1.
    seed : int or None
        Tiles take a pattern and a shift of the torus by a hash of (seed, layer, tile row, tile
        column). With None each takes pattern 0 as it is.
    overlap : int
        Pixels shared by neighbours, less than M.

    Examples
    --------
    >>> import flurries as fl
    >>> law = {"counts": [300, 900], "diameters": [[1.5, 2.5], [0.7, 1.5]], "shear": 0.382}
    >>> found = fl.spectral.flake_patterns(64, **law, seed=1)
    >>> depth = fl.spectral.optical_depth(
    ...     (480, 640), found, drift=[(0.0, 8.0), (0.0, 4.0)], shear=0.382, seed=7
    ... )
    >>> depth.shape, depth.dtype.name, bool(depth.min() >= 0.0)
    ((480, 640), 'float32', True)
    """
    size = check.shape_of("shape", shape)
    spectra = _spectra(patterns)
    layers, number, tile, _ = spectra.shape
    _, shared = check.tile_of(tile, overlap)
    rows, cols = (len(starts(length, tile, shared)) for length in size)
    if rows * cols * layers > _MOST_TERMS:
        raise ValueError(
            f"shape must take at most {_MOST_TERMS} tiles times layers, got {rows} x {cols} tiles "
            f"of {layers} layers"
        )
    drifts = _vectors("drift", drift, layers, (rows, cols))
    exposure = check.real("shutter", shutter, low=0.0, high=LARGEST)
    if velocity is None and exposure > 0.0:
        raise ValueError(f"velocity is needed for shutter={exposure:g}, got None")
    speeds = None if velocity is None else _vectors("velocity", velocity, layers, (rows, cols))
    streak = None if speeds is None or exposure == 0.0 else speeds * exposure
    gains = np.ones(layers) if gain is None else check.table("gain", gain, ndim=1)
    if gains.shape != (layers,) or np.abs(gains).max() > _MOST_GAIN:
        raise ValueError(
            f"gain must be {layers} numbers up to {_MOST_GAIN:g}, got {check._came(gain)}"
        )
    slant = check.real("shear", shear, low=-_MOST_SHEAR, high=_MOST_SHEAR)
    given = [spectra, drifts, gains, *([] if speeds is None else [speeds])]
    result = check.output(out, size, check.float_dtype(dtype), *given)
    if seed is None:
        pattern = (np.arange(layers, dtype=np.int32) * number).reshape(1, 1, -1)
        shift = drifts
    else:
        pattern, shift = np.empty((rows, cols, layers), np.int32), np.empty((rows, cols, layers, 2))
        _core.flake_choices(pattern, shift, check.seed_of(seed), number, tile)
        shift += drifts
    means = spectra[:, 0, 0, 0].real.astype(np.float64)
    mean = float(gains @ means) / tile**2
    asked = Request(shared, slant, pattern, shift, streak, gains, mean)
    _core.flake_frame(result, spectra.reshape(-1, *spectra.shape[2:]), asked)
    return result
