"""The image of a gas (Johnson 2005, section 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _contract as check
from flurries import _core
from flurries._contract import LARGEST, SMALLEST, Array, ArrayLike, Float64
from flurries.camera.lens import Camera, expect_camera

Footprint: TypeAlias = Literal["viewplane_c", "viewplane", "viewpoint", "volume", "table"]
Edge: TypeAlias = Literal["taper", "square"]
NearMode: TypeAlias = Literal["fade", "cull", "exact"]
Occlusion: TypeAlias = Literal["soft", "hard"]

# A pixel that lets through less than this is finished: below what the type can say of an opacity.
FINISHED = {"float32": 1e-6, "float64": 1e-13}


@dataclass(frozen=True)
class Gas:
    """Particles as the kernels take them: float64, rows for all or one for each."""

    centers: Float64
    radius: Float64
    density: Float64


def splat(
    shape: tuple[int, int], centers: ArrayLike, radius: ArrayLike, density: ArrayLike,
    color: ArrayLike, camera: Camera, *, footprint: Footprint = "viewplane_c",
    edge: Edge = "taper", near: float = 0.1, near_mode: NearMode = "fade",
    depth: ArrayLike | None = None, occlusion: Occlusion = "soft", error: float | None = None,
    dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """Return the image (H, W, 4) of a gas as a layer for `over` (Johnson 2005, sections 2 and 3).

    A particle is a Gaussian of sigma = radius / 3 in every direction. Its opacity on a pixel is
    ``density * g(q)``, q the distance from its middle in sigma as the `footprint` measures it. The
    layer has linear RGB multiplied by alpha, and alpha = 1 - prod(1 - alpha_i), 0 to 1. The nearer
    particle is in front ("viewpoint" and "volume": by distance), then the lower index.

    Parameters
    ----------
    centers : (n, 3)
        Middles in camera axes, world units, not yet turned.
    radius, density : float or (n,)
        Three sigma, and the opacity in the middle of a particle, 0 to 1.
    color : float, (3,), (n,) or (n, 3)
        Linear light, one or for each; three numbers are one color, which costs half.
    camera : Camera
        Its focal length, principal point and offset are used.
    footprint : str
        From cheap to exact (``docs/internals/effects.md`` has times and errors):

        - "table": the paper's Eq. 2, a table of 65 x 65 laid over whole pixels, for reference.
        - "viewplane": the paper's billboard, too thin off the axis by the cosine of the angle.
        - "viewplane_c": the same, widened so that the mean optical depth is right.
        - "viewpoint": a billboard that faces the eye, computed from each pixel's ray.
        - "volume": the line integral along each pixel's ray, from the near plane to `depth`.
    edge : {"taper", "square"}
        "taper" lowers footprints so that they end at zero at three sigma; "square" cuts them there
        as the paper does, with a step of 1.1 % of the density.
    near : float
        Depth before which nothing is drawn, world units, more than 0.
    near_mode : {"fade", "cull", "exact"}
        "fade": particles come in over a third of their radius behind `near`; "cull", the paper's:
        they pop; "exact": those nearer than four radii are drawn as "volume", for a camera in gas.
    depth : (H, W), optional
        Planar depth of what stands in the picture, world units; infinity where nothing does.
    occlusion : {"soft", "hard"}
        "soft" lets through the share of a particle that lies before `depth`; "hard" draws it where
        its middle is nearer, and cuts straight lines into walls.
    error : float, optional
        A tile of the picture is finished once no pixel lets through more than this, by which alpha
        then errs. If not given, 1e-6 for float32 and 1e-13 for float64.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> rng = np.random.default_rng(1)
    >>> middles = rng.uniform((-2.5, -2.5, 3), (2.5, 2.5, 8), (1200, 3))
    >>> fog = fl.gas.splat((240, 320), middles, 0.45, 0.4, 0.7, fl.Camera(280.0))
    >>> fog.shape, bool(fog[..., 3].max() > 0.9)
    ((240, 320, 4), True)
    """
    manner = footprint, edge, near, near_mode, occlusion, error
    gas = gas_of(centers, radius, density)
    return _drawn(shape, gas, colors_of(color, len(gas.centers)), camera, manner, depth, dtype, out)


def alpha(
    shape: tuple[int, int], centers: ArrayLike, radius: ArrayLike, density: ArrayLike,
    camera: Camera, *, footprint: Footprint = "viewplane_c", edge: Edge = "taper",
    near: float = 0.1, near_mode: NearMode = "fade", depth: ArrayLike | None = None,
    occlusion: Occlusion = "soft", error: float | None = None, dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:  # fmt: skip
    """Return the opacity of a gas: the alpha that :func:`splat` gives for one color, bit by bit.

    Takes what :func:`splat` takes but the color, and gives (H, W): 1 - prod(1 - alpha_i), 0 to 1.
    """
    manner = footprint, edge, near, near_mode, occlusion, error
    gas = gas_of(centers, radius, density)
    return _drawn(shape, gas, None, camera, manner, depth, dtype, out)


def _drawn(
    shape: tuple[int, int], gas: Gas, colors: Float64 | None, camera: Camera,
    manner: tuple[Any, ...], depth: ArrayLike | None, dtype: npt.DTypeLike, out: Array | None,
) -> Array:  # fmt: skip
    size = check.shape_of("shape", shape)
    kind = check.float_dtype(dtype)
    sight = lens_of(camera, size), manner_of(kind, *manner)
    ground = None
    if depth is not None:
        ground = check.plane_of("depth", depth, size)
        if np.isnan(ground.min()):
            raise ValueError("depth must not be NaN: infinity says that nothing stands there")
    inputs = [one for one in (*vars(gas).values(), colors, ground) if one is not None]
    result = check.output(out, size if colors is None else (*size, 4), kind, *inputs)
    sorted_ = _core.gas_sort(size, gas, np.zeros((1, 3)) if colors is None else colors, *sight)
    _core.gas_draw(result, sorted_, (0, size[0], 0, size[1]), ground)
    return result


def sorted_gas(
    shape: tuple[int, int], gas: Gas, color: ArrayLike, camera: Camera, *, footprint: str,
    near: float,
) -> _core.SortedGas:  # fmt: skip
    """Return a gas whose parts `gas_draw` draws, near particles by their line integral."""
    kind = np.dtype(np.float32)
    manner = manner_of(kind, footprint, "taper", near, "exact", "soft", None)
    colors = colors_of(color, len(gas.centers))
    return _core.gas_sort(shape, gas, colors, lens_of(camera, shape), manner)


def gas_of(centers: ArrayLike, radius: ArrayLike, density: ArrayLike) -> Gas:
    """Return particles as the kernels take them, or refuse them."""
    places = check.moderate("centers", check.rows_of("centers", centers, 3))
    sizes = check.each_of("radius", radius, len(places))
    cover = check.each_of("density", density, len(places))
    wanted = f"from {SMALLEST:g} to {LARGEST:g}"
    check.require("radius", sizes, (sizes >= SMALLEST) & (sizes <= LARGEST), wanted)
    check.require("density", cover, (cover >= 0.0) & (cover <= 1.0), "from 0 to 1")
    return Gas(places, sizes, cover)


def colors_of(color: ArrayLike, count: int) -> Float64:
    """Return (1, 3) or (count, 3) numbers."""
    values = check.moderate("color", check.table("color", color, ndim=None))
    if values.shape == (3,):
        return values.reshape(1, 3)
    if values.shape in ((1,), (count,)):
        values = np.repeat(values[:, None], 3, axis=1)
    if values.shape not in ((1, 3), (count, 3)):
        raise ValueError(
            f"color must be one number, (3,), ({count},) or ({count}, 3), "
            f"got an array of shape {values.shape}"
        )
    return values if count and len(values) else np.zeros((1, 3))


def lens_of(
    camera: Camera, size: tuple[int, int]
) -> tuple[float, float, float, tuple[float, float, float]]:
    view = expect_camera(camera)
    x, y = view.principal(size)
    return (view.focal, x, y, view.offset)


def manner_of(
    kind: np.dtype[Any], footprint: str, edge: str, near: float, near_mode: str, occlusion: str,
    error: float | None,
) -> tuple[str, str, float, str, bool, float]:  # fmt: skip
    limit = FINISHED[kind.name] if error is None else error
    return (
        check.choice("footprint", footprint, Footprint),
        check.choice("edge", edge, Edge),
        check.real("near", near, low=SMALLEST, high=LARGEST),
        check.choice("near_mode", near_mode, NearMode),
        check.choice("occlusion", occlusion, Occlusion) == "hard",
        check.real("error", limit, low=0.0, high=0.999),
    )
