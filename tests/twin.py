"""The slow twin: `fl.spectral` and `fl.camera` in plain float64 NumPy, written from the equations.

It shares no code with the fast kernels and never imports `flurries`; all is spelled out by wave and
by tile. Arrays are [row, column] = [y, x], spectra stand in fftfreq order, phases and rates are in
cycles, and pairs of numbers are (x, y).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Shape = tuple[int, int]


def signed(length: int) -> NDArray[np.int64]:
    """Signed wave numbers k in fftfreq order; an even length stores Nyquist as -length/2."""
    k = np.arange(length)
    return np.where(2 * k < length, k, k - length)


def wave_numbers(shape: Shape) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(ky, kx), each of the full shape."""
    ky, kx = np.meshgrid(signed(shape[0]), signed(shape[1]), indexing="ij")
    return ky, kx


def frequencies(shape: Shape) -> tuple[Floats, Floats]:
    """(fy, fx) in cycles per pixel: (ky/H, kx/W)."""
    ky, kx = wave_numbers(shape)
    return ky / shape[0], kx / shape[1]


def mirror(spectrum: NDArray) -> NDArray:
    """The value at -k, for every k."""
    return np.roll(np.flip(spectrum), 1, axis=(0, 1))


def reduced(cycles: ArrayLike) -> Floats:
    """Cycles reduced to [-1/2, 1/2)."""
    cycles = np.asarray(cycles, dtype=np.float64)
    return cycles - np.floor(cycles + 0.5)


def mix64(z: ArrayLike) -> NDArray[np.uint64]:
    """The finaliser of SplitMix64, modulo 2^64; mix64(0) = 0xE220A8397B1DCDAF."""
    z = np.atleast_1d(np.asarray(z, dtype=np.uint64))
    z = z + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


def hashed(*words: int | NDArray[np.int64]) -> NDArray[np.uint64]:
    """h = 0; for each word, an int64 in two's complement: h = mix64(h XOR word)."""
    h = np.zeros(1, dtype=np.uint64)
    for word in words:
        h = mix64(h ^ np.asarray(word, dtype=np.int64).astype(np.uint64))
    return h


def unit(h: NDArray[np.uint64]) -> Floats:
    """u = (h >> 11) * 2^-53 in [0, 1)."""
    return (h >> np.uint64(11)).astype(np.float64) * 2.0**-53


def self_conjugate(shape: Shape) -> NDArray[np.bool_]:
    """Bins that are their own mirror: dc, and for even sizes the corners."""
    ky, kx = wave_numbers(shape)
    return (2 * ky % shape[0] == 0) & (2 * kx % shape[1] == 0)


def leaders(shape: Shape) -> NDArray[np.bool_]:
    """The one of each pair (k, -k) that owns the random number."""
    ky, kx = wave_numbers(shape)
    own_mirror_in_x = 2 * kx % shape[1] == 0
    return np.where(own_mirror_in_x, ky > 0, kx > 0) & ~self_conjugate(shape)


def random_phase(shape: Shape, *, seed: int, tile: tuple[int, int] = (0, 0)) -> Floats:
    """U, or u - 1 from 1/2 on, odd in k."""
    ky, kx = wave_numbers(shape)
    h = hashed(seed, *tile, ky, kx)
    u = unit(h)
    phase = np.where(u >= 0.5, u - 1.0, u)
    own = np.where(h >> np.uint64(63) == 1, -0.5, 0.0)
    phase = np.where(leaders(shape), phase, reduced(-mirror(phase)))
    return np.where(self_conjugate(shape), own, phase)


def without_nyquist(shape: Shape) -> tuple[Floats, Floats]:
    """(fy, fx) with each axis' component zero on its own Nyquist line, so that rates are odd."""
    (ky, kx), (fy, fx) = wave_numbers(shape), frequencies(shape)
    return np.where(2 * ky == -shape[0], 0.0, fy), np.where(2 * kx == -shape[1], 0.0, fx)


