"""What the particle functions accept, refuse, and promise about bits."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from flurries import particles
from flurries.camera import Camera

CAMERA = Camera(200.0)


def many(count=30_000):
    """Return a sky full, over several runs of the binning, some of it huge."""
    arguments = {"seed": 1, "velocity": (0.1, 0.2, 0.3), "time": 3.0, "sway": (0.1, 0.2)}
    points = particles.positions(count, (4.0, 3.0, 3.9), center=(0, 0, 2.0), **arguments)
    radius = 0.004 + 0.4 * (np.arange(count) % 997 == 0)
    fade = particles.edge_fade(points, (4.0, 3.0, 3.9), center=(0, 0, 2.0))
    return points, radius, fade


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("velocity", [None, (0.03, 0.05, -0.02)])
def test_bits_do_not_depend_on_the_thread_count(threads, dtype, velocity):
    hashes = set()
    for count in (1, 2, 3):
        threads(count)
        points, radius, fade = many()
        alpha = particles.splat(
            (270, 333),
            points,
            radius,
            CAMERA,
            opacity=0.4 * fade,
            velocity=velocity,
            shutter=0.5,
            dtype=dtype,
        )
        assert 0.03 < alpha.mean() < 1
        state = hashlib.sha256(alpha.tobytes())
        state.update(points.tobytes())
        state.update(fade.tobytes())
        hashes.add(state.hexdigest())
    assert len(hashes) == 1


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_out_is_written_whole_and_returned(dtype):
    points, radius, _ = many(500)
    fresh = particles.splat((65, 129), points, radius, CAMERA, opacity=0.5, dtype=dtype)
    out = np.full((65, 129), np.nan, dtype)
    given = particles.splat((65, 129), points, radius, CAMERA, opacity=0.5, dtype=dtype, out=out)
    assert given is out
    np.testing.assert_array_equal(out, fresh)


def test_out_of_the_others():
    arguments = {"seed": 1, "velocity": (0, 1, 0), "time": 2.0}
    out = np.full((7, 3), np.nan)
    assert particles.positions(7, 2.0, **arguments, out=out) is out
    np.testing.assert_array_equal(out, particles.positions(7, 2.0, **arguments))
    swing = np.full((7, 3), np.nan)
    assert particles.sway_offsets(7, seed=1, time=2.0, sway=(1, 2), out=swing) is swing
    np.testing.assert_array_equal(swing, particles.sway_offsets(7, seed=1, time=2.0, sway=(1, 2)))
    fade = np.full(7, np.nan)
    assert particles.edge_fade(out, 2.0, out=fade) is fade
    np.testing.assert_array_equal(fade, particles.edge_fade(out, 2.0))


@pytest.mark.parametrize(
    "layout",
    [
        np.asfortranarray,
        lambda a: a.astype(a.dtype.newbyteorder()),
        lambda a: np.repeat(a, 2, axis=0)[::2],
        lambda a: a[::-1].copy()[::-1],
        lambda a: a.tolist(),
    ],
)
def test_layouts_of_inputs_do_not_matter(layout):
    points, radius, fade = many(300)
    velocity = points * 0.01
    depth = np.linspace(0.5, 4, 60 * 80).reshape(60, 80)
    arguments = {"opacity": fade, "velocity": velocity, "shutter": 1.0, "depth": depth}
    want = particles.splat((60, 80), points, radius, CAMERA, **arguments)
    laid = {k: v if np.isscalar(v) else layout(v) for k, v in arguments.items()}
    got = particles.splat((60, 80), layout(points), layout(radius), CAMERA, **laid)
    np.testing.assert_array_equal(got, want)


def test_integers_and_float32_are_numbers_too():
    points = np.array([[0, 0, 2], [0, 1, 4]])
    want = particles.splat((9, 9), points.astype(float), 1.0, CAMERA, opacity=0.5)
    for kind in (np.int32, np.uint8, np.float32, np.float16):
        got = particles.splat((9, 9), points.astype(kind), np.float32(1), CAMERA, opacity=0.5)
        np.testing.assert_array_equal(got, want)


GOOD = {
    "shape": (8, 9),
    "points": [(0.0, 0.0, 1.0), (0.1, 0.0, 2.0)],
    "radius": 0.1,
    "camera": CAMERA,
    "opacity": 0.5,
}


@pytest.mark.parametrize(
    ("name", "value", "kind"),
    [
        ("shape", (0, 5), ValueError),
        ("shape", 5, TypeError),
        ("shape", (5.0, 5), TypeError),
        ("shape", (2**31, 2**31), ValueError),
        ("points", [(0.0, 0.0, np.nan)], ValueError),
        ("points", [(0.0, np.inf, 1.0)], ValueError),
        ("points", [(0.0, 1.0)], ValueError),
        ("points", (0.0, 0.0, 1.0), ValueError),
        ("points", [("a", "b", "c")], TypeError),
        ("points", [(0.0, 0.0, 1j)], TypeError),
        ("points", [(0.0, 0.0, 1.0), (1.0,)], ValueError),
        ("radius", -0.1, ValueError),
        ("radius", np.nan, ValueError),
        ("radius", [0.1, 0.1, 0.1], ValueError),
        ("radius", "0.1", TypeError),
        ("radius", [0.1, -1], ValueError),
        ("opacity", 1.5, ValueError),
        ("opacity", -1e-9, ValueError),
        ("opacity", [0.5, np.inf], ValueError),
        ("opacity", None, TypeError),
        ("velocity", (0.0, 1.0), ValueError),
        ("velocity", (0.0, np.nan, 1.0), ValueError),
        ("velocity", np.zeros((3, 3)), ValueError),
        ("shutter", -1.0, ValueError),
        ("shutter", np.inf, ValueError),
        ("shutter", True, TypeError),
        ("near", 0.0, ValueError),
        ("near", -1.0, ValueError),
        ("near", np.nan, ValueError),
        ("depth", np.ones((9, 8)), ValueError),
        ("depth", np.ones(8), ValueError),
        ("depth", np.ones((8, 9), bool), TypeError),
        ("camera", 200.0, TypeError),
        ("dtype", np.float16, TypeError),
        ("dtype", None, TypeError),
        ("out", np.zeros((8, 9)), TypeError),
        ("out", np.zeros((9, 8), np.float32), ValueError),
        ("out", np.zeros((8, 9), np.float32, "F"), ValueError),
        ("out", [[0.0]], TypeError),
    ],
)
def test_splat_refuses_by_name(name, value, kind):
    with pytest.raises(kind, match=name):
        particles.splat(**{**GOOD, name: value})


def test_out_may_not_be_an_input():
    depth = np.ones((8, 9), np.float32)
    with pytest.raises(ValueError, match="out"):
        particles.splat(**GOOD, depth=depth, out=depth)


@pytest.mark.parametrize(
    ("name", "value", "kind"),
    [
        ("count", -1, ValueError),
        ("count", 1.0, TypeError),
        ("count", 2**63, ValueError),
        ("count", True, TypeError),
        ("box", 0.0, ValueError),
        ("box", (1.0, -1.0, 1.0), ValueError),
        ("box", (1.0, 1.0), ValueError),
        ("box", np.nan, ValueError),
        ("box", 1e300, ValueError),
        ("box", "1", TypeError),
        ("seed", 0.5, TypeError),
        ("seed", 2**63, ValueError),
        ("velocity", (1.0, 2.0), ValueError),
        ("velocity", (1.0, 2.0, np.inf), ValueError),
        ("velocity", np.zeros((4, 3)), ValueError),
        ("velocity", (1e308, 0.0, 0.0), ValueError),
        ("time", np.nan, ValueError),
        ("time", "now", TypeError),
        ("center", (0.0, 0.0), ValueError),
        ("center", (0.0, 0.0, np.nan), ValueError),
        ("sway", 1.0, TypeError),
        ("sway", (1.0, 2.0, 3.0), TypeError),
        ("sway", (1.0, np.inf), ValueError),
        ("sway", (1.0, 1e308), ValueError),
        ("out", np.zeros((5, 3), np.float32), TypeError),
        ("out", np.zeros((4, 3)), ValueError),
    ],
)
def test_positions_refuses_by_name(name, value, kind):
    good = {"count": 5, "box": 2.0, "seed": 0, "velocity": (0, 1, 0), "time": 1e3}
    with pytest.raises(kind, match=name):
        particles.positions(**{**good, name: value})


def test_the_others_refuse_by_name():
    with pytest.raises(TypeError, match="sway"):
        particles.sway_offsets(3, seed=0, time=0.0, sway=None)
    with pytest.raises(ValueError, match="points"):
        particles.edge_fade([(0.0, 1.0)], 2.0)
    with pytest.raises(ValueError, match="box"):
        particles.edge_fade([(0.0, 1.0, 1.0)], -2.0)
    with pytest.raises(ValueError, match="center"):
        particles.edge_fade([(0.0, 1.0, 1.0)], 2.0, center=(np.inf, 0, 0))
