"""Falling flakes in plain NumPy and float64, all of them drawn one by one: the judge of the engine.

Nothing of the package is used here. Flakes fill the air as a Poisson process, by the laws of
`twin_law`, each with its own size and speed. A flake is at place + t (wind + fall) + a (sin(w t +
p1), 0, sin(w t + p2)).

The air is cut into cubes for classes of size, whose flakes fall at nearly one speed, so that a film
makes only the cubes that it sees. A cube's flakes come from its own random numbers: another window,
or another time, shows the same flakes.

Flakes are round here. The shapes of near flakes have no twin: compare what is drawn round.
"""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from twin_footprints import Canvas, Floats, Ints
from twin_law import Law

# Flakes of a cube, about; and its sides in metres, at least and at most.
_IN_CUBE, _SIDES = 100_000, (2.5, 15.0)


@dataclass(frozen=True, kw_only=True)
class View:
    """A camera with its way, and the air that it sees."""

    size: tuple[int, int]  # (width, height), px.
    focal: float  # Pixels.
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m/s, x right, y down, z forward.
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spin: float = 0.0  # Radians a second, to the right.
    zoom: float = 0.0  # Growth of the logarithm of the focal length a second.
    sway: tuple[float, float] = (0.0, 0.0)  # (amplitude, rate): metres, radians a second.
    shutter: float = 0.5  # Frames.
    fps: float = 30.0

    def matrix(self, t: float) -> Floats:
        """Return the matrix from the camera's axes at frame t to the house's."""
        angle = self.spin * t / self.fps
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])

    def grown(self, t: float) -> float:
        return self.focal * math.exp(self.zoom * t / self.fps)

    def project(self, places: Floats, t: float) -> tuple[Floats, Floats]:
        eye = np.array(self.velocity) * (t / self.fps)
        local = self.matrix(t).T @ (places - eye[:, None])
        with np.errstate(divide="ignore", invalid="ignore"):
            pixel = self.grown(t) * local[:2] / local[2]
        return pixel + 0.5 * np.array(self.size)[:, None], local[2]

    def carried(self, fall: Floats, t: float) -> Floats:
        x, y, z = np.array(self.wind) * (t / self.fps)
        way = y + fall * (t / self.fps)
        return np.stack([np.full_like(way, x), way, np.full_like(way, z)])

    def swing(self, phases: Floats, t: float) -> Floats:
        amplitude, rate = self.sway
        across, along = amplitude * np.sin(rate * t / self.fps + phases)
        return np.stack([across, np.zeros_like(across), along])


def film(
    law: Law, view: View, times: Sequence[float], seed: int,
    window: tuple[int, int, int, int] | None = None,
) -> Floats:  # fmt: skip
    """Return the opacity of all flakes at frames, (len(times), h, w), of a window or all pixels."""
    top, bottom, left, right = window or (0, view.size[1], 0, view.size[0])
    shape = bottom - top, right - left
    canvases = [Canvas(shape, law.opacity, seed) for _ in times]
    corner = np.array([left, top], float)
    edges = classes(law)
    for index, (low, high) in enumerate(pairwise(edges)):
        shares = law.below(np.array([low, high])) if low < high else np.array([0.0, 1.0])
        density = law.density * float(shares[1] - shares[0])
        side = float(np.clip((_IN_CUBE / density) ** (1.0 / 3.0), *_SIDES))
        falls = law.speed(np.array([low, high]))
        seen: dict[tuple[int, ...], list[int]] = defaultdict(list)
        for number, t in enumerate(times):
            for cube in cubes(law, view, t, side, falls, (corner, corner + shape[::-1])):
                seen[tuple(cube.tolist())].append(number)
        for cube, numbers in seen.items():
            key = [seed, index, *(2 * abs(c) + (c < 0) for c in cube)]
            chance = np.random.default_rng(key)
            count = chance.poisson(density * side**3)
            places = (np.array(cube)[:, None] + chance.random((3, count))) * side
            diameter = law.diameters(shares[0] + chance.random(count) * (shares[1] - shares[0]))
            phases = chance.uniform(0.0, 2.0 * math.pi, (2, count))
            flakes = places, diameter, law.speed(diameter), phases
            for number in numbers:
                _draw(canvases[number], law, view, times[number], corner, flakes)
    return np.stack([canvas.alpha() for canvas in canvases])


