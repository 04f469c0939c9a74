"""Clips of falling snow whose numbers are known: the judges of `fl.match`.

Every flake is drawn by the float64 twin of `twin_falling`, never by the package. The plate is a
photograph; the clip is of 8 bit with noise of 2 levels, and goes through h264 at crf 18.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest import mock

import av
import numpy as np
import skimage
import skimage.data

import twin_footprints
from flurries.io import linear_to_srgb
from twin_falling import View
from twin_footprints import Canvas, Floats
from twin_law import Law

PHOTOGRAPHS = "coffee", "rocket", "astronaut", "chelsea"
NOISE, CRF = 2.0, 18

# What must be found: within so many degrees, and shares.
MOST = {
    "direction": 3.0, "speed": 0.1, "density": 0.3, "size": 0.2, "exposure": 0.15, "light": 0.05,
}  # fmt: skip
_FEW = 30_000  # Flakes at a time, which the processor keeps at hand.

# Points of a flake of some pixels: fewer than the twin's own, which is for errors of .01.
FEWER = {"POINTS": 8.0, "LEAST_POINTS": 16, "POINT": 0.4, "LARGE": 6.0, "SAMPLES": 2}


@dataclass(frozen=True)
class Case:
    """A clip's numbers."""

    seed: int
    law: Law
    view: View
    color: tuple[float, float, float]  # Of flakes, display values.
    photograph: str
    frames: int

    @property
    def velocity(self) -> tuple[float, float]:
        """The velocity of a flake of the mean size, m/s, right and down."""
        return self.view.wind[0], self.view.wind[1] + float(self.law.speed(self.law.sizes[1]))

    @property
    def direction(self) -> float:
        """Of a flake of the mean size in the middle of the picture, degrees from +x to +y."""
        return math.degrees(math.atan2(*self.velocity[::-1]))

    @property
    def speed(self) -> float:
        """Of the median depth, which has half of the flakes' cover before it, px a frame."""
        depth = 0.5 * (self.law.near + self.law.far)
        return self.view.focal * math.hypot(*self.velocity) / depth / self.view.fps


def case(seed: int, size: tuple[int, int] = (640, 360), frames: int = 32) -> Case:
    """Return one of the cases that a user may have; those of a seed are always the same."""
    chance = np.random.default_rng([37, seed])
    mean = 0.005 * 2.4 ** chance.random()
    sizes = mean * chance.uniform(0.35, 0.5), mean, mean * chance.uniform(2.6, 3.3)
    density = 10.0 * 9.0 ** chance.random()
    wind, aside = chance.uniform(0.0, 4.0), chance.uniform(-0.25, 0.25)
    side = chance.choice([-1.0, 1.0])
    # One in six is turned while it runs.
    spin = chance.uniform(-0.1, 0.1) if seed % 6 == 5 else 0.0
    view = View(
        size=size, focal=size[0] * chance.uniform(0.8, 1.6),
        wind=(side * wind * math.cos(aside), 0.0, wind * math.sin(aside)), spin=spin,
        sway=(0.02, 4.0), shutter=chance.uniform(0.2, 0.9), fps=chance.choice([24.0, 25.0, 30.0]),
    )  # fmt: skip
    level = chance.uniform(0.65, 0.95)
    color = tuple((level + chance.uniform(-0.02, 0.02, 3)).tolist())
    photograph = PHOTOGRAPHS[seed % len(PHOTOGRAPHS)]
    return Case(seed, Law(density=density, sizes=sizes), view, color, photograph, frames)


def plate(one: Case, t: float) -> np.ndarray:
    """Return the photograph as the camera sees it at frame t, display values (h, w, 3)."""
    picture = skimage.util.img_as_float(getattr(skimage.data, one.photograph)())[..., :3]
    width, height = one.view.size
    # A camera that turns needs more of it: of infinity, and a little larger.
    room = 2 * math.ceil(one.view.focal * 0.1 * one.frames / one.view.fps) + 8
    wide = width + (room if one.view.spin else 0)
    ratio = max(wide / picture.shape[1], (height + 8) / picture.shape[0])
    shape = math.ceil(picture.shape[0] * ratio), math.ceil(picture.shape[1] * ratio)
    large = skimage.transform.resize(picture, shape, order=3, anti_aliasing=ratio < 1.0)
    left = 0.5 * (shape[1] - width) + one.view.focal * math.tan(one.view.spin * t / one.view.fps)
    whole, top = math.floor(left), (shape[0] - height) // 2
    rest = left - whole if one.view.spin else 0.0
    columns = whole + np.arange(width)
    first, second = (large[top : top + height].take(columns + n, 1, mode="clip") for n in (0, 1))
    return np.clip((1.0 - rest) * first + rest * second, 0.0, 1.0)


