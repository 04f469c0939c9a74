"""What a gas as a whole obeys: transmittance, visibility, light, flight, the table."""

import math

import numpy as np
import pytest

import flurries as fl
import twin_gas as twin
from every import every

# Pixels of one row whose rays lean by 0, 15, 30 and 45 degrees: slopes j / 40 from the first pixel.
LENS = fl.Camera(40.0, center=(0.5, 0.5))
COLUMNS = np.array([0, 11, 23, 40])
LENGTHEN = np.hypot(1.0, COLUMNS / 40.0)
RADIUS, DENSITY = 0.45, 0.4


def mean_transmittance(footprint, near, far, draws, *, edge):
    """Mean T of the four rays through random slabs, and its standard error.

    Middles fill a slab from `near` to `far`, farther to the sides than any ray's reach; how many is
    a Poisson number, so that exp(-beta L) is exact.
    """
    low, high = np.array([-1.0, -1.0, near]), np.array([far + 1.0, 1.0, far])
    volume = np.prod(high - low)
    rng = np.random.default_rng(17)
    values = []
    for _ in range(draws):
        centers = rng.uniform(low, high, (rng.poisson(9.6 * volume), 3))
        alpha = fl.gas.alpha(
            (1, 41), centers, RADIUS, DENSITY, LENS, footprint=footprint, edge=edge,
            dtype=np.float64, near_mode="cull",
        )  # fmt: skip
        values.append(1 - alpha[0, COLUMNS])
    return np.mean(values, axis=0), np.std(values, axis=0) / math.sqrt(draws)


@pytest.mark.parametrize(("footprint", "near", "edge", "off"), [
    ("volume", 2.0, "taper", 0.0),
    ("volume", 2.0, "square", 0.0),
    ("viewpoint", 3.0, "taper", 0.0),
    # Optical depth 1.002 to 1.005 of the exact one at depth 3.
    ("viewplane_c", 3.0, "taper", 0.005),
])  # fmt: skip
def test_the_mean_transmittance_is_kept(footprint, near, edge, off):
    mean, error = mean_transmittance(footprint, near, near + 2.0, 800, edge=edge)
    beta = fl.gas.extinction(9.6, 1.0, RADIUS, DENSITY, edge="disc" if edge == "square" else edge)
    assert (np.abs(mean - np.exp(-beta * 2.0 * LENGTHEN)) < 3 * error + off).all()
    assert (error < 0.01).all()


def test_extinction_and_visibility():
    for count, radius, density, want in (
        (1500, 0.37, 0.4, 0.4356), (1000, 0.45, 0.15, 0.1611), (1200, 0.45, 0.4, 0.5154)
    ):  # fmt: skip
        got = fl.gas.extinction(count, 125.0, radius, density)
        assert abs(got - want) < 6e-5
        far = fl.gas.visibility(got)
        assert abs(far - {0.4356: 6.88, 0.1611: 18.60, 0.5154: 5.81}[want]) < 6e-3
        assert abs(math.exp(-got * far) - 0.05) < 1e-15
        assert abs(fl.gas.visibility(got, contrast=0.02) * got - 3.912) < 1e-3
        assert abs(fl.gas.visibility(far) - got) < 1e-12
    # The areas by quadrature.
    q = np.linspace(0, 3, 200_001)
    for edge, g in (("taper", twin.taper(np.exp(-q * q / 2))), ("disc", np.exp(-q * q / 2))):
        heights = 2 * np.pi * q * g
        area = (heights[1:] + heights[:-1]).sum() / 2 * (q[1] - q[0])
        got = fl.gas.extinction(1.0, 1.0, 3.0, 1.0, edge=edge)
        assert abs(area - got) < 1e-8


@every("size", [1, 2, 16, 33, 64, 65, 129])
def test_the_table_is_the_closed_form_whatever_the_quadrature(size):
    want = np.exp(-0.5 * np.add.outer(*[np.linspace(-3, 3, size) ** 2 if size > 1 else [0.0]] * 2))
    for intervals in (1, 7, 100):
        table = fl.gas.footprint_table(size, intervals=intervals)
        np.testing.assert_allclose(table, want, rtol=0, atol=5e-16)
        np.testing.assert_array_equal(table, table[::-1, ::-1].T)
    if size % 2:
        assert table[size // 2, size // 2] == 1
    else:
        # Scaled by the origin's value, not by the largest entry: the even table's trap.
        step = 6 / (size - 1)
        assert abs(table.max() - math.exp(-step * step / 4)) < 1e-15


@pytest.mark.parametrize("forward", [0.0, 0.3, 1.0])
def test_light_is_the_twins(forward):
    rng = np.random.default_rng(4)
    centers = rng.uniform(-2, 2, (150, 3))
    radius, density = rng.uniform(0.3, 0.9, 150), rng.uniform(0, 1, 150)
    for direction in ((0.3, 1.0, -0.2), (0, 0, -5.0)):
        got = fl.gas.light(centers, radius, density, direction, forward=forward)
        want = twin.light(centers, radius, density, direction, forward)
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-13)
        assert got.min() >= 0 and got.max() <= 1
    if forward == 1.0:
        np.testing.assert_allclose(got, 1.0, rtol=1e-12)


def test_phase_functions_keep_the_light():
    c = np.linspace(-1, 1, 200_001)
    for values in (fl.gas.phase(c), fl.gas.phase(c, kind="henyey", asymmetry=0.7)):
        assert abs(values[:-1].mean() + values[1:].mean() - 2.0) < 1e-4
    assert fl.gas.phase(1.0, kind="henyey") > fl.gas.phase(-1.0, kind="henyey")


def test_what_changes_in_flight_is_motion_and_no_jump():
    """Of a box around the eye, half is behind: an exact particle alone may take .03 in a frame.

    A motion's step halves with the time between two frames, a jump's does not.
    """
    camera = fl.Camera(42.0)

    def largest(near_mode, step, footprint="viewplane_c"):
        means = []
        for t in range(round(5.0 / step)):
            centers = fl.particles.positions(1200, 5.0, seed=3, velocity=(0, 0, -step), time=t)
            shown = 0.4 * fl.particles.edge_fade(centers, 5.0)
            alpha = fl.gas.alpha(
                (36, 48), centers, 0.45, shown, camera, near_mode=near_mode, footprint=footprint
            )
            means.append(alpha.mean())
        return np.abs(np.diff(means)).max()

    whole, half = (largest("exact", step) for step in (0.05, 0.025))
    assert whole < 0.03 and 0.45 < half / whole < 0.6
    # The line integral of every particle, which has no near plane to pass, moves as much.
    assert abs(largest("exact", 0.05, "volume") / whole - 1.0) < 0.1
    # The negative control: culling jumps.
    assert largest("cull", 0.025) > 0.7 * largest("cull", 0.05)
