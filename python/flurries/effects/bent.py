"""Far flakes that move in their own ways, as sheets on planes in the air, seen through nodes."""

import itertools
import math
from collections.abc import Iterator
from functools import partial, reduce
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries.effects import uneven
from flurries.effects.air import amounts_at
from flurries.effects.sheets import SHEAR, areas_of, circles_of, key_of, sheets_of
from flurries.effects.weather import Film, Layer, Weather
from flurries.frame.planes import plane
from flurries.frame.view import Frame
from flurries.motion.keys import Keys

# Amounts that sheets are kept for, where the amount of flakes changes.
LADDER = (0.0, 0.125, 0.25, 0.5, 0.75, 1.0)

# Flakes and pixels of a sheet at most: all its places are made at once.
_FLAKES, _PIXELS = 500_000.0, 700_000.0

_SLANT = 0.1  # Rays that run along a plane are taken to meet it so far aside.

# Pixels that a streak is long at most, along an axis, and the least part of a flake that is seen.
LONGEST, _FAINTEST = 114.0, 0.0014

# Radians that a camera turns, and by which logarithm a lens zooms, before other planes are seen. A
# whole number of the first make a round.
_ROUND = 36
_TURN, _ZOOM = math.tau / _ROUND, math.log(1.15)

# A plane gives way to the next within so many frames, or at most this part of its time; and so
# little of one is not seen.
_CHANGE, _LONGEST_CHANGE, _LEAST_SEEN = 3.0, 0.2, 0.02

# Layers change their planes at places of their own along each of these.
_PHASES = (0.6180339887, 0.7548776662, 0.5698402910, 0.4331)

_Ints = npt.NDArray[np.int64]
_key_of = kept(1024, by_mode=True)(key_of)


class Eyes(NamedTuple):
    rays: Float64  # (2, R, C, 3): of the nodes, house axes, with a depth of 1.
    eye: Float64  # (2, L, 3): places of the eye in the air of each layer, house axes, metres.
    rate: Float64  # (L, 3): metres per frame.


class Plane(NamedTuple):
    layer: int
    weight: float  # Of its deviation.
    axes: Float64  # (3, 3): rows turn house axes into the plane's.
    at: float  # Along its axis in the air, metres.
    focal: float  # That its sheet is made for, over the longest.
    which: list[int]  # Its numbers among its like.


def read_bent(
    weather: Weather, frame: Frame, film: Film, amount: float, parts: Float64 | None = None
) -> Array:
    """Return the opacity of the far flakes over the window, (h, w) float32."""
    # `parts` are shares of the layers, (L,).
    make = partial(_groups, weather, frame, film, amount, parts)
    groups = frame.once(weather, f"bent {parts}", make, eye=True)
    result = plane(frame.size)
    depth = None if frame.depth is None else frame.crop(frame.depth)
    _core.sheet_bent(result, (frame.window[0], frame.window[2]), groups, depth)
    return result


