"""Far flakes whose places move in their own ways: a camera that goes ahead, turns or zooms, gusts.

They lie on planes in the air (`effects/poses.py`), each a sheet. What a pixel sees of a plane is a
place on it, which a lattice of nodes says for the opening and the close of the shutter.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64
from flurries._threads import reproducible
from flurries.effects.defocus import circles_of
from flurries.effects.gusts import carried_by_profile, wave_weights
from flurries.effects.motion import Motion
from flurries.effects.poses import APART, Eyes, Planes, eyes_of, planes_of
from flurries.effects.sheets import SHEAR, areas_of, kept, key_of, many_of, trim
from flurries.effects.weather import Film, Weather
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


class _Group(NamedTuple):
    """The sheets between two depths."""

    # Nodes are (R, C, 4) float32, as the kernel has them.
    sheets: list[tuple[_core.FlakeSheet, Array]]
    ways: Array  # (R, C, 2) float32: pixels that flakes move by during the exposure.
    near: float  # Metres.
    far: float  # Metres.


def read_bent(weather: Weather, frame: Frame, film: Film, amount: float, varies: bool) -> Array:
    """Return the opacity of the far flakes over the window, (h, w) float32.

    Parameters
    ----------
    varies : bool
        Whether the amount is keyed.
    """
    groups = frame.once_each(weather, "bent", lambda: _groups(weather, frame, film, amount, varies))
    top, bottom, left, right = frame.window
    result = plane((bottom - top, right - left))
    depth = None if frame.depth is None else np.ascontiguousarray(frame.crop(frame.depth))
    _core.sheet_bent(result, (top, left), groups, depth)
    trim(sum(len(group.sheets) for group in groups))
    return result


def _groups(
    weather: Weather, frame: Frame, film: Film, amount: float, varies: bool
) -> list[_Group]:
    """Return the sheets of a frame by their depths."""
    eyes = eyes_of(weather, frame, film)
    half = 0.5 * value_at(weather.motion.shutter, frame.t)
    moved = _blown(weather, frame, film, eyes, (frame.t - half, frame.t + half))
    rungs = _rungs(weather, frame, film, amount, varies, eyes)
    slabs = [layer.slab for layer in film.layers]
    depths = np.array([slab.depth for slab in slabs])
    power = [slab.coverage * float(np.mean(slab.diameters**2)) for slab in slabs]
    circles = circles_of(frame.blur, depths.tolist()) or (0.0,) * len(slabs)
    many, longest = many_of(film), frame.path.longest_focal
    focals = np.array(frame.camera.focals) * (longest / frame.camera.focal)
    areas = [
        _smaller(area, slab.count / most)
        for area, slab, most in zip(areas_of(film, tuple(focals)), slabs, many, strict=True)
    ]
    seen = [
        (planes, index, *_source(eyes, moved, planes, index, focals / depths[layer]))
        for planes in planes_of(frame, film, eyes)
        for index, layer in enumerate(planes.layer.tolist())
    ]
    found: dict[float, tuple[list[Any], Float64, float]] = {}
    for slab in slabs:
        own = [one for one in seen if slabs[one[0].layer[one[1]]].near == slab.near]
        if slab.near in found or not own:
            continue
        shares = [float(p.weight[i]) ** 2 * power[p.layer[i]] for p, i, _, _ in own]
        ways = sum(
            share * (u[1] - u[0]) / grown
            for share, (_, _, u, grown) in zip(shares, own, strict=True)
        ) / sum(shares)
        found[slab.near] = own, ways, slab.far
    groups = []
    for near, (each, ways, far) in found.items():
        sheets = []
        for planes, index, u, _ in each:
            layer, weight = int(planes.layer[index]), float(planes.weight[index])
            slab, area = slabs[layer], areas[layer]
            at = 0.5 * (u[0] + u[1]) + _jump(frame.seed, layer, planes.which[index], area)
            shear, root = round(SHEAR * area[1]), math.sqrt(many[layer])
            at -= np.floor(at[0, 0, 1] / area[0]) * np.array((shear, area[0]))
            at[..., 0] -= area[1] * np.floor(at[0, 0, 0] / area[1])
            thin = _part_seen(slab, ways)
            for rung, part in rungs[layer]:
                (sheet,) = kept([key_of(
                    weather, slab, frame.seed, layer, area, many[layer], [0.0, 0.0],
                    circles[layer], rung, reproducible(), float(planes.focal[index]), thin,
                )])  # fmt: skip
                node = np.empty((*at.shape[:2], 4), np.float32)
                node[..., :2], node[..., 2] = at, weight * root * part
                # Planes that give way to each other have the deviation of one, and so have some
                # flakes that stand for many; the mean is made up for.
                node[..., 3] = (weight**2 * many[layer] - weight * root) * part * sheet.mean
                sheets.append((sheet, node))
        ways = np.clip(ways, -LONGEST, LONGEST).astype(np.float32)
        groups.append(_Group(sheets, ways, near, far))
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


def _jump(seed: int, layer: int, which: npt.NDArray[np.int64], area: tuple[int, int]) -> Float64:
    """Return the place of a plane on its sheet, px (x, y)."""
    if not which.any():
        return np.zeros(2)
    draws, stream = np.empty(2), layer
    for number in which.tolist():
        stream = (stream * 1_000_003 + number) % (1 << 61)
    _core.uniform(draws, seed, stream)
    return np.floor(draws * (area[1], area[0]))


def _source(
    eyes: Eyes, moved: Float64 | None, planes: Planes, index: int, scale: Float64
) -> tuple[Float64, float]:
    """Return what the nodes see of a plane, less their own places, (2, R, C, 2) px (x, y).

    And the pixels of the sheet for each of the picture's.
    """
    axes, layer = planes.axes[index], planes.layer[index]
    ray = eyes.rays @ axes.T
    eye = eyes.eye[:, layer] @ axes.T
    ahead = (planes.at[index] - eye[:, 2])[:, None, None, None]
    scale = planes.focal[index] * scale
    grown = float(ahead.mean() * scale[0] * eyes.pixel)
    blown = None if moved is None else moved[layer] @ axes.T
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
        ahead = slab.depth * eyes.rays.mean(axis=0)
        if wind.profile is not None:
            deep = np.array([slab.depth * frame.camera.matrix()[2, 2]])
            for which, t in enumerate(times):
                moved = carried_by_profile(share.motion, frame.path, frame.fps, t, deep)
                found[number, which, ..., :2] += moved[0]
        if wind.waves is not None:
            found[number] += _waving(
                share.motion, frame, times, eyes.eye[:, number].mean(axis=0), ahead
            )
    return found


def _waving(
    motion: Motion, frame: Frame, times: tuple[float, float], eye: Float64, ahead: Float64
) -> Float64:
    """Return what gusts have done to the flakes at places from the eye, (2, R, C, 3)."""
    waves = motion.varied.waves  # type: ignore[union-attr]
    assert waves is not None
    weights = wave_weights(motion, frame.fps, times, eye)
    cycles = np.ascontiguousarray(waves.k / math.tau)
    points = ahead.reshape(-1, 3)
    moved = np.zeros((len(points), 6))
    # Of the flake that is there now: where it was at rest.
    for _ in range(2):
        rest = points - 0.5 * (moved[:, :3] + moved[:, 3:])
        moved = np.empty_like(moved)
        _core.wind_waves(moved, np.ascontiguousarray(rest), cycles, weights)
    return np.stack([moved[:, :3], moved[:, 3:]]).reshape(2, *ahead.shape)


def _rungs(
    weather: Weather, frame: Frame, film: Film, amount: float, varies: bool, eyes: Eyes
) -> list[list[tuple[float, Float64]]]:
    """Return the amounts of each layer that sheets are read for, with their shares at the nodes."""
    if not isinstance(weather.emission, Keys) and not varies:
        return [[(amount * float(weather.emission), np.ones((1, 1)))]] * len(film.layers)
    ladder, found = np.array(LADDER), []
    for share, slab in film.layers:
        heights = slab.depth * eyes.rays.mean(axis=0)[..., 1]
        there = weather.amounts(frame, share, amount, heights.ravel()).reshape(heights.shape)
        shares = [np.interp(there, ladder, np.eye(len(ladder))[n]) for n in range(len(ladder))]
        found.append([
            (rung, part) for rung, part in zip(LADDER, shares, strict=True) if rung and part.any()
        ])  # fmt: skip
    return found


def moved_by_wind(weather: Weather, weights: Float64, frame: Frame, other: Frame) -> Array:
    """Return how uneven wind moves the window's pixels to another frame, (h, w, 2) float32.

    The mean over layers, which have weights.
    """
    film = weather.film(frame)
    found = _blown(weather, frame, film, eyes_of(weather, frame, film), (frame.t, other.t))
    assert found is not None
    depths = np.array([layer.slab.depth for layer in film.layers])
    nearness = weights / depths / weights.sum()
    mean = np.einsum("l,lrca->rca", nearness, found[:, 1] - found[:, 0])
    seen = other.to_camera(mean)[..., :2] * np.array(other.camera.focals)
    top, bottom, left, right = frame.window
    rows = np.arange(top, bottom) + 0.5
    columns = np.arange(left, right) + 0.5
    at = [APART * np.arange(-1, length - 1) for length in seen.shape[:2]]
    result = np.empty((len(rows), len(columns), 2), np.float32)
    for axis in range(2):
        across = np.stack([np.interp(columns, at[1], line) for line in seen[..., axis]])
        down = rows / APART + 1.0
        low = np.minimum(down.astype(int), len(across) - 2)
        part = (down - low)[:, None]
        result[..., axis] = across[low] + part * (across[low + 1] - across[low])
    return result
