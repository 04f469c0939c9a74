"""Pictures of a population: every flake, one by one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flurries import particles
from flurries._contract import (
    LARGEST,
    Array,
    Float64,
    float_dtype,
    pixels,
    real,
    seed_of,
    shape_of,
    vector,
)
from flurries._core import uniform
from flurries.camera.lens import Camera, expect_camera
from flurries.hybrid.population import Population
from flurries.hybrid.statistics import expect_population

# The stream of numbers that sizes are drawn from.
SIZES = 101

# More flakes in the box than this are refused: 24 bytes each.
MOST = 420_000_000


def simulate(
    shape: tuple[int, int],
    population: Population,
    camera: Camera,
    *,
    seed: int,
    displacement: npt.ArrayLike = (0.0, 0.0, 0.0),
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    shutter: float = 0.0,
    depth: npt.ArrayLike | None = None,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """Alpha of fully simulated snow: every flake of a population, one by one.

    Parameters
    ----------
    shape : (H, W)
        Pixels.
    population : Population
        The flakes.
    camera : Camera
        Its focal length, principal point and offset are used.
    seed : int
        Any int64.
    displacement : (x, y, z)
        Camera minus air since time 0 in camera axes, world units.
    velocity : (x, y, z)
        Its change per frame; of use with `shutter`.
    shutter : float
        Exposure, frames, centred on the frame.
    depth : (H, W), optional
        Depth of what stands in the picture, world units; it hides the flakes behind it.
    dtype : float32 or float64
        Type of the result.
    out : (H, W), optional
        Array to write into and return.

    Returns
    -------
    (H, W) float32 or float64
        Opacity from 0 to 1.

    Raises
    ------
    TypeError, ValueError
        For an argument that is not as described, or a box of more than 420 million flakes.
    """
    size, place, rate, exposure = _asked(shape, camera, displacement, velocity, shutter)
    snow = expect_population(population)
    wall = _wall(depth, size)
    return _drawn(
        size, snow, camera, seed_of(seed), place, rate, exposure, wall, float_dtype(dtype), out
    )


def _asked(
    shape: object, camera: object, displacement: object, velocity: object, shutter: object
) -> tuple[tuple[int, int], Float64, Float64, float]:
    expect_camera(camera)
    return (
        shape_of("shape", shape),
        vector("displacement", displacement, 3),
        vector("velocity", velocity, 3),
        real("shutter", shutter, low=0.0, high=LARGEST),
    )


def _wall(depth: npt.ArrayLike | None, shape: tuple[int, int]) -> Array | None:
    if depth is None:
        return None
    wall, _ = pixels("depth", depth, ndim=2)
    if wall.shape != shape:
        raise ValueError(f"depth must have shape {shape}, got {wall.shape}")
    return wall


def _drawn(
    shape: tuple[int, int],
    population: Population,
    camera: Camera,
    seed: int,
    place: Float64,
    rate: Float64,
    shutter: float,
    wall: Array | None,
    dtype: np.dtype[np.generic],
    out: Array | None,
) -> Array:
    near = population.depth[0]
    box, middle = _box(shape, population, camera)
    expected = population.density * float(np.prod(box))
    if not expected <= MOST:
        raise ValueError(
            f"population: {expected:.3g} flakes in the box around the view; at most {MOST} are "
            "drawn"
        )
    count = round(expected)
    points = particles.positions(count, box, seed=seed, velocity=-place, time=1.0, center=middle)
    sizes = np.empty(count)
    uniform(sizes, seed, SIZES)
    small, large = population.radius
    radius = small + sizes * (large - small)
    depth = points[:, 2]
    weight = population.fade(depth)
    seen = weight > 0.0
    if not seen.all():
        points, radius, weight = points[seen], radius[seen], weight[seen]
    return particles.splat(
        shape, points, radius, camera, opacity=population.opacity * weight, velocity=-rate,
        shutter=shutter, near=0.5 * near, depth=wall, dtype=dtype, out=out,
    )  # fmt: skip


def _box(
    shape: tuple[int, int], population: Population, camera: Camera
) -> tuple[Float64, tuple[float, float, float]]:
    """Return the sides of a box around the view, and its middle.

    It depends on neither eye nor motion, since with its sides every flake's place would change. The
    walls aside lie beyond the view by the nearest depth: room for the eyes, for convergence and for
    the way during an exposure. The near and the far wall lie where flakes have faded.
    """
    near, far = population.depth
    height, width = shape
    cx, cy = (width / 2, height / 2) if camera.center is None else camera.center
    # Four sigma of the drawn Gaussian, at most those of the flake and of a pixel together.
    room = near + 4.0 * (population.radius[1] / 3.0 + far / camera.focal)
    reach = far / camera.focal
    across, down = (2.0 * (max(c, n - c) * reach + room) for c, n in ((cx, width), (cy, height)))
    return np.array([across, down, far - near]), (0.0, 0.0, 0.5 * (near + far))
