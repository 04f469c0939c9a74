"""Far flakes whose places move in their own ways: a camera that goes ahead, turns or zooms, gusts.

They lie on planes in the air (`effects/poses.py`), each a sheet. What a pixel sees of a plane is a
place on it, which a lattice of nodes says for the opening and the close of the shutter.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.effects.air import cycles_of
from flurries.effects.gusts import carried_by_profile, wave_weights
from flurries.effects.poses import APART, Eyes, Plane, eyes_of, planes_of
from flurries.effects.sheets import (
    SHEAR,
    areas_of,
    circles_of,
    depths_of,
    kept,
    key_of,
    many_of,
    power_of,
    slabs_in,
    trim,
)
from flurries.effects.weather import Film, Share, Weather
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.motion.keys import Keys, value_at
from flurries.particles.population import Slab

# Amounts that sheets are kept for, where the amount of flakes changes.
LADDER = (0.0, 0.125, 0.25, 0.5, 0.75, 1.0)

# Flakes and pixels of a sheet at most: all its places are made at once.
_FLAKES, _PIXELS = 300_000.0, 700_000.0

# Rays that run along a plane are taken to meet it so far aside.
_SLANT = 0.1

# Pixels that a streak is long at most, along an axis.
LONGEST = 120.0


def read_bent(weather: Weather, frame: Frame, film: Film, amount: float) -> Array:
    """Return the opacity of the far flakes over the window, (h, w) float32."""
    groups = frame.once_each(weather, "bent", lambda: _groups(weather, frame, film, amount))
    top, bottom, left, right = frame.window
    result = plane((bottom - top, right - left))
    depth = None if frame.depth is None else np.ascontiguousarray(frame.crop(frame.depth))
    _core.sheet_bent(result, (top, left), groups, depth)
    trim(sum(len(sheets) for sheets, *_ in groups))
    return result


def _groups(weather: Weather, frame: Frame, film: Film, amount: float) -> list[Any]:
    """Return the sheets between two depths with their nodes, the pixels that flakes move by during
    the exposure, and the depths: near ones first.
    """
    eyes = eyes_of(weather, frame, film)
    half = 0.5 * value_at(weather.motion.shutter, frame.t)
    moved = _blown(weather, frame, film, eyes, (frame.t - half, frame.t + half))
    rungs = _rungs(weather, frame, film, amount, eyes)
    slabs, depths, power, many = slabs_in(film), depths_of(film), power_of(film), many_of(film)
    circles = circles_of(frame.blur, depths)
    focals = np.array(frame.camera.focals) * (frame.path.longest_focal / frame.camera.focal)
    areas = [
        _smaller(area, slab.count / most)
        for area, slab, most in zip(areas_of(film, tuple(focals)), slabs, many, strict=True)
    ]
    found: dict[tuple[float, float], list[tuple[Plane, Float64, float]]] = {}
    for one in planes_of(frame, film, eyes):
        ends = slabs[one.layer].near, slabs[one.layer].far
        source = _source(eyes, moved, one, focals / depths[one.layer], frame.camera.focal)
        found.setdefault(ends, []).append((one, *source))

    def sheets(one: Plane, at: Float64, ways: Float64) -> list[tuple[_core.FlakeSheet, Array]]:
        layer, slab, area = one.layer, slabs[one.layer], areas[one.layer]
        at = at + _jump(frame.seed, one, area)
        shear, root = round(SHEAR * area[1]), math.sqrt(many[layer])
        at -= np.floor(at[0, 0, 1] / area[0]) * np.array((shear, area[0]))
        at[..., 0] -= area[1] * np.floor(at[0, 0, 0] / area[1])
        made, thin = [], _part_seen(slab, ways)
        for rung, part in rungs[layer]:
            sheet = kept(key_of(
                weather, slab, frame.seed, layer, area, many[layer], [0.0, 0.0], circles[layer],
                rung, one.focal, thin,
            ))  # fmt: skip
            node = np.empty((*at.shape[:2], 4), np.float32)
            node[..., :2], node[..., 2] = at, one.weight * root * part
            # Planes that give way to each other have the deviation of one, and so have some
            # flakes that stand for many; the mean is made up for.
            node[..., 3] = (one.weight**2 * many[layer] - one.weight * root) * part * sheet.mean
            made.append((sheet, node))
        return made

    groups = []
    for ends, each in sorted(found.items()):
        shares = [one.weight**2 * power[one.layer] for one, _, _ in each]
        moves = [
            share * (u[1] - u[0]) / grown for share, (_, u, grown) in zip(shares, each, strict=True)
        ]
        ways: Float64 = sum(moves) / sum(shares)
        seen = [pair for one, u, _ in each for pair in sheets(one, 0.5 * (u[0] + u[1]), ways)]
        groups.append((seen, np.clip(ways, -LONGEST, LONGEST).astype(np.float32), *ends))
    return groups


def _part_seen(slab: Slab, ways: Float64) -> float:
    """Return the part of a flake that a pixel shows at a time, in steps: 1 where it rests."""
    length = float(np.hypot(*ways.reshape(-1, 2).T).mean())
    # What a flake that covers the layer's mean area is wide, in a pixel's box.
    wide = math.sqrt(float(np.mean(slab.diameters**4) / np.mean(slab.diameters**2)) + 0.8)
    part = wide / math.hypot(wide, length)
    return float(2.0 ** (0.5 * round(2.0 * math.log2(part))))


def _smaller(area: tuple[int, int], count: float) -> tuple[int, int]:
    """Return rows and columns of a sheet that is not too large, of flakes for each pixel."""
    pixels = area[0] * area[1]
    part = math.sqrt(min(_FLAKES / max(count * pixels, 1.0), _PIXELS / pixels, 1.0))
    return max(round(part * area[0]), 96), max(round(part * area[1]), 96)


def _jump(seed: int, one: Plane, area: tuple[int, int]) -> Float64:
    """Return the place of a plane on its sheet, px (x, y)."""
    draws, stream = np.zeros(2), one.layer
    if any(one.which):
        for number in one.which:
            stream = (stream * 1_000_003 + number) % (1 << 61)
        _core.uniform(draws, seed, stream)
    return np.floor(draws * (area[1], area[0]))


def _source(
    eyes: Eyes, moved: Float64 | None, one: Plane, scale: Float64, focal: float
) -> tuple[Float64, float]:
    """Return what the nodes see of a plane, less their own places, (2, R, C, 2) px (x, y).

    And the pixels of the sheet for each of the picture's.
    """
    ray = eyes.rays @ one.axes.T
    eye = eyes.eye[:, one.layer] @ one.axes.T
    ahead = (one.at - eye[:, 2])[:, None, None, None]
    scale = one.focal * scale
    grown = float(ahead.mean() * scale[0] * (1.0 / focal))
    blown = None if moved is None else moved[one.layer] @ one.axes.T
    if blown is not None:
        ahead = ahead + blown[..., 2:]
    at = eye[:, None, None, :2] + ahead * (ray[..., :2] / np.maximum(ray[..., 2:], _SLANT))
    if blown is not None:
        at = at - blown[..., :2]
    at = at * scale
    at[..., 0] -= APART * np.arange(-1, at.shape[2] - 1)
    at[..., 1] -= APART * np.arange(-1, at.shape[1] - 1)[:, None]
    return np.asarray(at), grown


def _blown(
    weather: Weather, frame: Frame, film: Film, eyes: Eyes, times: tuple[float, float]
) -> Float64 | None:
    """Return how far uneven wind has carried what the nodes see, (L, 2, R, C, 3) metres."""
    wind = weather.motion.varied
    if wind is None:
        return None
    found = np.zeros((len(film.layers), *eyes.rays.shape))
    for number, (share, slab) in enumerate(film.layers):
        if wind.profile is not None:
            deep = np.array([slab.depth * frame.camera.matrix()[2, 2]])
            for which, t in enumerate(times):
                moved = carried_by_profile(share.motion, frame.path, frame.fps, t, deep)
                found[number, which, ..., :2] += moved[0]
        if wind.waves is not None:
            start = eyes.eye[:, number].mean(axis=0)
            ahead = slab.depth * eyes.rays.mean(axis=0)
            weights = wave_weights(share.motion, frame.fps, times, start)
            points = ahead.reshape(-1, 3)
            both = np.zeros((len(points), 6))
            # Of the flake that is there now: where it was at rest.
            for _ in range(2):
                rest = points - 0.5 * (both[:, :3] + both[:, 3:])
                both = np.empty_like(both)
                _core.wind_waves(both, np.ascontiguousarray(rest), cycles_of(wind.waves), weights)
            found[number] += np.stack([both[:, :3], both[:, 3:]]).reshape(2, *ahead.shape)
    return found


def _rungs(
    weather: Weather, frame: Frame, film: Film, amount: float, eyes: Eyes
) -> list[list[tuple[float, Float64]]]:
    """Return the amounts of each layer that sheets are read for, with their shares at the nodes."""
    if not isinstance(weather.emission, Keys) and not weather.keyed:
        return [[(amount * float(weather.emission), np.ones((1, 1)))]] * len(film.layers)

    def parts(share: Share, slab: Slab) -> list[tuple[float, Float64]]:
        heights = slab.depth * eyes.rays.mean(axis=0)[..., 1]
        there = weather.amounts(frame, share, amount, heights.ravel()).reshape(heights.shape)
        shares = [np.interp(there, LADDER, row) for row in np.eye(len(LADDER))]
        pairs = zip(LADDER, shares, strict=True)
        return [(rung, part) for rung, part in pairs if rung and part.any()]

    return [parts(*layer) for layer in film.layers]


def moved_by_wind(weather: Weather, weights: Float64, frame: Frame, other: Frame) -> Array:
    """Return how uneven wind moves the window's pixels to another frame, (h, w, 2) float32.

    The mean over layers, which have weights.
    """
    film = weather.film(frame)
    found = _blown(weather, frame, film, eyes_of(weather, frame, film), (frame.t, other.t))
    assert found is not None
    nearness = weights / depths_of(film) / weights.sum()
    mean = np.einsum("l,lrca->rca", nearness, found[:, 1] - found[:, 0])
    seen = other.to_camera(mean)[..., :2] * np.array(other.camera.focals)
    top, bottom, left, right = frame.window
    rows, columns = np.arange(top, bottom) + 0.5, np.arange(left, right) + 0.5
    at = APART * np.arange(-1, seen.shape[1] - 1)
    down = rows / APART + 1.0
    low = np.minimum(down.astype(int), len(seen) - 2)
    part = (down - low)[:, None]
    result = np.empty((len(rows), len(columns), 2), np.float32)
    for axis in range(2):
        across = np.stack([np.interp(columns, at, line) for line in seen[..., axis]])
        result[..., axis] = across[low] + part * (across[low + 1] - across[low])
    return result
