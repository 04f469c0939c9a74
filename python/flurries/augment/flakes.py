"""Flakes and drops before a camera that stands still, each on its own way through the picture.

Seen by a camera that does not come nearer, what falls keeps its depth and crosses the picture at a
constant speed. So particles are drawn in the picture: a depth from the view's own distribution, a
place on a torus a little larger than the picture, a motion of focal / depth times the velocity.
None is wasted outside the view, and each has its exact motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.camera.lens import Camera
from flurries.particles.population import FADE, drawn_share

# Nearer ones would fill the picture, and fade as out-of-focus puffs do.
NEAREST = 0.4

# Widths in pixels of a picture 1024 px wide over which they fade.
_LARGEST_SIGMA = (9.0, 14.0)

_STREAM = 7001
_DEPTHS = np.linspace(0.0, 1.0, 129)


@dataclass(frozen=True)
class Cloud:
    """The particles of a weather: their density, depths and sizes.

    Attributes
    ----------
    density : float
        Per cubic metre.
    near : float
        Depth of the nearest, metres.
    reach : float
        Depth from which on fewer and fewer are drawn, metres; none from the end of the hand-over.
    far : float
        Depth at which there are no more of them, metres.
    sizes : tuple of float
        Diameters at even shares of them, metres; a drawn one's disc ends at three deviations.
    opacity : float
        Of a resting one's middle.
    times : int
        As dense as so many of them at one place.
    covered : float
        What they cover, all these together, over the sum of what each covers.
    sway : (amplitude, rate)
        Metres, and radians per second.
    """

    density: float
    near: float
    reach: float
    far: float
    sizes: tuple[float, ...]
    opacity: float
    times: int = 1
    covered: float = 1.0
    sway: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Flakes:
    """Particles at one time.

    Attributes
    ----------
    points : (n, 3)
        Metres in the camera's axes.
    radius, opacity : (n,)
    velocity : (3,)
        Metres per second.
    cover : (n,)
        The share of the picture that each is expected to cover.
    angle : (n,)
        Where each is in its swing, radians.
    swing : float
        The fastest of the swing, metres per second.
    times : int
        As in the cloud.
    """

    points: Float64
    radius: Float64
    opacity: Float64
    velocity: Float64
    cover: Float64
    angle: Float64
    swing: float
    times: int = 1

    def part(self, which: Array) -> Flakes:
        """Return some of them."""
        return replace(
            self, points=self.points[which], radius=self.radius[which],
            opacity=self.opacity[which], cover=self.cover[which], angle=self.angle[which],
        )  # fmt: skip

    def rates(self) -> Float64:
        """Return the particles' velocities, (2, n) metres per second."""
        own = np.stack([self.swing * np.cos(self.angle), np.zeros_like(self.angle)])
        return np.asarray(self.velocity[:2, None] + own)

    def before(self, depth: Float64) -> Float64:
        """Return the share of light from depths (n,) that passes: exp of minus the cover."""
        if len(depth) == 1:
            return np.exp([-self.cover[self.points[:, 2] < depth[0]].sum()])
        order = np.argsort(self.points[:, 2])
        covered = np.concatenate([[0.0], np.cumsum(self.cover[order])])
        return np.asarray(np.exp(-covered[np.searchsorted(self.points[order, 2], depth)]))


def flakes_at(
    cloud: Cloud,
    shape: tuple[int, int],
    camera: Camera,
    *,
    seed: int,
    velocity: Float64,
    time: float,
    exposure: float,
    eyes: float,
) -> Flakes | None:
    """Return the particles at a time, without those that are faded out; None if there are none.

    Parameters
    ----------
    velocity : (3,)
        Metres per second, the third 0.
    time, exposure : float
        Seconds.
    eyes : float
        Distance of the farthest eye from the camera's own place, metres.
    """
    height, width = shape
    focal = camera.focal
    speed = float(np.hypot(velocity[0], velocity[1]))
    # So far outside the picture a particle is still seen in it, by any eye.
    room = 2.0 * cloud.sizes[-1] + speed * exposure + cloud.sway[0] + eyes
    soft = 4.0 * max(width, height) / 1024.0 + 4.0
    end = min((1.0 + FADE) * cloud.reach, cloud.far)
    table, squares = _law(cloud.near, end, cloud.reach, cloud.far)
    # The picture and its margins at a depth, in powers of that: (w + a / z) (h + a / z) z^2.
    w, h, a = width + 2.0 * soft, height + 2.0 * soft, 2.0 * room * focal
    sums = (w * h) * squares[0] + (a * (w + h)) * squares[1] + (a * a) * squares[2]
    step = (end - cloud.near) / (len(table) - 1)
    number = round(cloud.density * float(sums[-1]) * step / focal**2)
    if number < 1:
        return None
    points, parts = np.empty((number, 3)), np.empty((number, 4))
    scale = max(width, height) / 1024.0
    seen = _core.particle_crossing(
        points, parts, seed, _STREAM, table, sums,
        (width, height, focal, room, soft),
        (float(velocity[0] * time), float(velocity[1] * time)),
        (cloud.sway[0], cloud.sway[1] * time), list(cloud.sizes), cloud.opacity,
        (scale * _LARGEST_SIGMA[0], scale * _LARGEST_SIGMA[1]),
    )  # fmt: skip
    radius, opacity, cover, angle = parts[:seen].T.copy()
    cover *= cloud.times * cloud.covered
    swing = cloud.sway[0] * cloud.sway[1]
    return Flakes(points[:seen], radius, opacity, velocity, cover, angle, swing, cloud.times)


@lru_cache(maxsize=64)
def _law(near: float, end: float, reach: float, far: float) -> tuple[Float64, Float64]:
    """Return depths, and the sums up to each of the share that is drawn times z^2, z and 1."""
    table = near + (end - near) * _DEPTHS
    powers = drawn_share(table, reach, far) * np.stack([table**2, table, np.ones(len(table))])
    sums = np.zeros(powers.shape)
    np.cumsum(0.5 * (powers[:, 1:] + powers[:, :-1]), axis=1, out=sums[:, 1:])
    return table, sums