def directions(shape: Shape) -> tuple[Floats, Floats]:
    """(uy, ux) = f/|f|, zero at dc, with the Nyquist rule applied to the numerator."""
    (ny, nx), (fy, fx) = without_nyquist(shape), frequencies(shape)
    length = np.sqrt(fy * fy + fx * fx)
    length[0, 0] = np.inf
    return ny / length, nx / length


def jittered_directions(shape: Shape, seed: int, tile: tuple[int, int]) -> tuple[Floats, Floats]:
    """The direction of a random point of the bin's cell, odd in k."""
    ky, kx = wave_numbers(shape)
    y = (ky + unit(hashed(seed, *tile, ky, kx, 2)) - 0.5) / shape[0]
    x = (kx + unit(hashed(seed, *tile, ky, kx, 1)) - 0.5) / shape[1]
    length = np.sqrt(y * y + x * x)
    lead, own = leaders(shape), self_conjugate(shape)
    uy, ux = (np.where(lead, v / length, -mirror(v / length)) for v in (y, x))
    return np.where(own, 0.0, uy), np.where(own, 0.0, ux)


def tent_rate(shape: Shape, velocity: ArrayLike, *, wavelength_max: float = 32.0) -> Floats:
    """rate = -(a kx' + b ky')/|k'|, where (a, b) = velocity/wavelength_max in cycles per frame."""
    return _tent(directions(shape), np.asarray(velocity, dtype=np.float64), wavelength_max)


def _tent(unit_vectors: tuple[Floats, Floats], drift: Floats, wavelength_max: float) -> Floats:
    """The tent for a drift that is (2,), or (H, W, 2) where waves differ (rings)."""
    a, b = drift[..., 0] / wavelength_max, drift[..., 1] / wavelength_max
    uy, ux = unit_vectors
    return -(a * ux + b * uy)


def plane_rate(shape: Shape, shift: ArrayLike) -> Floats:
    """All waves move alike, phase -= fx*px + fy*py."""
    (ny, nx), (px, py) = without_nyquist(shape), np.asarray(shift, dtype=np.float64)
    return -(nx * px + ny * py)


def advance_phase(
    phase: ArrayLike, drift: ArrayLike, *, shift: ArrayLike = (0.0, 0.0),
    wavelength_max: float = 32.0,
) -> Floats:  # fmt: skip
    """Sections 1 and 3: phases *add*; the finished phase is reduced, never the drift."""
    phase = np.asarray(phase, dtype=np.float64)
    tent = tent_rate(phase.shape, drift, wavelength_max=wavelength_max)
    return reduced(phase + tent + plane_rate(phase.shape, shift))


@lru_cache(maxsize=256)
def longer_than(shape: Shape, wavelength: float) -> NDArray[np.bool_]:
    """Waves with lambda > wavelength, in exact integers: |k|^2 lam^2 < M^2; dc counts as longer."""
    height, width = shape
    top, bottom = float(wavelength).as_integer_ratio()
    ky, kx = (k.astype(object) for k in wave_numbers(shape))
    k2 = (ky * width) ** 2 + (kx * height) ** 2
    return (k2 * top**2 < (height * width * bottom) ** 2).astype(bool)


def band(shape: Shape, wavelengths: tuple[float, float]) -> NDArray[np.bool_]:
    """lam_min < lambda <= lam_max."""
    return longer_than(shape, wavelengths[0]) & ~longer_than(shape, wavelengths[1])


def band_amplitude(
    shape: Shape, *, wavelengths: tuple[float, float] = (4.0, 32.0), exponent: float = 1.0
) -> Floats:
    """1/|f|^exponent in the band, divided by the root of the sum of squares over all bins."""
    fy, fx = frequencies(shape)
    inside = band(shape, wavelengths)
    amplitude = np.zeros(shape)
    amplitude[inside] = np.hypot(fy, fx)[inside] ** -exponent
    return amplitude / np.sqrt(np.sum(amplitude**2))


