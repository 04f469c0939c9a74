"""Velocities measured on rendered frames: of a band of waves, and of single flakes.

Nothing here is told how fast anything should move. The places of the flakes are asked for only to
know which of them stand alone, and how deep they are; how they move is read off the pixels.
Shifts are (x, y) in pixels between two frames. A parallax is depth times motion, m px per frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import factorial
from typing import Any

import numpy as np
from numpy.polynomial.hermite_e import hermegauss, hermeval
from numpy.typing import NDArray
from scipy.special import j0

import flurries as fl
from flurries.camera import Camera
from flurries.frame.bands import whole
from flurries.frame.truth import truth

Floats = NDArray[np.float64]
Times = Sequence[tuple[float, float]]

SIZE, NEAR, LONGEST = 512, 12.0, 32.0
FOCAL = 1.2 * SIZE
BOTH = {"haze": 0.0, "shutter": 0.0, "color": 1.0, "near_depth": NEAR}
# A map that only clips beyond 3 sigma, and flakes of some pixels: the middle of a smaller one's
# light is no clearer than its pixels.
TEXTURE = {**BOTH, "flakes": 0, "texture": 1.0, "mean": 0.5, "spread": 3.0, "power": 1.0,
           "wavelengths": (4.0, LONGEST)}  # fmt: skip
FLAKES = {**BOTH, "texture": 0.0, "flakes": 60, "sway": (0.0, 0.0), "flake_opacity": 1.0,
          "flake_size": (0.1, 0.1)}  # fmt: skip
# One tile: the picture is a torus, whose Fourier bins are the waves themselves.
TORUS = {"tile": SIZE, "overlap": 0}
# Waves that stand for 16, 32 and 64 m.
WAVES = (24.0, 12.0, 6.0)

# A window of this many pixels on each side holds a flake in both frames of a pair; another flake
# within ALONE pixels of it might come into the window.
REACH, ALONE = 12, 36.0

# Frames apart, to tell a jump from a motion: each half of the one before.
STEPS = (0.04, 0.02, 0.01)


def scene(snow: fl.effects.TentSnow | dict[str, Any], size: int = SIZE, **about: Any) -> fl.Scene:
    """Snow on black: a channel of the composite is the snow's own opacity."""
    black = np.zeros((size, size, 3), np.float32)
    effect = fl.effects.TentSnow(**snow) if isinstance(snow, dict) else snow
    return fl.Scene(background=black, effects=[effect], **about)


def picture(shown: fl.Scene, t: float, **options: Any) -> Floats:
    return shown.render(t, **options)[..., 0].astype(np.float64)


def cover(shown: fl.Scene, t: float) -> NDArray[np.float32]:
    """The opacity of all layers, without their motion and depth, which take as long again."""
    (seen,) = truth(shown.program, shown.time_of(t), [None], whole(shown.shape), known=False)
    return seen.alpha


