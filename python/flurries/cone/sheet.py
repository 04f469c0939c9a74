"""What a pixel sees of a double cone: where its ray meets it, and one texture, filtered exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _contract as check
from flurries import _core
from flurries._contract import Array, ArrayLike, Float64
from flurries.camera.lens import Camera, expect_camera

MOST_REPEATS = 4096
LARGEST_TILE = 4096

# What a kernel needs to know of a camera in a cone: focal, cx, cy, rotation, axis, slope, eye.
Pose: TypeAlias = tuple[
    float, float, float, list[float], tuple[float, ...], float, tuple[float, ...]
]

# An eye further off the middle than this share of the radius may see the cone from outside.
FARTHEST_EYE = 0.5


@dataclass(frozen=True)
class Rays:
    """The point of the cone that every pixel sees: planes (H, W) or rows (n,) of float64.

    Attributes
    ----------
    azimuth, height
        Turns around the axis, in [0, 1), and the place along it over the cone's radius, ``s / (c +
        slope |s|)`` of a ray with s along and c across it.
    azimuth_step, height_step
        How much each changes from pixel to pixel: the lengths of their gradients in the picture.
    fade
        How much is shown, 1 up to 82 degrees from the equator, 0 from 89.4 degrees on.
    """

    azimuth: Float64
    height: Float64
    azimuth_step: Float64
    height_step: Float64
    fade: Float64


def rays(
    shape: tuple[int, int], camera: Camera, *, axis: ArrayLike, slope: float = 0.0,
    radius: float = math.inf, points_px: ArrayLike | None = None,
) -> Rays:  # fmt: skip
    """Return the places on a double cone that the pixels see; arguments as of :func:`layer`.

    `points_px` (n, 2) are positions (x, y) in the picture, in place of every pixel's centre.
    """
    size = check.shape_of("shape", shape)
    given = pose(size, camera, axis, slope, radius)
    wanted: tuple[int, ...] = size
    if points_px is None:
        places = np.mgrid[: size[0], : size[1]][::-1].reshape(2, -1).T + 0.5
    else:
        places = check.rows_of("points_px", points_px, 2)
        wanted = (len(places),)
    values = np.empty((len(places), 5))
    _core.cone_rays(values, np.ascontiguousarray(places), given)
    return Rays(*(np.ascontiguousarray(column).reshape(wanted) for column in values.T))


def pose(
    shape: tuple[int, int], camera: Camera, axis: ArrayLike, slope: float, radius: float
) -> Pose:
    """Return the pose of a camera in a cone, as a kernel takes it."""
    view = expect_camera(camera)
    x, y = view.principal(shape)
    cone = check.real("slope", slope, low=0.0, high=1e6)
    way = check.vector("axis", axis, 3)
    if not way.any():
        raise ValueError(f"axis must not be zero, got {tuple(way.tolist())}")
    # No negative zeros.
    eye = np.array(view.offset) / reach_of(radius) + 0.0
    if float(np.linalg.norm(eye)) * (1.0 + cone) > FARTHEST_EYE:
        raise ValueError(
            f"radius must be at least {(1.0 + cone) / FARTHEST_EYE:g} times the length of "
            f"camera.offset {view.offset}, got {radius!r}"
        )
    rotation = view.matrix().ravel().tolist()
    return view.focal, x, y, rotation, tuple(way.tolist()), cone, tuple(eye.tolist())


def reach_of(radius: object) -> float:
    if isinstance(radius, float) and radius == math.inf:
        return math.inf
    return check.real("radius", radius, above=0.0)


def layer(
    shape: tuple[int, int], camera: Camera, tile: ArrayLike, *, axis: ArrayLike,
    phase: float, stretch: float = 1.0, slope: float = 0.0, repeats: int = 4,
    offset: tuple[float, float] = (0.0, 0.0), gain: float = 1.0, conserve: bool = True,
    radius: float = math.inf, dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """Return the alpha of one texture on a double cone around the camera (Wang 2004, corrected).

    A pixel at azimuth a (turns) and height w sees the texture around
    ``(a repeats + offset_x, repeats / (2 pi) w / stretch - phase + offset_y)``, tiles: the mean of
    a box as large as the pixel, and at least one texel, in float64. Alpha is (H, W), 0 to 1;
    against 10 x 10 supersampling the mean error is below 0.012.

    Parameters
    ----------
    tile : (n, n)
        Toroidal opacities, 0 to 1; rows run along the axis. See :func:`rain_tile`.
    axis, phase : (3,) and float
        From :func:`path`: where the drops go, seen from the camera, house axes, and how far the
        texture has moved along it, tiles.
    stretch : float
        How many times as long a drop is along the axis as in the tile, more than 0.
    slope : float
        Radius over height of the cone, 0 or more. On a cylinder, 0, images move exactly as those of
        points in space, on others faster by ``(1 + slope tan e)^2`` at elevation e.
    repeats : int
        Number of tiles around the cone, 1 to 4096.
    offset : (x, y)
        Shift of the texture in tiles, so that layers of one texture differ.
    gain : float
        Factor of the opacity, 0 or more; `conserve` also divides it by `stretch`, so that the light
        of a drop stays the same.
    radius : float
        Of the cone, world units; it matters for a camera with an `offset` only.
    """
    size = check.shape_of("shape", shape)
    kind = check.float_dtype(dtype)
    texture = texture_of(tile)
    length = check.real("stretch", stretch, low=1e-6, high=1e6)
    given = pose(size, camera, axis, slope, radius)
    place = check.vector("offset", offset, 2)
    strength = check.real("gain", gain, low=0.0, high=1e6)
    if check.flag("conserve", conserve):
        strength /= length
    result = check.output(out, size, kind, texture)
    sheet = (
        check.integer("repeats", repeats, low=1, high=MOST_REPEATS),
        wrapped(check.real("phase", phase)), length,
        (wrapped(float(place[0])), wrapped(float(place[1]))), strength,
    )  # fmt: skip
    _core.cone_layer(result, texture, given, sheet)
    return result


def wrapped(tiles: float) -> float:
    """Return a place in tiles without whole tiles, in [0, 1)."""
    part = math.fmod(tiles, 1.0)
    part = part + 1.0 if part < 0.0 else part
    return 0.0 if part >= 1.0 else part


def texture_of(tile: Any) -> Float64:
    """Return a square, finite texture of opacities in float64."""
    texture, _ = check.pixels("tile", tile, ndim=2)
    if texture.shape[0] != texture.shape[1]:
        raise ValueError(f"tile must be square, got shape {texture.shape}")
    if len(texture) > LARGEST_TILE:
        raise ValueError(f"tile must be at most {LARGEST_TILE} texels wide, got {len(texture)}")
    texture = np.ascontiguousarray(texture, dtype=np.float64)
    check.shares("tile", texture)
    return texture


# Streams of counter-based numbers: places, sizes, opacities.
ACROSS, ALONG, SIZE, OPACITY = 311, 312, 313, 314

MOST_DROPS = 1_000_000


def rain_tile(
    size: int, *, seed: int, drops: int = 220, width: float = 0.003, length: float = 0.03,
    spread: float = 0.5, opacity: float = 0.8, dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:  # fmt: skip
    """Return a toroidal texture of raindrops, (n, n): ``1 - prod(1 - alpha_i)``, without an edge.

    Parameters
    ----------
    size, drops : int
        n, texels to a side, 4 to 4096; and how many drops.
    width, length : float
        Of a drop, in tiles: two sigma of a Gaussian, below a texel wider and fainter; and along the
        axis, 0 to 0.5, which the cone's `stretch` makes longer.
    spread : float
        Spread of sizes, 0 to 1: drops are ``1 - spread / 2`` to ``1 + spread / 2`` times as large.
    opacity : float
        Opacity in the middle of a drop, 0 to 1, with the same spread.
    """
    rows = _sprites(size, "drops", drops, seed, width, spread, opacity)
    rows[:, 3] = 0.5 * size * check.real("length", length, low=0.0, high=0.5)
    rows[:, 3] *= rows[:, 2] / max(0.5 * size * width, 1e-300)
    return _drawn(size, rows, dtype, out)


def snow_tile(
    size: int, *, seed: int, flakes: int = 160, width: float = 0.012, spread: float = 0.9,
    opacity: float = 0.85, dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """Return a toroidal texture of snowflakes: Gaussian discs.

    Arguments are those of :func:`rain_tile`; `width` is two sigma of a flake, tiles.
    """
    rows = _sprites(size, "flakes", flakes, seed, width, spread, opacity)
    return _drawn(size, rows, dtype, out)


def _sprites(
    size: int, name: str, many: int, seed: int, width: float, spread: float, opacity: float
) -> Float64:
    """Return rows (u, v, sigma, half length, opacity) in texels."""
    texels = check.integer("size", size, low=4, high=LARGEST_TILE)
    count = check.integer(name, many, low=0, high=MOST_DROPS)
    chosen, streams = check.seed_of(seed), (ACROSS, ALONG, SIZE, OPACITY)
    draw = [check.uniforms(chosen, stream, count) for stream in streams]
    differ = check.real("spread", spread, low=0.0, high=1.0)
    peak = check.real("opacity", opacity, low=0.0, high=1.0)
    rows = np.zeros((count, 5))
    rows[:, 0], rows[:, 1] = texels * draw[0], texels * draw[1]
    rows[:, 2] = 0.5 * texels * check.real("width", width, above=0.0, high=1.0)
    rows[:, 2] *= 1.0 + differ * (draw[2] - 0.5)
    rows[:, 4] = peak * (1.0 - differ * draw[3] / 2.0)
    return rows


def _drawn(size: int, rows: Float64, dtype: npt.DTypeLike, out: Array | None) -> Array:
    result = check.output(out, (size, size), check.float_dtype(dtype))
    _core.cone_tile(result, check.aligned(rows, np.float64))
    return result


Table: TypeAlias = npt.NDArray[np.uint32]  # Words of four neighbours: see src/cone/table.rs.
MOST_WORDS = 1 << 26  # Memory of filtered tables that a texture keeps, in words.


class Texture:
    """A toroidal texture (n, n) of opacities, copied, and its filtered copies for many frames."""

    def __init__(self, tile: npt.ArrayLike) -> None:
        self.tile = texture_of(tile).copy()
        self.tile.flags.writeable = False
        # Full scale of the tables; a texture without drops has no other.
        self._peak = float(self.tile.max()) or 1.0
        # A box larger than the tile is its mean: two levels to a factor of two.
        self._levels = 2 * math.ceil(math.log2(len(self.tile))) + 1
        self._tables: dict[tuple[int, int], Table] = {}

    def __reduce__(self) -> tuple[type[Texture], tuple[Array]]:
        return Texture, (np.array(self.tile),)

    def _table(self, across: int, along: int) -> Table:
        """Return the table of a level, made when first asked for."""
        found = self._tables.get((across, along))
        if found is not None:
            return found
        size = len(self.tile)
        width, height = 2.0 ** (0.5 * across), 2.0 ** (0.5 * along)
        # Two entries are at most half a box apart.
        shape = _power(min(size, 2.0 * size / height)), _power(min(size, 2.0 * size / width))
        entries = np.empty(shape, np.uint32)
        narrow = _narrowed(width, size, shape[1]), _narrowed(height, size, shape[0])
        _core.cone_table(entries, self.tile, narrow[0], narrow[1], self._peak)
        if sum(kept.size for kept in self._tables.values()) + entries.size > MOST_WORDS:
            # A new dictionary: another thread may be reading the old one.
            self._tables = {}
        self._tables[across, along] = entries
        return entries


def _narrowed(width: float, size: int, count: int) -> float:
    """Return the box, in texels, that looks `width` wide where `count` entries are gone between."""
    # Going linearly between entries h apart blurs by h^2 / 6 in the mean; a texel's own width is 1
    # / 12. What is left of the variance of a box over texels is that of shares of whole texels.
    step = size / count
    wanted = (width**2 + 1.0) / 12.0 - step**2 / 6.0
    low, high = 1.0, max(width, 1.0)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _shares(middle, step) < wanted else (low, middle)
    return 0.5 * (low + high)


def _shares(width: float, step: float) -> float:
    """Return the variance of a box over texels, around the place of an entry."""
    # Entries stand in the middle of texels, or for an even number to an entry between two.
    middle = 0.5 if step <= 1.0 else 0.5 * step % 1.0
    edges = np.arange(-math.ceil(width), math.ceil(width) + 1.0)
    low, high = np.maximum(edges, middle - width / 2), np.minimum(edges + 1, middle + width / 2)
    part = np.maximum(high - low, 0.0) / width
    return float(part @ (edges + 0.5 - middle) ** 2)


def _power(count: float) -> int:
    """Return the least power of two that is not less, 2 at least."""
    return max(2, int(2 ** math.ceil(math.log2(count) - 1e-9)))
