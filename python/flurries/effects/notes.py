"""An artist's notes on snow and rain: where flakes are, which are hidden, what they go around."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flurries import _contract as check
from flurries._contract import Array, Float64, real, suggesting
from flurries._kept import kept
from flurries.camera.path import CameraPath
from flurries.frame.view import Frame
from flurries.io import fit, open_background
from flurries.io.color import to_unit
from flurries.io.files import file_of, path_text
from flurries.io.pictures.reader import luminance
from flurries.io.sources import Source
from flurries.motion.keys import Keys, Vector, as_number, as_vector, value_at

if TYPE_CHECKING:
    from flurries.effects.weather import Film

_SOFT = 0.07  # By so much of a depth, on either side, flakes go over from one law to the other.


@suggesting
@dataclass(frozen=True, eq=False)
class Where:
    """Where over a picture there are flakes, and from which depth to which that counts.

    Parameters
    ----------
    source : path, array, function or float
        Shares of the flakes that are there, 0 to 1: of a picture the luminance, fitted as the
        background is (a sequence by the shot's frame numbers); an array (H, W) of the frame's own
        pixels; a function of x and y, arrays from 0 to 1 across and down the frame; or one number,
        keyed if you like.
    near, far : float
        Depths in metres between which it counts; outside all flakes are there.

    Examples
    --------
    >>> import flurries as fl
    >>> under = fl.effects.Where(lambda x, y: y < 0.5, near=4.0)
    >>> snow = fl.Snow("heavy", where=under)
    """

    source: Any
    near: float = 0.0
    far: float = math.inf

    def __post_init__(self) -> None:
        near, source = real("near", self.near, low=0.0), self.source
        if self.far != math.inf:
            real("far", self.far, above=near)
        if isinstance(source, (str, os.PathLike)):
            source = os.fspath(source)
            _opened(source)
        elif isinstance(source, np.ndarray):
            source = _share_of(source)
        elif not callable(source):
            source = as_number("where", source, low=0.0, high=1.0)
        vars(self).update(source=source, near=near, far=float(self.far))

    def shares(self, shape: tuple[int, int], t: float) -> Array:
        """Return the shares over a frame, (H, W) float32."""
        if isinstance(self.source, (Keys, float)):
            return np.full(shape, value_at(self.source, t), np.float32)
        files, place = isinstance(self.source, str), 0
        if files and (count := _opened(self.source).count) is not None:
            first = getattr(_opened(self.source), "first", 0)
            place = min(max(math.floor(t) - first, 0), count - 1)
        return _plane(self, shape, place)

    @property
    def depths(self) -> tuple[float, ...]:
        """The depths between which it begins to count, and between which it ends again."""
        ends = self.near, min(self.far, 1e15)
        return tuple(depth * part for depth in ends for part in (1.0 - _SOFT, 1.0 + _SOFT))


def as_where(name: str, value: Any) -> Where:
    return value if isinstance(value, Where) else Where(value)


@kept(16)
def _opened(path: str) -> Source:
    with file_of("where"):
        return open_background(path_text("where", path))


def _share_of(plane: Array) -> Array:
    found = np.array(to_unit(plane), np.float32, order="C")
    if found.ndim != 2 or 0 in found.shape:
        raise ValueError(f"where must have shape (H, W), got {found.shape}")
    check.finite("where", found)
    check.shares("where", found)
    return check.sealed(found)


@kept(8)
def _plane(where: Where, shape: tuple[int, int], place: int) -> Array:
    source = where.source
    if isinstance(source, str):
        with file_of("where"):
            plane = luminance(_opened(source).frame(place))
        plane = plane if plane.shape == shape else fit(plane, shape[::-1])
        return _share_of(np.clip(plane, 0.0, 1.0))
    if callable(source):
        (height, width) = shape
        x, y = (np.arange(width) + 0.5) / width, (np.arange(height)[:, None] + 0.5) / height
        given = np.asarray(source(*np.broadcast_arrays(x, y)), np.float32)
        return _share_of(np.broadcast_to(given, shape))
    if source.shape != shape:
        raise ValueError(f"where must have shape {shape}, got {source.shape}")
    return np.asarray(source)


def depths_of(name: str, value: Any) -> tuple[float, ...]:
    depths = tuple(real(name, depth, above=0.0) for depth in np.ravel(value).tolist())
    if not depths or list(depths) != sorted(set(depths)):
        raise ValueError(f"{name} must be depths in metres that increase, got {value!r}")
    return depths


@suggesting
@dataclass(frozen=True, eq=False)
class Body:
    """A ball or a box in the air, which drawn flakes go around.

    The flakes that would be in it are outside of it, as close as no volume of the air changes: on
    its way out from the middle a flake at r goes to the cube root of r^3 + R^3, R being how far the
    body reaches there.

    Parameters
    ----------
    place : (x, y, z) or Keys
        Its middle, metres, x right, y down, z ahead, from the camera's place at frame 0. Keyed for
        one that moves.
    size : float or (x, y, z)
        Diameter of a ball, or the sides of a box, metres.

    Examples
    --------
    >>> import flurries as fl
    >>> car = fl.Keys([(0, (-9.0, 0.6, 7.0)), (48, (9.0, 0.6, 7.0))])
    >>> snow = fl.Snow("heavy", wakes=[fl.effects.Body(car, (4.2, 1.4, 1.8))])
    """

    place: Vector
    size: float | tuple[float, float, float]

    def __post_init__(self) -> None:
        ball = np.ndim(self.size) == 0
        given = [self.size] if ball else check.vector("size", self.size, 3).tolist()
        sides = tuple(real("size", side, above=0.0) for side in given)
        place = as_vector("place", self.place, 3)
        vars(self).update(place=place, size=sides[0] if ball else sides)

    @property
    def half(self) -> Float64:
        return np.broadcast_to(0.5 * np.asarray(self.size), 3)

    def farthest(self, path: CameraPath, fps: float) -> float:
        """Return how far from the camera it moves flakes, at its own keys and the camera's."""
        times = [0.0, *path.course(fps).knots]
        times += [t for t, _ in self.place.keys] if isinstance(self.place, Keys) else []
        ways = (np.subtract(value_at(self.place, t), path.place(t, fps=fps)) for t in times)
        return max(float(np.linalg.norm(way)) for way in ways) + 3.0 * float(max(self.half))


def as_bodies(name: str, value: Any) -> tuple[Body, ...]:
    bodies = tuple(value) if isinstance(value, (tuple, list)) else (value,)
    if not all(isinstance(one, Body) for one in bodies):
        raise TypeError(f"{name} must be flurries.effects.Body objects, got {value!r:.80}")
    return bodies


def as_ids(name: str, value: Any) -> tuple[int, ...]:
    return tuple(check.integer(name, one, low=0, high=2**53) for one in np.ravel(value).tolist())


def as_placed(name: str, value: Any) -> tuple[tuple[float, ...], ...]:
    empty = isinstance(value, (tuple, list)) and not value
    rows = np.empty((0, 5)) if empty else check.table(name, value)
    if rows.shape[1] != 5 or (rows[:, 4] <= 0.0).any():
        raise ValueError(f"{name} must have rows (frame, x, y, z, diameter), got {value!r:.80}")
    return tuple(map(tuple, rows.tolist()))


class Mask(NamedTuple):
    shares: Array  # (H, W) float32: of the flakes that are there.
    depths: tuple[float, ...]  # (4,): as :attr:`Where.depths`.


class Wake(NamedTuple):
    at: list[list[float]]  # Its middle relative to the camera at each time, house axes, metres.
    half: list[float]  # Half its sides, metres.
    round: bool


class Asked(NamedTuple):
    """The notes of a frame, as the kernel reads them."""

    between: tuple[float, float]  # Depths between which flakes show, metres.
    hidden: Sequence[int]  # Identities, in order.
    mask: Mask | None
    bodies: Sequence[Wake]


@dataclass(frozen=True, eq=False)
class Notes:
    where: Where | None = None
    hide: tuple[int, ...] = ()
    place: tuple[tuple[float, ...], ...] = ()
    wakes: tuple[Body, ...] = ()
    between: tuple[float, float] = (0.0, math.inf)  # Depths that show, metres.
    edges: tuple[float, ...] = (0.0,)  # The nearest depths of all layers, metres.

    def asked(self, frame: Frame, times: Sequence[float]) -> Asked:
        where = self.where
        mask = None if where is None else Mask(where.shares(frame.shape, frame.t), where.depths)
        bodies, eyes = [], [frame.path.place(t, fps=frame.fps) for t in times]
        for body in self.wakes:
            at = np.subtract([value_at(body.place, t) for t in times], eyes)
            bodies.append(Wake(at.tolist(), body.half.tolist(), np.ndim(body.size) == 0))
        return Asked(self.between, sorted(self.hide), mask, bodies)

    def reach(self, path: CameraPath, fps: float) -> float:
        """Return the depth up to which flakes are drawn, so that they can go around bodies."""
        return max((body.farthest(path, fps) for body in self.wakes), default=0.0)

    def parts(self, film: Film, between: tuple[float, float] | None = None) -> Float64:
        """Return the share of each layer of the texture that lies in the depths that show, (L,)."""
        near, far = np.array([(slab.near, slab.far) for slab in film.slabs]).reshape(-1, 2).T
        low, high = (np.clip(depth, near, far) for depth in between or self.between)
        return np.asarray((high - low) / (far - near))

    def thinned(self, frame: Frame, film: Film, read: Any) -> Array:
        """Return the opacity of the texture, (h, w) float32, from what reads shares of layers."""
        if not self.parts(film).any():
            return np.zeros(frame.size, np.float32)
        left = self._left(film, read, np.ones(len(film.depths)))
        if self.where is not None:
            counts = (film.depths >= self.where.near) & (film.depths < self.where.far)
            thin = left if counts.all() else np.clip(self._left(film, read, counts), left, 1.0)
            rest = np.divide(left, thin, out=np.zeros_like(left), where=thin > 0.0)
            left = rest * thin ** frame.crop(self.where.shares(frame.shape, frame.t))
        return np.asarray(1.0 - left)

    def _left(self, film: Film, read: Any, counts: Array) -> Array:
        """Return the light that the layers leave which show, (h, w) float32."""
        if film.rigid or self.between == (0.0, math.inf):
            return np.asarray(1.0 - read(self.parts(film) * counts))
        # A plane may be below 0 where others make up for it: what lies from a depth on lets through
        # no less than the whole, and no more than what is farther.
        whole = np.asarray(1.0 - read(counts))
        beyond = own = np.ones_like(whole)
        for low in [depth for depth in reversed(self.edges) if depth >= self.between[0]]:
            from_there = 1.0 - read(self.parts(film, (low, math.inf)) * counts) if low else whole
            beyond, own = own, np.clip(from_there, whole, own)
        return np.asarray(np.divide(own, beyond, out=np.ones_like(own), where=beyond > 0.0))
