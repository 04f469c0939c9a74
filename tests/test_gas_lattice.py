"""Gas drawn on a lattice of samples where it changes slowly, against the float64 line integral."""

from __future__ import annotations

import numpy as np
import pytest

import flurries as fl
import twin_gas as twin
from every import every

SHAPE, FOCAL, SMOOTH = (200, 232), 560.0, 24.0
CAMERA = fl.Camera(FOCAL)


def bound(density: float, sigma: float) -> float:
    """What one particle may err by, as `splat` says."""
    return density * (41.0 / sigma**4 + 0.033 / sigma)


def apart(centers, radius, density, **options):
    """Return the largest difference of the lattice from every pixel's own value."""
    exact = fl.gas.alpha(SHAPE, centers, radius, density, CAMERA, dtype="float64", **options)
    smooth = fl.gas.alpha(
        SHAPE, centers, radius, density, CAMERA, dtype="float64", smooth=SMOOTH, **options
    )
    return np.abs(smooth - exact).max(), exact


@every("sigma", [24.5, 40.0, 90.0])
@every("footprint", ["viewplane_c", "viewpoint", "volume"])
def test_one_particle_errs_by_no_more_than_it_says(footprint, sigma):
    rng = np.random.default_rng(3)
    worst = 0.0
    for _ in range(12):
        depth = rng.uniform(2.0, 6.0)
        place = [*rng.uniform(-0.15, 0.15, 2) * depth, depth]
        away = np.linalg.norm(place)
        error, alpha = apart([place], 3.0 * sigma * away / FOCAL, 1.0, footprint=footprint)
        assert alpha.max() > 0.5
        worst = max(worst, error)
    assert worst < bound(1.0, sigma)
    # The bound is not many times what is found, where all of a footprint is in the picture.
    assert sigma > 25.0 or worst > 0.3 * bound(1.0, sigma)


@pytest.mark.parametrize("seed", range(3))
@every("colored", [False, True])
def test_inside_the_gas_half_a_step_of_8_bits_is_never_reached(seed, colored):
    rng = np.random.default_rng(seed)
    centers = rng.uniform(-2.5, 2.5, (1000, 3))
    color = rng.random((1000, 3)) if colored else 0.7
    how = {"near_mode": "exact", "dtype": "float64"}
    exact = fl.gas.splat(SHAPE, centers, 0.4, 0.4, color, CAMERA, **how)
    smooth = fl.gas.splat(SHAPE, centers, 0.4, 0.4, color, CAMERA, smooth=SMOOTH, **how)
    difference = np.abs(smooth - exact)
    assert difference.max() < 0.5 / 255 and np.sqrt((difference**2).mean()) < 1e-4
    single = fl.gas.splat(SHAPE, centers, 0.4, 0.4, color, CAMERA, smooth=SMOOTH, near_mode="exact")
    assert np.abs(single - smooth).max() < 2e-5


def ramp():
    """A floor that goes off, a slanted wall, a step and the sky."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    depth = 1.0 + 0.01 * rows + 0.005 * columns
    depth[:, 150:] = 2.5
    depth[:40, 170:] = np.inf
    return depth


@every("footprint", ["viewplane_c", "viewpoint", "volume"])
@every("occlusion", ["soft", "hard"])
def test_what_stands_in_the_gas_cuts_it_as_ever(footprint, occlusion):
    rng = np.random.default_rng(6)
    centers = rng.uniform((-1, -1, 0.2), (1, 1, 4.0), (200, 3))
    options = {"footprint": footprint, "occlusion": occlusion, "depth": ramp()}
    error, alpha = apart(centers, 0.5, 0.4, **options)
    free, _ = twin.transmittance(SHAPE, centers, 0.5, 0.4, FOCAL, footprint=footprint)
    assert error < 0.5 / 255 and np.abs(1.0 - free - alpha).max() > 0.2
