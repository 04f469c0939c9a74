"""What tells falling snow from its imitations, as functions of pictures: pure NumPy."""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

# An opacity, (h, w): x goes right, y down.
Picture = npt.NDArray[np.float64]
Numbers = dict[str, float]
# From places (2, n) px, nearness (n,) 1/m and two times to places.
Flow = Callable[[Picture, Picture, float, float], Picture]

OCTAVES = 5
LEVELS = (50.0, 90.0, 99.0, 99.8)
BLOCK = 64


def euler(above: npt.NDArray[np.bool_]) -> float:
    """Return pieces minus holes of a picture, pixels that touch at corners joined."""
    padded = np.pad(above, 1)
    quads = [padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]]
    count = np.sum(quads, axis=0)
    diagonal = (count == 2) & (quads[0] == quads[3])
    return float(((count == 1).sum() - (count == 3).sum() - 2 * diagonal.sum()) / 4)


def numbers(picture: Picture) -> Numbers:
    """Return moments, power by octave (finest first), and Euler numbers above own percentiles."""
    away = picture - picture.mean()
    deviation = max(float(away.std()), 1e-300)
    found = {
        "mean": float(picture.mean()),
        "deviation": deviation,
        "skewness": float((away**3).mean()) / deviation**3,
        "kurtosis": float((away**4).mean()) / deviation**4,
    }
    power = np.abs(np.fft.fft2(away)) ** 2
    cycles = np.hypot(*np.meshgrid(*(np.fft.fftfreq(n) for n in picture.shape[::-1])))
    for n in range(OCTAVES):
        band = (cycles >= 0.5 / 2 ** (n + 1)) & (cycles < 0.5 / 2**n)
        found[f"octave {n + 1}"] = float(power[band].sum())
    for level, value in zip(LEVELS, np.percentile(picture, LEVELS), strict=True):
        found[f"Euler {level:g}"] = euler(picture > value)
    return found


def kept(first: Picture, later: Picture) -> float:
    return float(np.corrcoef(first.ravel(), later.ravel())[0, 1])


def gaussian(picture: Picture, seed: int) -> Picture:
    """Return a field with the spectrum, the mean and the deviation of a picture: no flakes."""
    noise = np.fft.fft2(np.random.default_rng(seed).standard_normal(picture.shape))
    spectrum = np.fft.fft2(picture - picture.mean())
    field = np.fft.ifft2(noise / np.abs(noise) * np.abs(spectrum)).real
    return np.clip(field + picture.mean(), 0.0, 1.0)


