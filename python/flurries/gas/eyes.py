"""The opacity of a gas for two eyes at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import LARGEST, SMALLEST, Array, float_dtype, output, real, shape_of
from flurries.camera.lens import Camera
from flurries.gas.splatting import gas_of, ground_of, lens_of, manner_of

__all__ = ["Pair", "alpha_pair"]


class Pair(NamedTuple):
    """What two eyes see.

    Attributes
    ----------
    left, right : (H, W)
        As :func:`flurries.gas.alpha` gives them; `right` within the error of the slabs.
    slabs : int
        How many were shifted; 0 if drawing the right eye's particles was cheaper, as they are or at
        half the resolution.
    shifted : int
        Particles in them.
    """

    left: Array
    right: Array
    slabs: int
    shifted: int


def alpha_pair(
    shape: tuple[int, int],
    centers: npt.ArrayLike,
    radius: npt.ArrayLike,
    density: npt.ArrayLike,
    cameras: tuple[Camera, Camera],
    *,
    slab: float = 0.25,
    footprint: str = "viewplane_c",
    edge: str = "taper",
    near: float = 0.1,
    near_mode: str = "fade",
    depths: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    occlusion: str = "soft",
    error: float | None = None,
    dtype: npt.DTypeLike = np.float32,
    out: tuple[Array, Array] | None = None,
) -> Pair:
    """Return the opacity of a gas for two eyes, the second one for less work where that is known.

    Parameters
    ----------
    shape, centers, radius, density, footprint, edge, near, near_mode, occlusion, error, dtype
        As in :func:`flurries.gas.alpha`.
    cameras : (left, right)
        Two eyes side by side, as :func:`flurries.stereo.eyes` gives them.
    slab : float
        Half the range of disparities of an impostor, px: no particle of the right eye's picture is
        farther than this from its place. 0.25 px errs by .0025 rms or so.
    depths : (left, right) of (H, W), optional
        What stands in either picture.
    out : two (H, W) arrays of that dtype, optional
        Where to write.

    Returns
    -------
    Pair
        ``(left, right, slabs, shifted)``.

    Raises
    ------
    TypeError, ValueError
        If an argument is not as described; the message names it.

    Notes
    -----
    Particles of a separable footprint, at least 8 px large and not cut off, can be drawn into slabs
    of nearly equal disparity, which the right eye sees shifted. Near gas has many disparities: the
    right eye's particles of 16 px and more are then drawn in their own places at half the
    resolution, which errs by less than .002 of opacity. A fixed count of operations decides between
    these and drawing as for the left eye, which has the bits of :func:`flurries.gas.alpha` and is
    what :meth:`flurries.Scene.stereo` does.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> middles = np.random.default_rng(1).uniform((-4, -3, 14), (4, 3, 19), (2000, 3))
    >>> both = fl.stereo.eyes(fl.Camera(400.0), distance=0.065)
    >>> pair = fl.gas.alpha_pair((240, 320), middles, 1.2, 0.1, both)
    >>> pair.slabs, pair.shifted
    (2, 2000)
    """
    size = shape_of("shape", shape)
    kind = float_dtype(dtype)
    gas = gas_of(centers, radius, density)
    if not isinstance(cameras, (tuple, list)) or len(cameras) != 2:
        raise TypeError(f"cameras must be (left, right), got {type(cameras).__name__}")
    if not all(isinstance(camera, Camera) for camera in cameras):
        raise TypeError(f"cameras must be two cameras, got {cameras!r}")
    lenses = (lens_of(cameras[0], size), lens_of(cameras[1], size))
    manner = manner_of(footprint, edge, near, near_mode, occlusion, error, kind)
    half = real("slab", slab, low=SMALLEST, high=LARGEST)
    grounds = None
    if depths is not None:
        if not isinstance(depths, (tuple, list)) or len(depths) != 2:
            raise TypeError(f"depths must be (left, right), got {type(depths).__name__}")
        left, right = (
            np.ascontiguousarray(ground_of(depth, size, name=f"depths[{i}]"), np.float64)
            for i, depth in enumerate(depths)
        )
        grounds = (left, right)
    given = (None, None) if out is None else out
    if not isinstance(given, (tuple, list)) or len(given) != 2:
        raise TypeError(f"out must be (left, right), got {type(given).__name__}")
    inputs = [gas.centers, gas.radius, gas.density, *(grounds or ())]
    first = output(given[0], size, kind, *inputs)
    second = output(given[1], size, kind, first, *inputs)
    slabs, shifted = _core.gas_pair(
        first, second, gas.centers, gas.radius, gas.density, lenses, manner, grounds, half
    )
    return Pair(first, second, slabs, shifted)