def band_shift(
    pairs: Sequence[tuple[Floats, Floats]], wavelength: float, width: float, *, window: bool = False
) -> tuple[Floats, float]:
    """How far a band of waves moves between the pictures of a pair, and its mean wavelength.

    Least squares of the phase steps against the frequencies of the bins within the share `width`
    of the wavelength, weighted by their power; the spectra of several pairs are averaged first. As
    a wave's speed goes with its wavelength, the fit stands for one of sum(p f)/sum(p f^2) px.
    The `window` cuts a part out of a larger picture; a torus needs none.
    """
    images = np.array(pairs) - np.mean(pairs, axis=(2, 3), keepdims=True)
    height, across = images.shape[2:]
    if window:
        hann = [np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2 for n in (height, across)]
        images *= np.outer(*hann)
    first, second = np.fft.rfft2(images).transpose(1, 0, 2, 3)
    fy = np.fft.fftfreq(height)[:, None] + np.zeros(across // 2 + 1)
    fx = np.fft.rfftfreq(across) + np.zeros((height, 1))
    # The column fx = 0 stores both bins of a mirrored pair, all others one: count each pair once.
    ring = (abs(np.hypot(fx, fy) * wavelength - 1.0) < width) & ((fx > 0.0) | (fy > 0.0))
    step = -np.angle((second * first.conj()).sum(axis=0)[ring]) / (2.0 * np.pi)
    power = (abs(first) ** 2).sum(axis=0)[ring]
    f = np.stack([fx[ring], fy[ring]])
    length = np.hypot(*f)
    moved = np.linalg.solve((power * f) @ f.T, (power * f) @ step)
    return moved, float(np.sum(power * length) / np.sum(power * length**2))


def centroid(image: Floats, start: Floats) -> Floats:
    """Where the light near `start` has its middle; the window follows what it finds."""
    at, offset = np.array(start), np.arange(-REACH, REACH + 1) + 0.5
    for _ in range(10):
        col, row = np.floor(at).astype(int)
        crop = image[row - REACH : row + REACH + 1, col - REACH : col + REACH + 1]
        light = crop.sum(axis=0) @ offset, crop.sum(axis=1) @ offset
        at = np.array(light) / crop.sum() + (col, row)
    return at


def on_screen(points: Floats, camera: Camera) -> Floats:
    """(n, 2) pixels of points in camera axes; none of them may lie in the plane of the eye."""
    return points[:, :2] * (camera.focal / points[:, 2:]) + camera.principal((SIZE, SIZE))


def lone(px: Floats) -> NDArray[np.bool_]:
    """Which points of the screen have room enough for a window that follows them."""
    apart = np.hypot(*(px[:, None] - px).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    return (apart.min(axis=1) > ALONE) & (np.minimum(px, SIZE - px).min(axis=1) > 2.0 * REACH)


def lone_flakes(shown: fl.Scene, t: float) -> NDArray[Any]:
    """The drawn flakes that stand alone, and not near the ends of their air, where they fade."""
    flakes, near = fl.flakes(shown, t), shown.effects[0].near_depth
    inside = (flakes["depth"] > 0.25 * near) & (flakes["depth"] < 0.85 * near)
    return flakes[lone(flakes["pixel"]) & inside]


def flake_shifts(shown: fl.Scene, t: float, step: float, eye: Any = None) -> Floats:
    """Rows (depth, x, y, dx, dy), half-way, of the lone flakes on the frames at t and t + step.

    With an `eye` the second frame is what that one sees.
    """
    first, second = picture(shown, t), picture(shown, t + step, eye=eye)
    start, later = lone_flakes(shown, t), fl.flakes(shown, t + step)
    _, here, there = np.intersect1d(start["id"], later["id"], return_indices=True)
    rows = []
    for at, one, other in zip(start["pixel"][here], start[here], later[there], strict=True):
        a = centroid(first, at)
        b = centroid(second, a)
        rows.append([0.5 * (one["depth"] + other["depth"]), *(a + b) / 2, *b - a])
    return np.array(rows)


def against(measured: Any, wanted: Any) -> tuple[float, float]:
    """Length of one vector over that of another, and the angle between them in degrees."""
    (ax, ay), (bx, by) = measured, wanted
    turn = np.arctan2(bx * ay - by * ax, ax * bx + ay * by)
    return float(np.hypot(ax, ay) / np.hypot(bx, by)), float(np.degrees(turn))


# A camera that stands still --------------------------------------------------------------------


def parallax(pair: tuple[Floats, Floats]) -> Floats:
    """(3, 2): of the bands WAVES, m px."""
    bands = [band_shift([pair], wavelength, 0.04) for wavelength in WAVES]
    return np.array([moved * NEAR * LONGEST / mean for moved, mean in bands])


def parallax_of_bands(options: dict[str, Any], times: Times, **about: Any) -> Floats:
    """(n, 2): of the bands WAVES, for every pair of times."""
    shown = scene({**TEXTURE, **TORUS, **options}, **about)
    return np.concatenate(
        [parallax((picture(shown, a), picture(shown, b))) / (b - a) for a, b in times]
    )


def parallax_of_flakes(options: dict[str, Any], times: Times, **about: Any) -> Floats:
    """(n, 2): of every lone flake, for every pair of times."""
    shown = scene({**FLAKES, **options}, **about)
    rows = [(row, b - a) for a, b in times for row in flake_shifts(shown, a, b - a)]
    return np.array([row[3:] * row[0] / step for row, step in rows])


def tracked(points: Floats, velocity: Floats, step: float) -> Floats:
    """(n, 2): shifts per frame of flakes drawn by the kernel alone, of 1.2 px sigma."""
    radius = 3.6 * points[:, 2] / FOCAL
    first, second = (
        fl.particles.splat((SIZE, SIZE), p, radius, Camera(FOCAL), opacity=0.9, dtype=np.float64)
        for p in (points, points + velocity * step)
    )
    start = [centroid(first, at) for at in on_screen(points, Camera(FOCAL))]
    return np.array([centroid(second, at) - at for at in start]) / step


# A camera that flies ---------------------------------------------------------------------------


def flow_of_flakes(options: dict[str, Any], path: fl.CameraPath, t: float, step: float) -> Floats:
    """(3,): s, bx, by of the fit depth * (dx, dy) = s (x, y) + (bx, by) per frame.

    (x, y) from the principal point. The flow of a camera that does not turn has this form.
    """
    shown = [scene({**FLAKES, **options}, camera=path, seed=seed) for seed in range(8)]
    rows = np.concatenate([flake_shifts(one, t, step) for one in shown])
    x, y = (rows[:, 1:3] - path.camera.principal((SIZE, SIZE))).T
    one, none = np.ones_like(x), np.zeros_like(x)
    system = np.concatenate([np.stack([x, one, none], axis=1), np.stack([y, none, one], axis=1)])
    return np.linalg.lstsq(system, (rows[:, 3:] * rows[:, :1] / step).T.ravel(), rcond=None)[0]


def tiles(
    options: dict[str, Any], path: fl.CameraPath, t: float, step: float, waves: Sequence[float]
) -> Iterator[tuple[Floats, Floats]]:
    """Of tiles of 64 px: the centre in the picture, and the parallax of each of the bands."""
    options = {**TEXTURE, "tile": 64, **options}
    shown = [scene(options, camera=path, seed=seed) for seed in range(16)]
    pairs = [(picture(one, t), picture(one, t + step)) for one in shown]
    # A camera that goes forward mixes tiles by a half.
    given = options.get("overlap")
    overlap = 32 if given is None else given
    starts = [s for s in fl.spectral.tile_starts(SIZE, tile=64, overlap=overlap) if s <= SIZE - 64]
    # Of tiles that share a half with the next, every second one is enough.
    starts = starts[:: 2 if overlap > 20 else 1]
    for top, left in ((top, left) for top in starts for left in starts):
        part = np.s_[top : top + 64, left : left + 64]
        crops = [(first[part], second[part]) for first, second in pairs]
        for wavelength in waves:
            moved, mean = band_shift(crops, wavelength, 0.15, window=True)
            yield np.array([left + 32.0, top + 32.0]), moved / step * NEAR * LONGEST / mean


# A film ---------------------------------------------------------------------------------------


def kept(snow: fl.effects.TentSnow, times: Floats) -> float:
    """Deviation of the mean of frames over that of one, were there waves in every direction.

    A wave that moves at an angle beta has the rate c cos(beta), so that the field's likeness after
    s frames is J0(2 pi c s); that of its opacity follows from the map's Hermite series.
    """
    speed = np.hypot(snow.wind[0], snow.wind[1] + snow.fall) / 30.0 * FOCAL / snow.near_depth
    cycles = speed / snow.parts.texture.field.band((SIZE, SIZE))[1]
    likeness = j0(2.0 * np.pi * cycles * (times[:, None] - times))
    z, weight = hermegauss(200)
    mapped = weight / weight.sum() * np.clip(snow.mean + z / (2.0 * snow.spread), 0, 1) ** 2
    parts = [(mapped @ hermeval(z, [0.0] * n + [1.0])) ** 2 / factorial(n) for n in range(1, 25)]
    mean = sum(part * (likeness**n).mean() for n, part in enumerate(parts, 1))
    return float(np.sqrt(mean / sum(parts)))


def stood(snow: fl.effects.TentSnow, times: Floats) -> float:
    """The same, measured on frames."""
    frames = np.array([picture(scene(snow), t) for t in times])
    return float(frames.mean(axis=0).std() / frames.std(axis=(1, 2)).mean())


def largest_changes(
    frame: Callable[[float], Floats], times: Floats, steps: Sequence[float] = STEPS
) -> Floats:
    """Per step, the largest change of a pixel within it, from any of the times on."""
    changes = [[abs(frame(t + step) - now).max() for step in steps]
               for t, now in ((t, frame(t)) for t in times)]  # fmt: skip
    return np.max(changes, axis=0)


def smooth(changes: Floats) -> bool:
    """Whether half the step makes half the change; a jump is as large in any step."""
    return all(after < 0.65 * before for before, after in pairwise(changes))