def _groups(
    weather: Weather, frame: Frame, film: Film, amount: float, parts_of: Float64 | None
) -> list[Any]:
    """Return sheets between two depths, with nodes, motion in px and depths; near ones first."""
    half = 0.5 * weather.motion.exposure(frame)
    times = (frame.t - half, frame.t + half)
    eyes = _eyes_of(frame, film, times)
    moved = _blown(weather, frame, film, eyes, times)
    slabs, circles = film.slabs, circles_of(frame.blur, film.depths)
    rungs = [_rungs(weather, frame, layer, amount, eyes) for layer in film.layers]
    focals = np.array(frame.camera.focals) * (frame.path.longest_focal / frame.camera.focal)
    areas = _areas(film, *focals.tolist())
    planes = list(_planes_of(frame, film, eyes))
    numbers = [one.layer for one in planes]
    scale = focals * np.array([one.focal / slabs[one.layer].depth for one in planes])[:, None]
    blown = None if moved is None else moved[numbers]
    both, grown = _places(eyes, blown, planes, scale, frame.camera.focal)
    seen = _on_torus(both.mean(axis=1), frame.seed, planes, [areas[n] for n in numbers])
    moves = (both[:, 1] - both[:, 0]) / grown[:, None, None, None]
    # Classes that fall about as fast share their streaks: those of snow, not those of rain.
    falls = film.falls * (film.falls.max() > 1.3 * film.falls.min())
    ends = [(slabs[n].near, slabs[n].far, falls[n]) for n in numbers]
    groups = sorted(set(ends))
    which = [groups.index(one) for one in ends]
    shares = np.zeros((len(groups), len(planes)))
    shares[which, range(len(planes))] = [one.weight**2 * film.power[one.layer] for one in planes]
    shares /= shares.sum(axis=1, keepdims=True)
    ways = (shares @ moves.reshape(len(planes), -1)).reshape(-1, *moves.shape[1:])
    lengths = np.hypot(ways[..., 0], ways[..., 1]).mean(axis=(1, 2)).tolist()
    ways = _within(ways, -LONGEST, LONGEST).astype(np.float32)
    every = [
        (at, rung, part, _part_seen(film.wide[numbers[at]], lengths[which[at]]))
        for at in sorted(range(len(planes)), key=which.__getitem__)
        for rung, part in rungs[numbers[at]]
    ]
    if not every:
        return []
    sheets = sheets_of([
        _key_of(weather, slabs[n], frame.seed, n, areas[n], film.many[n], (0.0, 0.0), circles[n],
               rung, planes[at].focal, thin)
        for at, rung, _, thin in every for n in [numbers[at]]
    ])  # fmt: skip
    weights, many, means = np.array([
        (planes[at].weight, film.many[numbers[at]], sheet.mean)
        for (at, *_), sheet in zip(every, sheets, strict=True)
    ]).T[..., None, None]  # fmt: skip
    gains, part = weights * np.sqrt(many), np.array([np.atleast_2d(one[2]) for one in every])
    own, clumps = [numbers[at] for at, *_ in every], uneven.clumps_of(weather, frame)
    if clumps is not None:
        rays, turn = 0.5 * (eyes.rays[0] + eyes.rays[1]), frame.camera.matrix()
        part = part * uneven.denser(clumps, frame.camera, rays, turn, slabs)[own]
    nodes = np.empty((len(every), *seen.shape[1:3], 4), np.float32)
    nodes[..., :2], nodes[..., 2] = seen[[at for at, *_ in every]], gains * part
    # Planes that give way to each other have the deviation of one, and so have some flakes that
    # stand for many; the mean is made up for.
    nodes[..., 3] = (weights**2 * many - gains) * part * means
    if parts_of is not None:
        nodes[..., 2:] *= parts_of[own, None, None, None]
    found: list[Any] = [([], way, *one[:2]) for way, one in zip(ways, groups, strict=True)]
    for (at, *_), *made in zip(every, sheets, nodes, strict=True):
        found[which[at]][0].append(tuple(made))
    return found


@kept(64)
def _areas(film: Film, *focals: float) -> list[tuple[int, int]]:
    """Return rows and columns of each layer's sheet: not too many, for flakes at all places."""
    found = []
    for area, slab, many in zip(areas_of(film, focals), film.slabs, film.many, strict=True):  # type: ignore[arg-type]
        pixels = area[0] * area[1]
        flakes = max(slab.count / many * pixels, 1.0)
        part = math.sqrt(min(_FLAKES / flakes, _PIXELS / pixels, 1.0))
        found.append((max(round(part * area[0]), 96), max(round(part * area[1]), 96)))
    return found


def _part_seen(wide: float, length: float) -> float:
    """Return the part of a flake that a pixel shows at a time, in steps: 1 where it rests."""
    part: float = 2.0 ** (0.5 * round(2.0 * math.log2(wide / math.hypot(wide, length))))
    return max(part, _FAINTEST)