def slopes(picture: Picture, block: int = BLOCK) -> Picture:
    """Return the sums of gx gy, gx^2 and gy^2 over every whole block, (3, rows, cols)."""
    gy, gx = np.gradient(picture)
    rows, cols = (max(n // block, 1) for n in picture.shape)
    tall, wide = (min(block, n) for n in picture.shape)
    parts = np.stack([gx * gy, gx * gx, gy * gy])[:, : rows * tall, : cols * wide]
    return parts.reshape(3, rows, tall, cols, wide).sum(axis=(2, 4))


def direction(sums: Picture) -> Picture:
    """Return mean gx gy over the root of the means of gx^2 and gy^2, -1 to 1, of sums (3, ...)."""
    both, across, down = sums
    return np.asarray(both / np.maximum(np.sqrt(across * down), 1e-300))


def turned(ours: Picture, drawn: Picture, least: float = 0.1) -> float:
    """Return the share of blocks that lean the other way, of those where the drawn lean clearly."""
    clear = np.abs(drawn) >= least
    return float((ours * drawn < 0.0)[clear].mean()) if clear.any() else 0.0


def smoothed(picture: Picture) -> Picture:
    """Return means over 3 x 3 px by 1, 2, 1: a flake is as bright between pixels as on one."""
    padded = np.pad(picture, 1, mode="edge")
    rows = 0.25 * (padded[:-2] + padded[2:]) + 0.5 * padded[1:-1]
    return np.asarray(0.25 * (rows[:, :-2] + rows[:, 2:]) + 0.5 * rows[:, 1:-1])


def peaks(picture: Picture, level: float = 98.0) -> npt.NDArray[np.int64]:
    """Return the pixels (2, n), x and y, that are the highest of their 3 x 3 and above a level."""
    inner = picture[1:-1, 1:-1]
    top = inner > np.percentile(picture, level)
    height, width = picture.shape
    for y in range(3):
        for x in range(3):
            if (y, x) != (1, 1):
                top &= inner >= picture[y : height - 2 + y, x : width - 2 + x]
    y, x = np.nonzero(top)
    return np.stack([x, y]) + 1


def alive(
    film: Sequence[Picture], times: Sequence[float], flow: Flow, depths: tuple[float, float],
    corner: tuple[int, int] = (0, 0), guesses: int = 24,
) -> tuple[npt.NDArray[np.bool_], Picture]:  # fmt: skip
    """Follow bright peaks, each at the depth at which it is best followed.

    From frame to frame a peak is sought within a pixel of where the flow takes it from where it was
    last found: flakes sway, and fall at speeds of their own. It lives while it has half of its
    height over the median. `depths` (near, far) in metres are tried; `corner` (x, y) is that of the
    pictures, px.

    Returns whether each peak is there to the end, (n,), without those that may leave the picture,
    and where each began, as a share of the picture's height, (n,).
    """
    shown = [smoothed(picture) - np.median(picture) for picture in film]
    height, width = shown[0].shape
    start = peaks(shown[0])
    near = np.repeat(np.linspace(1.0 / depths[1], 1.0 / depths[0], guesses), start.shape[1])
    offset = np.array(corner, float)[:, None] + 0.5
    at = np.tile(start, guesses)
    room = np.array([[width - 3], [height - 3]])
    end = flow(at + offset, near, times[0], times[-1]) - offset
    stays = ((end >= 2.0) & (end <= room)).all(axis=0).reshape(guesses, -1).all(axis=0)
    whole = np.tile(stays, guesses)
    near, at = near[whole], at[:, whole].astype(np.float64)
    least = np.full(at.shape[1], np.inf)
    first = shown[0][tuple(start[::-1, stays])]
    around = np.array([(x, y) for y in (-1, 0, 1) for x in (-1, 0, 1)]).T
    for n in range(1, len(times)):
        at = flow(at + offset, near, times[n - 1], times[n]) - offset
        at = np.clip(at, 2.0, room)
        pixel = np.rint(at).astype(np.int64)
        tried = pixel[:, :, None] + around[:, None, :]
        values = shown[n][tried[1], tried[0]]
        best = values.argmax(axis=1)
        rows = np.arange(len(best))
        least = np.minimum(least, values[rows, best])
        # A pixel aside only where the peak is higher there than at the place itself.
        at = at + np.where(values[rows, best] > 1.02 * values[:, 4], around[:, best], 0)
    share = least.reshape(guesses, -1).max(axis=0) / first
    return share >= 0.5, start[1, stays] / height


def by_rows(lives: npt.NDArray[np.bool_], row: Picture, bands: int = 3) -> Picture:
    """Return the shares alive by bands of rows between the highest and the lowest peak."""
    edges = np.quantile(row, np.linspace(0.0, 1.0, bands + 1))
    own = np.clip(np.searchsorted(edges, row, side="right") - 1, 0, bands - 1)
    count = np.bincount(own, minlength=bands)
    return np.asarray(np.bincount(own, lives, minlength=bands) / np.maximum(count, 1))


def correlations(first: Picture, later: Picture, reach: tuple[int, int]) -> Picture:
    """Return the correlation of two pictures over shifts, (2 rows + 1, 2 cols + 1).

    `reach` is (rows, cols). The element [rows + y, cols + x] says how alike `first` is to `later`
    read y lower and x further right, over what both show.
    """
    parts = first - first.mean(), later - later.mean()
    size = [n + r for n, r in zip(first.shape, reach, strict=True)]
    spectra = [np.fft.rfft2(part, size) for part in parts]
    powers = [np.fft.rfft2(part**2, size) for part in parts]
    ones = np.fft.rfft2(np.ones(first.shape), size)

    def over(a: Picture, b: Picture) -> Picture:
        whole = np.fft.irfft2(a.conj() * b, size)
        rows, cols = (np.arange(-r, r + 1) for r in reach)
        return np.asarray(whole[np.ix_(rows, cols)])

    norm = over(powers[0], ones) * over(ones, powers[1])
    return over(spectra[0], spectra[1]) / np.sqrt(np.maximum(norm, 1e-300))


def largest(first: Picture, later: Picture, reach: int = 64) -> float:
    return float(correlations(first, later, (reach, reach)).max())


def repeated(picture: Picture, lobe: int = 40) -> float:
    """Return the largest correlation of a picture with itself, shifted beyond a flake's streak."""
    reach = picture.shape[0] // 2, picture.shape[1] // 2
    found = correlations(picture, picture, reach)
    y, x = np.meshgrid(*(np.arange(-r, r + 1) for r in reach), indexing="ij")
    return float(found[(np.abs(y) > lobe) | (np.abs(x) > lobe)].max())


def strangers(ours: np.ndarray, other: np.ndarray, *, whole: bool = True) -> int:
    """Return how many flakes of `ours`, or of both if `whole`, the other list has not there."""
    both, a, b = np.intersect1d(ours["id"], other["id"], return_indices=True)
    away = np.abs(ours["place"][a] - other["place"][b]).max(axis=1, initial=0.0) > 1e-9
    missing = len(ours) - len(both) + (len(other) - len(both) if whole else 0)
    return int(missing + away.sum())


def inside(flakes: np.ndarray, low: Sequence[float], high: Sequence[float]) -> np.ndarray:
    pixel = flakes["pixel"]
    return np.asarray(flakes[((pixel >= low) & (pixel < high)).all(axis=1)])


def motion_off(motion: Picture, now: np.ndarray, then: np.ndarray) -> float:
    """Return the largest error, px, of motions (n, 2) of the flakes of `now` that `then` has."""
    _, a, b = np.intersect1d(now["id"], then["id"], return_indices=True)
    if not len(a):
        return float("nan")
    return float(np.abs(motion[a] - (then["pixel"][b] - now["pixel"][a])).max())
