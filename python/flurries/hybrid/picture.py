"""Pictures of a population: every flake, or the particles and the texture that stand for it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flurries import particles
from flurries._contract import (
    LARGEST,
    Array,
    Float64,
    float_dtype,
    integer,
    output,
    pixels,
    real,
    seed_of,
    shape_of,
    vector,
)
from flurries._core import uniform
from flurries.camera.lens import Camera, expect_camera
from flurries.camera.tiles import tile_drift
from flurries.hybrid.matching import Match
from flurries.hybrid.population import Population, particle_share
from flurries.hybrid.statistics import expect_population
from flurries.spectral.frame import alpha_of, request

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
        Of the result.
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
        size, snow, camera, seed_of(seed), place, rate, exposure, snow.depth[1], None, wall, dtype,
        out,
    )  # fmt: skip


def render(
    shape: tuple[int, int],
    match: Match,
    camera: Camera,
    *,
    seed: int,
    displacement: npt.ArrayLike = (0.0, 0.0, 0.0),
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    shutter: float = 0.0,
    depth: npt.ArrayLike | None = None,
    parts: str = "both",
    tile: int | None = None,
    overlap: int | None = None,
    alias: str = "keep",
    jitter: bool = False,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:
    """Alpha of the hybrid that :func:`match` has found: few particles, and the texture.

    Parameters
    ----------
    shape, camera, seed, displacement, velocity, shutter, dtype, out
        See :func:`simulate`. The camera must have the focal length that was matched.
    depth : (H, W), optional
        Depth of what stands in the picture, world units. It hides the particles behind it; of the
        texture it leaves the share of the coverage that lies before it.
    match : Match
        What to draw.
    parts : {"both", "texture", "particles"}
        Which halves.
    tile, overlap : int, optional
        Of the texture, pixels; four of the longest waves and an eighth of that if not given. Take
        smaller tiles where the camera moves forward.
    alias, jitter
        See :func:`flurries.spectral.field`. Fast flakes seem to run backwards at times, and with
        "keep" so do their waves; "soft" drops these, and most of the contrast of fast snow.

    Returns
    -------
    (H, W) float32 or float64
        Opacity from 0 to 1.

    Raises
    ------
    TypeError, ValueError
        For an argument that is not as described; the message names it.
    """
    size, place, rate, exposure = _asked(shape, camera, displacement, velocity, shutter)
    if not isinstance(match, Match):
        raise TypeError(f"match must be what hybrid.match gives, got {match!r}")
    if abs(camera.focal / match.focal - 1.0) > 1e-9:
        raise ValueError(
            f"camera must have the focal length that was matched, {match.focal:g} px, "
            f"got {camera.focal:g}"
        )
    if parts not in ("both", "texture", "particles"):
        raise ValueError(f"parts must be 'both', 'texture' or 'particles', got {parts!r}")
    number, kind = seed_of(seed), float_dtype(dtype)
    wall = _wall(depth, size)
    result = output(out, size, kind, *([] if wall is None else [wall]))
    if parts != "particles":
        result[...] = _texture(
            size, match, camera, number, place, rate, exposure, tile, overlap, alias, jitter, kind
        )
        if wall is not None:
            # Optical depths add up along the way, and the texture's lies evenly along it.
            share = match.before(wall).astype(kind)
            result[...] = -np.expm1(share * np.log1p(-np.minimum(result, 1.0 - 1e-7)))
        if parts == "texture":
            return result
    snow, (low, _) = match.population, match.handover
    reach = min(snow.depth[1], match.focal * snow.radius[1] / (3.0 * low))
    if parts == "both" and reach <= snow.depth[0]:
        return result
    drawn = _drawn(
        size, snow, camera, number, place, rate, exposure, reach, match.handover, wall, kind, None
    )
    result[...] = drawn if parts == "particles" else 1.0 - (1.0 - result) * (1.0 - drawn)
    return result


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


def _texture(
    shape: tuple[int, int],
    match: Match,
    camera: Camera,
    seed: int,
    place: Float64,
    rate: Float64,
    shutter: float,
    tile: int | None,
    overlap: int | None,
    alias: str,
    jitter: bool,
    dtype: np.dtype[np.generic],
) -> Array:
    longest = match.wavelengths[1]
    side = integer("tile", 4 * round(longest) if tile is None else tile, low=5, high=2**15)
    shared = side // 8 if overlap is None else overlap
    speeds = np.array(match.ring_speeds)
    # A velocity has no eye: take away what tile_drift adds for one.
    drift, velocity = (
        tile_drift(shape, vector_, camera, near_depth=match.near_depth, tile=side, overlap=shared)[
            :, :, np.newaxis
        ]
        * speeds[:, np.newaxis]
        for vector_ in (place, rate - np.array(camera.offset))
    )
    asked = request(
        shape,
        drift=drift,
        velocity=velocity,
        shift=camera.center_shift,
        seed=seed,
        tile=side,
        overlap=shared,
        wavelengths=match.wavelengths,
        exponent=match.exponent,
        ring_edges=match.ring_edges,
        ring_gains=match.ring_gains,
        alias=alias,
        shutter=shutter,
        jitter=jitter,
    )
    mapped = (match.mean, match.spread, match.power, match.amount)
    return alpha_of(asked, mapped, preserve_mean=True, dtype=dtype)


def _drawn(
    shape: tuple[int, int],
    population: Population,
    camera: Camera,
    seed: int,
    place: Float64,
    rate: Float64,
    shutter: float,
    far: float,
    handover: tuple[float, float] | None,
    wall: Array | None,
    dtype: npt.DTypeLike,
    out: Array | None,
) -> Array:
    """Draw the flakes up to a depth; with a handover, only their particles' share."""
    near = population.depth[0]
    if far <= near:
        result = output(out, shape, float_dtype(dtype))
        result[...] = 0.0
        return result
    box, middle = _box(shape, population, camera, far)
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
    if handover is not None:
        weight *= particle_share(camera.focal * radius / (3.0 * np.maximum(depth, near)), handover)
    seen = weight > 0.0
    if not seen.all():
        points, radius, weight = points[seen], radius[seen], weight[seen]
    return particles.splat(
        shape, points, radius, camera, opacity=population.opacity * weight, velocity=-rate,
        shutter=shutter, near=0.5 * near, depth=wall, dtype=dtype, out=out,
    )  # fmt: skip


def _box(
    shape: tuple[int, int], population: Population, camera: Camera, far: float
) -> tuple[Float64, tuple[float, float, float]]:
    """Return the sides of a box around the view up to a depth, and its middle.

    It depends on neither eye nor motion, since with its sides every flake's place would change. The
    walls aside lie beyond the view by the nearest depth: room for the eyes, for convergence and for
    the way during an exposure. The near and the far wall lie where flakes have faded.
    """
    near = population.depth[0]
    height, width = shape
    cx, cy = (width / 2, height / 2) if camera.center is None else camera.center
    # Four sigma of the drawn Gaussian, at most those of the flake and of a pixel together.
    room = near + 4.0 * (population.radius[1] / 3.0 + far / camera.focal)
    reach = far / camera.focal
    across, down = (2.0 * (max(c, n - c) * reach + room) for c, n in ((cx, width), (cy, height)))
    return np.array([across, down, far - near]), (0.0, 0.0, 0.5 * (near + far))