def add_specks(canvas: Canvas, start: Floats, end: Floats, area: Floats) -> None:
    """Add flakes far below a pixel as six points along their ways, (2, n)."""
    height, width = canvas.shape
    for part in (np.arange(6) + 0.5) / 6:
        col, row = (np.floor(a + part * (b - a)) for a, b in zip(start, end, strict=True))
        inside = (col >= 0.0) & (col < width) & (row >= 0.0) & (row < height)
        place = (row[inside] * width + col[inside]).astype(np.int64)
        canvas.depth += np.bincount(place, area[inside] / 6, minlength=len(canvas.depth))


def opacity(one: Case) -> Floats:
    """Return the opacity of all flakes, (frames, h, w): the twin's law and pictures of flakes."""
    law, view = one.law, one.view
    chance = np.random.default_rng([39, one.seed])
    low, high = law.nearest(), law.far * (1.0 + law.fades[1])
    span, (width, height) = one.frames / view.fps, view.size
    # All that is seen at any time, by slabs of depth at frame 0.
    drift = np.array(view.wind) * span
    most = float(law.speed(np.array(law.sizes)).max()) * span + drift[1]
    ends = low - max(drift[2], 0.0) - 0.1, high + max(-drift[2], 0.0) + 0.1
    kept = []
    for near, far in pairwise([ends[0], *np.geomspace(low, high, 24), ends[1]]):
        deepest = far + max(drift[2], 0.0)
        half = [0.5 * side / view.focal * deepest + 0.1 for side in (width, height)]
        half[0] += abs(view.spin) * span * deepest
        start = np.array([-half[0] - max(drift[0], 0.0), -half[1] - most, near])
        end = np.array([half[0] - min(drift[0], 0.0), half[1], far])
        count = chance.poisson(law.density * (end - start).prod())
        places = chance.random((3, count)) * (end - start)[:, None] + start[:, None]
        diameter, phases = law.diameters(chance.random(count)), chance.random((2, count))
        for few in range(0, count, _FEW):
            part = np.s_[few : few + _FEW]
            kept.append((places[:, part], diameter[part], 2.0 * math.pi * phases[:, part]))
    canvases = [Canvas((height, width), law.opacity, t) for t in range(one.frames)]
    amplitude, rate = view.sway
    for places, diameter, phases in kept:
        fall = law.speed(diameter)
        for t, canvas in enumerate(canvases):
            way = []
            for at in (t - 0.5 * view.shutter, t + 0.5 * view.shutter):
                now = places + view.carried(fall, at)
                now[::2] += amplitude * np.sin(rate * at / view.fps + phases)
                pixel, depth = view.project(now, at)
                way.append(pixel)
            image = view.focal * diameter / depth
            speck = (image < twin_footprints.POINT) & (depth > law.near)
            area = law.shown(depth[speck]) * law.opacity * 0.25 * math.pi * image[speck] ** 2
            add_specks(canvas, way[0][:, speck], way[1][:, speck], area)
            rest = (~speck).nonzero()[0]
            if len(rest):
                ends = np.array([way[0][:, rest], np.mean(way, axis=0)[:, rest], way[1][:, rest]])
                canvas.add(ends, image[rest], law.shown(depth[rest]))
    return np.array([canvas.alpha() for canvas in canvases], np.float32)


def clip(one: Case, folder: Path) -> Path:
    """Write the clip of a case, h264, and return its file."""
    file = folder / f"{one.seed}_{one.view.size[0]}_{one.frames}.mp4"
    if file.exists():
        return file
    with mock.patch.multiple(twin_footprints, **FEWER):
        alpha, still = opacity(one), plate(one, 0.0)
    with av.open(str(file), "w") as out:
        stream = out.add_stream("libx264", rate=int(one.view.fps), options={"crf": str(CRF)})
        stream.width, stream.height, stream.pix_fmt = *one.view.size, "yuv420p"
        for t in range(one.frames):
            back = plate(one, t) if one.view.spin else still
            cover = alpha[t][..., None].astype(float)
            frame = noisy(back + cover * (np.array(one.color) - back), 1000 * one.seed + t)
            out.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        out.mux(stream.encode())
    return file


def noisy(picture: np.ndarray, seed: int) -> np.ndarray:
    """Return a picture of 8 bits with noise, of display values."""
    noise = np.random.default_rng([38, seed]).normal(0.0, NOISE, picture.shape)
    return np.clip(np.rint(255.0 * picture + noise), 0.0, 255.0).astype(np.uint8)


def errors_of(found: Any, one: Case) -> dict[str, float]:
    """Return how far a match is off: degrees, and shares less one."""
    light = linear_to_srgb(np.array(found.light.snow)).mean()
    return {
        "direction": math.degrees(found.direction) - one.direction,
        "speed": found.speed / one.speed - 1.0,
        "density": found.snow.density / one.law.density - 1.0,
        "size": found.snow.flake_size[1] / one.law.sizes[1] - 1.0,
        "exposure": found.snow.shutter / one.view.shutter - 1.0,
        "light": float(light) / float(np.mean(one.color)) - 1.0,
    }