def _on_torus(at: Float64, seed: int, planes: list[Plane], areas: list[tuple[int, int]]) -> Float64:
    """Return places on planes (P, R, C, 2) as places on their sheets, near the first round."""
    (rows, columns), draws = np.array(areas, float).T, np.zeros((len(planes), 2))
    for own, one in zip(draws, planes, strict=True):
        if any(one.which):
            own[:] = _place(seed, one.layer, *one.which)
    at += np.floor(draws * np.stack([columns, rows], axis=1))[:, None, None]
    down = np.floor(at[:, 0, 0, 1] / rows)
    at[..., 1] -= (down * rows)[:, None, None]
    at[..., 0] -= (down * np.rint(SHEAR * columns))[:, None, None]
    at[..., 0] -= (columns * np.floor(at[:, 0, 0, 0] / columns))[:, None, None]
    return at


@kept(1024)
def _place(seed: int, *numbers: int) -> Float64:
    """Return where a plane lies on its sheet, (2,) of 0 to 1."""
    draw = np.empty(2)
    _core.uniform(draw, seed, reduce(lambda mix, n: (mix * 1_000_003 + n) % (1 << 61), numbers))
    return draw


def _rungs(
    weather: Weather, frame: Frame, layer: Layer, amount: float, eyes: Eyes
) -> list[tuple[float, Float64]]:
    """Return the amounts of a layer that sheets are read for, with their shares at the nodes."""
    if not weather.keyed and not isinstance(weather.emission, Keys):
        return [(amount * weather.emission, np.ones((1, 1)))]
    there: Any = weather.emission
    if isinstance(there, Keys):
        heights = layer.slab.depth * eyes.rays.mean(axis=0)[..., 1]
        there = amounts_at(weather, frame, layer.share, heights).reshape(heights.shape)
    shares = [np.asarray(np.interp(amount * there, LADDER, row)) for row in np.eye(len(LADDER))]
    return [(rung, part) for rung, part in zip(LADDER, shares, strict=True) if rung and part.any()]


def _eyes_of(frame: Frame, film: Film, times: tuple[float, float]) -> Eyes:
    bends = frame.path.turns or frame.path.zooms
    rays, path, fps = list[Float64](), frame.path, frame.fps
    shares = {layer.share: layer.share.motion for layer in film.layers}
    ways = {share: motion.places(path, fps, [*times]) for share, motion in shares.items()}
    rates = {share: motion.rate(path, fps, times[1]) for share, motion in shares.items()}
    eye = np.stack([ways[layer.share] for layer in film.layers], axis=1)
    for number, t in enumerate(times):
        camera = frame.later(t - frame.t).camera if bends else frame.camera
        if bends or not rays:
            own, turn = uneven.rays_of(camera, frame.shape)
        rays.append(own)
        eye[number] += turn @ np.array(camera.offset)
    return Eyes(np.stack(rays), eye, np.array([rates[layer.share] for layer in film.layers]))