def classes(law: Law) -> list[float]:
    small, _, large = law.sizes
    if small == large:
        return [small, large]
    at = np.linspace(small, large, 4001)
    speed = law.speed(at)
    number = 2 if law.kind == "snow" else 8
    wanted = np.linspace(speed[0], speed[-1], number + 1)
    return [small, *np.interp(wanted[1:-1], speed, at).tolist(), large]


def cubes(
    law: Law, view: View, t: float, side: float, falls: Floats, window: tuple[Floats, Floats]
) -> Ints:
    """Return the cubes of a class that a frame may show, (n, 3)."""
    exposure = view.shutter / view.fps
    speed = np.abs(np.array(view.velocity) - view.wind).max() + np.abs(falls).max()
    room = view.sway[0] + law.sizes[2] + speed * exposure
    near, far = law.nearest(), law.far * (1.0 + law.fades[1])
    focal = view.grown(t)
    # What turns or zooms while the shutter is open.
    aside = 2.0 + (abs(view.spin) + abs(view.zoom)) * exposure * (focal + max(view.size))
    low, high = window[0] - aside - 0.5 * np.array(view.size), window[1] + aside
    high = high - 0.5 * np.array(view.size)
    axes, eye = view.matrix(t), np.array(view.velocity) * (t / view.fps)
    ends = np.array(
        [(x * z / focal, y * z / focal, z) for x in (low[0], high[0]) for y in (low[1], high[1])
         for z in (near, far)]
    )  # fmt: skip
    corners = ends @ axes.T + eye
    ways = view.carried(falls, t).T
    first = np.floor((corners.min(axis=0) - room - ways.max(axis=0)) / side).astype(int)
    last = np.floor((corners.max(axis=0) + room - ways.min(axis=0)) / side).astype(int)
    found = np.stack(
        np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(first, last, strict=True)),
                    indexing="ij"), axis=-1
    ).reshape(-1, 3)  # fmt: skip
    bottom = found * side + ways.min(axis=0) - room
    half = 0.5 * (side + np.ptp(ways, axis=0) + 2.0 * room)
    middle = (bottom + half - eye) @ axes
    planes = np.array(
        [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (focal, 0.0, -low[0]), (-focal, 0.0, high[0]),
         (0.0, focal, -low[1]), (0.0, -focal, high[1])]
    )  # fmt: skip
    reach = np.abs(planes @ axes.T) @ half
    reach[:2] += -near, far
    return found[(middle @ planes.T + reach >= 0.0).all(axis=1)]


def _draw(
    canvas: Canvas, law: Law, view: View, t: float, corner: Floats,
    flakes: tuple[Floats, Floats, Floats, Floats],
) -> None:  # fmt: skip
    places, diameter, fall, phases = flakes
    now = places + view.carried(fall, t)
    pixel, depth = view.project(now, t)
    # Sway, size and exposure, before anything else is worked out for the many that are not seen.
    focal, exposure = view.grown(t), view.shutter / view.fps
    speed = np.abs(np.array(view.velocity) - view.wind).max() + float(fall.max(initial=0.0))
    room = focal * (view.sway[0] + law.sizes[2] + speed * exposure) / np.maximum(depth, 1e-9)
    room += 2.0 + (abs(view.spin) + abs(view.zoom)) * exposure * (focal + max(view.size))
    far = law.far * (1.0 + law.fades[1])
    seen = (depth > law.nearest() - view.sway[0]) & (depth < far + view.sway[0])
    for axis in range(2):
        at = pixel[axis] - corner[axis]
        seen &= (at > -room) & (at < canvas.shape[1 - axis] + room)
    places, diameter, fall, phases = places[:, seen], diameter[seen], fall[seen], phases[:, seen]
    way = np.empty((3, 2, len(fall)))
    for n, step in enumerate((-0.5, 0.0, 0.5)):
        at = t + step * view.shutter
        pixel, deep = view.project(places + view.carried(fall, at) + view.swing(phases, at), at)
        way[n] = pixel - corner[:, None]
        if step == 0.0:
            depth = deep
    good = np.flatnonzero(depth > law.nearest())
    depth = depth[good]
    canvas.add(way[:, :, good], focal * diameter[good] / depth, law.shown(depth))