def temporal_filter(
    amplitude: ArrayLike, velocity: ArrayLike, *, shift_rate: ArrayLike = (0.0, 0.0),
    alias: str = "cut", soft_from: float = 0.4, shutter: float = 0.0, renormalise: bool = False,
    wavelength_max: float = 32.0,
) -> Floats:  # fmt: skip
    """The cut, then (on request) the input's power again, then the box shutter."""
    amplitude = np.asarray(amplitude, dtype=np.float64)
    rate = tent_rate(amplitude.shape, velocity, wavelength_max=wavelength_max)
    rate = rate + plane_rate(amplitude.shape, shift_rate)
    kept = without_aliases(amplitude, rate, alias, soft_from)
    if renormalise and np.any(kept):
        kept = kept * np.sqrt(np.sum(amplitude**2) / np.sum(kept**2))
    return kept * np.sinc(rate * shutter)


def without_aliases(amplitude: Floats, rate: Floats, alias: str, soft_from: float) -> Floats:
    """Drop |rate| >= 1/2 - 1e-12; "soft" rolls off by cos^2 from `soft_from` on; "keep" keeps."""
    if alias == "keep":
        return amplitude
    gain = np.where(np.abs(rate) >= 0.5 - 1e-12, 0.0, 1.0)
    if alias == "soft":
        along = np.clip((np.abs(rate) - soft_from) / (0.5 - soft_from), 0.0, 1.0)
        gain = gain * np.cos(np.pi / 2 * along) ** 2
    return amplitude * gain


def direct_sum(amplitude: ArrayLike, phase: ArrayLike) -> Floats:
    """z(x, y) = sum_k amplitude cos 2 pi (fx x + fy y + phase); k x is taken modulo the tile."""
    amplitude, phase = np.asarray(amplitude, np.float64), np.asarray(phase, np.float64)
    height, width = amplitude.shape
    ky, kx = wave_numbers((height, width))
    y, x = np.mgrid[:height, :width]
    total = np.zeros((height, width))
    for bin_ in map(tuple, np.argwhere(amplitude != 0.0)):
        turns = ky[bin_] * y % height / height + kx[bin_] * x % width / width + phase[bin_]
        total += amplitude[bin_] * np.cos(2.0 * np.pi * turns)
    return total


def inverse_transform(amplitude: ArrayLike, phase: ArrayLike) -> Floats:
    """The same sum by the unnormalised inverse FFT; its real part is the Hermitian part."""
    amplitude, phase = np.asarray(amplitude, np.float64), np.asarray(phase, np.float64)
    spectrum = amplitude * np.exp(2j * np.pi * phase)
    return np.fft.ifft2(spectrum, norm="forward").real


def opacity(
    field: ArrayLike, *, mean: float = 0.5, spread: float = 3.0, power: float = 2.0,
    amount: float = 1.0,
) -> Floats:  # fmt: skip
    """amount * clip(mean + z/(2 spread), 0, 1)^power."""
    z = np.asarray(field, dtype=np.float64)
    return amount * np.clip(mean + z / (2.0 * spread), 0.0, 1.0) ** power


