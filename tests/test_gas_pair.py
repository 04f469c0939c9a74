"""Two eyes at once: impostors of equal disparity, their error, and when they are used."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

import flurries as fl

SHAPE = (150, 200)


def gas(near=6.0, far=9.0, count=4000, seed=2):
    rng = np.random.default_rng(seed)
    depth = rng.uniform(near, far, count)
    place = rng.uniform(-0.7, 0.7, (count, 2)) * depth[:, None]
    return np.column_stack([place, depth]), 0.05 * depth * rng.uniform(2, 4, count), 0.1


def eyes(distance=0.065, **more):
    return fl.stereo.eyes(fl.Camera(200.0), distance=distance, **more)


def separate(arguments, both, **options):
    return [fl.gas.alpha(SHAPE, *arguments, eye, **options) for eye in both]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("convergence", [None, 7.0])
def test_the_error_is_bounded_by_the_slab(convergence, dtype):
    both, arguments = eyes(convergence=convergence), gas()
    left, right = separate(arguments, both, dtype=dtype)
    last = 0.0
    for slab, limit in ((0.08, 0.0007), (0.15, 0.0012), (0.31, 0.0025), (1.23, 0.0087)):
        pair = fl.gas.alpha_pair(SHAPE, *arguments, both, slab=slab, dtype=dtype)
        assert pair.slabs > 0 and pair.shifted > 2500
        np.testing.assert_allclose(pair.left, left, atol=2e-6)
        rms = np.sqrt(np.mean((pair.right - right).astype(np.float64) ** 2))
        assert rms <= limit  # gas.md section 7
        last = rms
    assert last > 1e-4  # there is an error to bound


def test_no_particle_is_off_by_more_than_the_slab():
    both = eyes(distance=0.5)
    for depth in (6.0, 6.3, 6.6):
        # One that stands out among many.
        others, radius, _ = gas(6.0, 7.0)
        centers = np.concatenate([[(0.1, 0.2, depth)], others])
        shown = np.full(len(centers), 1e-9)
        shown[0] = 0.5
        sizes = np.concatenate([[0.6], radius])
        for slab in (0.25, 1.0):
            pair = fl.gas.alpha_pair(
                SHAPE, centers, sizes, shown, both, slab=slab, dtype=np.float64
            )
            assert pair.slabs > 0
            want = fl.gas.alpha(SHAPE, centers, sizes, shown, both[1], dtype=np.float64)
            columns = np.arange(200) + 0.5
            middle = [(a.sum(axis=0) @ columns) / a.sum() for a in (pair.right, want)]
            assert abs(middle[0] - middle[1]) <= slab + 2e-3


def test_they_are_used_only_where_they_pay():
    both = eyes()
    few = fl.gas.alpha_pair(SHAPE, *gas(count=30), both)
    assert few.slabs == 0
    np.testing.assert_array_equal(few.right, separate(gas(count=30), both)[1])
    # Near gas has many disparities.
    near = gas(0.5, 3.0, count=600)
    assert fl.gas.alpha_pair(SHAPE, *near, eyes(distance=0.3), slab=0.05).slabs == 0
    # By-ray models are drawn again.
    ray = fl.gas.alpha_pair(SHAPE, *gas(count=300), both, footprint="volume")
    assert ray.slabs == 0
    np.testing.assert_array_equal(ray.right, separate(gas(count=300), both, footprint="volume")[1])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(300, 400), (301, 399)])
def test_many_disparities_are_drawn_at_half_the_resolution(shape, dtype):
    centers, radius, density = gas(1.0, 6.0, count=1500)
    both = fl.stereo.eyes(fl.Camera(400.0), distance=0.3)
    more = {"dtype": dtype, "edge": "taper"}
    pair = fl.gas.alpha_pair(shape, centers, radius, density, both, slab=0.1, **more)
    left, right = (fl.gas.alpha(shape, centers, radius, density, eye, **more) for eye in both)
    np.testing.assert_array_equal(pair.left, left)
    error = np.abs(pair.right - right).astype(np.float64)
    # A thousandth of a density of .1 for each particle, of which some dozens lie over each other;
    # and something, or it was not drawn so.
    assert pair.slabs == 0 and 0.0 < error.max() < 0.002
    assert np.sqrt(np.mean(error**2)) < 0.0002
    # As right in the last row and column, and with small particles between the large ones.
    assert max(error[-1].max(), error[:, -1].max(), error[0].max(), error[:, 0].max()) < 0.002
    small = np.where(np.arange(1500) % 3 == 0, 0.1 * radius, radius)
    pair = fl.gas.alpha_pair(shape, centers, small, density, both, slab=0.1, **more)
    right = fl.gas.alpha(shape, centers, small, density, both[1], **more)
    error = np.abs(pair.right - right)
    assert pair.slabs == 0 and 0.0 < error.max() < 0.002


def test_small_close_and_hidden_particles_are_drawn_for_each_eye():
    centers, radius, density = gas()
    centers = np.concatenate([centers, [(0.1, 0.0, 0.3), (0.0, 0.1, 7.0)]])
    radius = np.concatenate([radius, [0.3, 0.02]])
    depths = [np.full(SHAPE, 100.0), np.full(SHAPE, 100.0)]
    both = eyes()
    options = {"near_mode": "exact"}
    pair = fl.gas.alpha_pair(
        SHAPE, centers, radius, density, both, depths=depths, slab=0.1, **options
    )
    left, right = (
        fl.gas.alpha(SHAPE, centers, radius, density, eye, depth=depth, **options)
        for eye, depth in zip(both, depths, strict=True)
    )
    assert pair.slabs > 0 and pair.shifted < len(centers)
    np.testing.assert_allclose(pair.left, left, atol=2e-6)
    assert np.sqrt(np.mean((pair.right - right) ** 2)) < 0.001
    wall = [np.full(SHAPE, 7.0)] * 2
    hidden = fl.gas.alpha_pair(SHAPE, centers, radius, density, both, depths=wall, slab=0.1)
    want = fl.gas.alpha(SHAPE, centers, radius, density, both[1], depth=wall[1])
    assert np.sqrt(np.mean((hidden.right - want) ** 2)) < 0.001


@pytest.mark.parametrize("count", [2, 3])
def test_bits_do_not_depend_on_the_thread_count(count, threads):
    def bits():
        pair = fl.gas.alpha_pair(SHAPE, *gas(), eyes())
        assert pair.slabs > 0
        return hashlib.sha256(pair.left.tobytes() + pair.right.tobytes()).hexdigest()

    threads(1)
    want = bits()
    threads(count)
    assert bits() == want


def test_out_and_refusals():
    outs = [np.full(SHAPE, np.nan, np.float32) for _ in range(2)]
    pair = fl.gas.alpha_pair(SHAPE, *gas(), eyes(), out=tuple(outs))
    assert pair.left is outs[0] and pair.right is outs[1] and np.isfinite(outs).all()
    good = {"cameras": eyes(), "slab": 0.25}
    turned = (eyes()[0], fl.Camera(200.0, offset=(0.1, 0.1, 0.0)))
    for name, value, kind in (
        ("cameras", turned, ValueError), ("cameras", eyes()[0], TypeError),
        ("cameras", (1, 2), TypeError), ("slab", 0.0, ValueError),
        ("depths", np.ones(SHAPE), TypeError), ("out", (outs[0], outs[0]), ValueError),
        ("footprint", "disc", ValueError),
    ):  # fmt: skip
        with pytest.raises(kind, match=name):
            fl.gas.alpha_pair(SHAPE, *gas(count=5), **{**good, name: value})