def _planes_of(frame: Frame, film: Film, eyes: Eyes) -> Iterator[Plane]:
    """Yield the planes that are seen: one of each layer, and those that give way or come."""
    path, camera, layers = frame.path, frame.camera, np.arange(len(film.layers))
    phases: list[Any] = [(part * (layers + 1.0)) % 1.0 for part in _PHASES]
    # Angles, and the zoom: numbers of the poses that planes are made for, and how far each has
    # given way to the next.
    poses: list[tuple[_Ints, Float64]] = []
    if path.turns:
        before, after = (_angles(frame.later(step).camera.matrix()) for step in (-0.5, 0.5))
        for angle, rate in zip(_angles(camera.matrix()), after - before, strict=True):
            rate = (rate + math.pi) % math.tau - math.pi
            poses.append(_next(angle / _TURN - phases[len(poses)], abs(rate) / _TURN))
    if path.zooms:
        grown = math.log(camera.focal / path.longest_focal) / _ZOOM
        poses.append(_next(grown - phases[len(poses)], abs(path.zoom(frame.t)[1]) / _ZOOM))
    for taken in itertools.product((0, 1), repeat=len(poses)):
        weight, which, middles = np.ones(len(layers)), [], []
        for number, (one, (first, share)) in enumerate(zip(taken, poses, strict=True)):
            weight = weight * (np.sin if one else np.cos)(0.5 * math.pi * share)
            round_ = path.turns and number < 3
            which.append((first + one) % _ROUND if round_ else first + one)
            middles.append(first + one + 0.5 + phases[number])
        axes = np.broadcast_to(camera.matrix().T, (len(layers), 3, 3))
        if path.turns:
            axes = np.stack([_axes(*(_TURN * angle[n] for angle in middles[:3])) for n in layers])
        focal = np.exp(_ZOOM * middles[-1]) if path.zooms else np.ones(len(layers))
        for at, own, numbers in _along(film, eyes, axes[:, 2], weight, phases[0]):
            table = np.stack([numbers, *which], axis=1).tolist() if film.comes else [[0]] * len(own)
            each = zip(own.tolist(), axes, at.tolist(), focal.tolist(), table, strict=True)
            for n, (seen, *rest) in enumerate(each):
                if seen > _LEAST_SEEN or not film.comes:
                    yield Plane(n, seen, *rest)


def _along(
    film: Film, eyes: Eyes, axis: Float64, weight: Float64, phase: Float64
) -> Iterator[tuple[Float64, Float64, _Ints]]:
    """Yield where planes are along their axes, their weights and their numbers."""
    along = np.einsum("la,la->l", axis, 0.5 * (eyes.eye[0] + eyes.eye[1]))
    if not film.comes:
        yield along + film.depths, weight, np.zeros(len(weight), np.int64)
        return
    far, thick = np.array([(slab.far, slab.far - slab.near) for slab in film.slabs]).T
    pace = np.abs(np.einsum("la,la->l", axis, eyes.rate)) / thick
    first, share = _next(along / thick - phase, pace)
    for one, part in enumerate((np.cos, np.sin)):
        own = weight * part(0.5 * math.pi * share)
        yield far + (first + one + phase) * thick, own, first + one


def _next(at: Float64, pace: Float64 | float) -> tuple[_Ints, Float64]:
    """Return the number of the plane at places, and how far it has given way to the next."""
    first = np.floor(at)
    change = _within(_CHANGE * np.asarray(pace), 1e-9, _LONGEST_CHANGE)
    return first.astype(np.int64), _within(1.0 - (1.0 - (at - first)) / change, 0.0, 1.0)


def _within(values: Float64, low: float, high: float) -> Float64:
    return np.minimum(np.maximum(values, low), high)


def _angles(matrix: Float64) -> Float64:
    """Return yaw, pitch and roll of a camera's axes, radians."""
    x, y, z = matrix[:, 2]
    yaw, pitch = math.atan2(x, z), math.atan2(-y, math.hypot(x, z))
    right, down, _ = _axes(yaw, pitch, 0.0)
    return np.array((yaw, pitch, math.atan2(matrix[:, 0] @ down, matrix[:, 0] @ right)))


def _axes(yaw: float, pitch: float, roll: float) -> Float64:
    """Return the axes (right, down, ahead) of a camera by its angles, as rows."""
    a, b, c, d = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    right, ahead = np.array((a, 0.0, -b)), np.array((c * b, -d, c * a))
    down = np.cross(ahead, right)
    e, f = math.cos(roll), math.sin(roll)
    return np.stack([e * right + f * down, e * down - f * right, ahead])