def tile_starts(length: int, *, tile: int = 64, overlap: int = 10) -> NDArray[np.int64]:
    """Starts 0, s, 2s, ... with s = tile - overlap, until the picture is covered."""
    step = tile - overlap
    count = 1 if length <= tile else -((tile - length) // step) + 1
    return np.arange(count) * step


def ramp(tile: int, overlap: int) -> Floats:
    """r_i = min(1, (i + 1/2)/v, (M - i - 1/2)/v); all ones when v = 0."""
    i = np.arange(tile)
    if overlap == 0:
        return np.ones(tile)
    return np.minimum(1.0, np.minimum((i + 0.5) / overlap, (tile - i - 0.5) / overlap))


def axis_weights(length: int, tile: int, overlap: int, blend: str) -> Floats:
    """(tiles, tile) weights: w over the sum of w of all whole tiles there, "power" rooted."""
    starts = tile_starts(length, tile=tile, overlap=overlap)
    weight = ramp(tile, overlap)
    if blend == "power":
        weight = np.sin(np.pi / 2 * weight) ** 2
    total = np.zeros(starts[-1] + tile)
    for start in starts:
        total[start : start + tile] += weight
    share = np.stack([weight / total[start : start + tile] for start in starts])
    return np.sqrt(share) if blend == "power" else share


def blend_tiles(
    tiles: ArrayLike, shape: Shape, *, overlap: int = 10, blend: str = "power"
) -> Floats:
    """(rows, cols, Mh, Mw) -> (H, W); the 2-D weight is the product; the last tiles are cropped."""
    tiles = np.asarray(tiles, dtype=np.float64)
    height, width = tiles.shape[2:]
    down = axis_weights(shape[0], height, overlap, blend)
    across = axis_weights(shape[1], width, overlap, blend)
    top = tile_starts(shape[0], tile=height, overlap=overlap)
    left = tile_starts(shape[1], tile=width, overlap=overlap)
    picture = np.zeros((top[-1] + height, left[-1] + width))
    for row, y in enumerate(top):
        for col, x in enumerate(left):
            weight = down[row][:, None] * across[col][None, :]
            picture[y : y + height, x : x + width] += weight * tiles[row, col]
    return picture[: shape[0], : shape[1]]


def ring_of(shape: Shape, ring_edges: ArrayLike) -> NDArray[np.int64]:
    """Ring r holds edges[r] < lambda <= edges[r+1]; the rest join the end rings."""
    inner = np.asarray(ring_edges, dtype=np.float64)[1:-1]
    ring = np.zeros(shape, dtype=np.int64)
    for edge in inner:
        ring += longer_than(shape, float(edge))
    return ring


def of_tile(value: ArrayLike, row: int, col: int, rings: NDArray[np.int64] | None) -> Floats:
    """One tile's (2,) of a (2,) or (rows, cols, 2), or its (H, W, 2) where rings differ."""
    value = np.asarray(value, dtype=np.float64)
    by_ring = rings is not None and value.ndim in (2, 4)
    if value.ndim - by_ring == 3:
        value = value[row, col]
    return value[rings] if by_ring else value


def field(
    shape: Shape, *, drift: ArrayLike, shift: ArrayLike = (0.0, 0.0), seed: int,
    tile: int | Shape = 64, overlap: int = 10, wavelengths: tuple[float, float] = (4.0, 32.0),
    exponent: float = 1.0, velocity: ArrayLike | None = None, shift_rate: ArrayLike | None = None,
    alias: str = "keep", soft_from: float = 0.4, shutter: float = 0.0, jitter: bool = False,
    shortest: ArrayLike | None = None, blend: str = "power", ring_edges: ArrayLike | None = None,
    ring_gains: ArrayLike | None = None,
) -> Floats:  # fmt: skip
    """One frame, tile by tile."""
    size = (tile, tile) if isinstance(tile, int) else tile
    rows = len(tile_starts(shape[0], tile=size[0], overlap=overlap))
    cols = len(tile_starts(shape[1], tile=size[1], overlap=overlap))
    longest = wavelengths[1]
    rings = None if ring_edges is None else ring_of(size, ring_edges)
    base = band_amplitude(size, wavelengths=wavelengths, exponent=exponent)
    if ring_gains is not None:
        base = base * np.asarray(ring_gains, dtype=np.float64)[rings]
        base = base / np.sqrt(np.sum(base**2))
    tiles = np.zeros((rows, cols, *size))
    for row, col in np.ndindex(rows, cols):
        where = directions(size)
        if jitter:
            where = jittered_directions(size, seed, (row, col))
        moved = _tent(where, of_tile(drift, row, col, rings), longest)
        moved = moved + plane_rate(size, of_tile(shift, row, col, None))
        phase = reduced(random_phase(size, seed=seed, tile=(row, col)) + moved)
        amplitude = base
        if shortest is not None:
            amplitude = amplitude * longer_than(size, float(np.asarray(shortest)[row, col]))
        if velocity is not None:
            rate = _tent(where, of_tile(velocity, row, col, rings), longest)
            if shift_rate is not None:
                rate = rate + plane_rate(size, of_tile(shift_rate, row, col, None))
            amplitude = without_aliases(amplitude, rate, alias, soft_from)
            amplitude = amplitude * np.sinc(rate * shutter)
        tiles[row, col] = inverse_transform(amplitude, phase)
    return blend_tiles(tiles, shape, overlap=overlap, blend=blend)