def _places(
    eyes: Eyes, blown: Float64 | None, planes: list[Plane], scale: Float64, focal: float
) -> tuple[Float64, Float64]:
    """Return what the nodes see of planes, less their own places, (P, 2, R, C, 2) px (x, y)."""
    axes = np.stack([one.axes.T for one in planes])
    ray = (eyes.rays.reshape(-1, 3) @ axes).reshape(len(planes), *eyes.rays.shape)
    eye = eyes.eye[:, [one.layer for one in planes]].swapaxes(0, 1) @ axes
    ahead = np.array([one.at for one in planes])[:, None] - eye[..., 2]
    grown = 0.5 * (ahead[:, 0] + ahead[:, 1]) * scale[:, 0] / focal
    eye, ahead = eye[:, :, None, None], ahead[:, :, None, None, None]
    aside: Any = 0.0
    if blown is not None:
        turned = blown @ axes[:, None, None]
        ahead, aside = ahead + turned[..., 2:], turned[..., :2]
    at = eye[..., :2] + ahead * (ray[..., :2] / np.maximum(ray[..., 2:], _SLANT))
    at = (at - aside) * scale[:, None, None, None]
    at[..., 0] -= uneven.APART * np.arange(-1, at.shape[3] - 1)
    at[..., 1] -= uneven.APART * np.arange(-1, at.shape[2] - 1)[:, None]
    return np.asarray(at), grown


def _blown(
    weather: Weather, frame: Frame, film: Film, eyes: Eyes, times: tuple[float, float]
) -> Float64 | None:
    """Return how far uneven wind has carried what the nodes see, (L, 2, R, C, 3) metres."""
    wind = weather.motion.varied
    if wind is None:
        return None
    found, axis = np.zeros((len(film.layers), *eyes.rays.shape)), frame.camera.matrix()[:, 2]
    for number, (share, slab) in enumerate(film.layers):
        if wind.profile is not None:
            deep = np.array([slab.depth * axis[2]])
            for which, t in enumerate(times):
                moved = uneven.carried_by_profile(share.motion, frame.path, frame.fps, t, deep)
                # A plane stays where it is along the view.
                found[number, which] += np.append(moved, 0.0) - moved[0] @ axis[:2] * axis
        if wind.waves is not None:
            start = eyes.eye[:, number].mean(axis=0)
            ahead = slab.depth * eyes.rays.mean(axis=0)
            weights = uneven.wave_weights(share.motion, frame.fps, times, start)
            points, cycles = ahead.reshape(-1, 3), uneven.cycles_of(wind.waves)
            both = np.zeros((len(points), 6))
            # Of the flake that is there now: where it was at rest.
            for _ in range(2):
                rest = points - 0.5 * (both[:, :3] + both[:, 3:])
                _core.wind_waves(both, np.ascontiguousarray(rest), cycles, weights)
            found[number] += np.stack([both[:, :3], both[:, 3:]]).reshape(2, *ahead.shape)
    return found


def moved_by_wind(weather: Weather, weights: Float64, frame: Frame, other: Frame) -> Array:
    """Return how uneven wind moves the window's pixels to another frame, (h, w, 2) float32."""
    film, half = weather.film(frame), 0.5 * weather.motion.exposure(frame)
    eyes = _eyes_of(frame, film, (frame.t - half, frame.t + half))
    found = _blown(weather, frame, film, eyes, (frame.t, other.t))
    assert found is not None
    nearness = weights / film.depths / weights.sum()
    mean = np.einsum("l,lrca->rca", nearness, found[:, 1] - found[:, 0])
    seen = other.to_camera(mean)[..., :2] * np.array(other.camera.focals)
    top, bottom, left, right = frame.window
    columns, at = np.arange(left, right) + 0.5, uneven.APART * np.arange(-1, seen.shape[1] - 1)
    down = (np.arange(top, bottom) + 0.5) / uneven.APART + 1.0
    low = np.minimum(down.astype(int), len(seen) - 2)
    part = (down - low)[:, None]
    result = np.empty((len(down), len(columns), 2), np.float32)
    for axis in range(2):
        across = np.stack([np.interp(columns, at, line) for line in seen[..., axis]])
        result[..., axis] = across[low] + part * (across[low + 1] - across[low])
    return result
