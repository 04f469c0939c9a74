"""Gas against its slow twin, the laws that it obeys as a whole, and the errors of billboards."""

import math
from itertools import product

import mpmath
import numpy as np
import pytest

import flurries as fl
import twin_gas as twin
from every import every

FOCAL = 130.0
SHAPE = (90, 120)
MODELS = ("viewplane", "viewplane_c", "viewpoint", "volume", "table")
LIMITS = {"float32": 5e-6, "float64": 1e-12}  # What float32 and float64 promise of T.


def cloud(count=220, seed=3, *, inside=False):
    """A box of the fog's particles; the eye before it, or in its middle, some behind it."""
    rng = np.random.default_rng(seed)
    middle = 0.0 if inside else 4.5
    centers = rng.uniform((-2.5, -2.5, middle - 2.5), (2.5, 2.5, middle + 2.5), (count, 3))
    radius = rng.uniform(0.3, 0.6, count)
    density = rng.uniform(0.05, 0.6, count)
    centers[::9, 2] *= 30  # Some of a few pixels, and some far away under one.
    centers[::9, :2] *= 15
    return centers, radius, density


def ground(seed=1):
    rng = np.random.default_rng(seed)
    depth = np.full(SHAPE, np.inf)
    depth[:, 30:70] = np.linspace(0.05, 6.0, 40)
    depth[60:] = 3.0
    depth[:20, 80:] = rng.uniform(0.5, 8, (20, 40))
    return depth


def check(arguments, options, camera=None, shape=SHAPE):
    """Compare both types with the twin, and return what the twin lets through."""
    camera = fl.Camera(FOCAL) if camera is None else camera
    center = camera.principal(shape)
    through, _ = twin.transmittance(
        shape, *arguments, camera.focal, center=center, offset=camera.offset, **options
    )
    for dtype, limit in LIMITS.items():
        alpha = fl.gas.alpha(shape, *arguments, camera, dtype=dtype, **options)
        assert alpha.dtype == dtype
        worst = np.abs((1.0 - through) - alpha)
        if options.get("edge") == "square" and dtype == "float32":
            # A pixel exactly on the rim may be in for one type and out for the other.
            assert (worst > limit).sum() <= 3 and worst.max() < 0.012
        else:
            assert worst.max() <= limit
    return through


EDGES = [("taper", "fade"), ("taper", "cull"), ("square", "fade"), ("square", "exact")]


@pytest.mark.parametrize("inside", [False, True], ids=["outside", "inside"])
@pytest.mark.parametrize("footprint", MODELS)
def test_every_model_is_its_twin(footprint, inside):
    camera = fl.Camera(FOCAL, center=(50.3, 47.9), offset=(0.03, -0.02, 0.1), center_shift=(2, 1))
    # Before the near plane there is one way.
    for edge, near_mode in EDGES if inside else EDGES[::3]:
        options = {"footprint": footprint, "edge": edge, "near_mode": near_mode}
        through = check(cloud(inside=inside), options, camera)
        assert through.min() < 0.5 < through.max()
    # Pictures that end beside a tile, with one, and far from one.
    for shape in ((1, 1), (64, 64), (65, 63), (3, 200)):
        check(cloud(60, inside=inside), {"footprint": footprint}, shape=shape)
    free, _ = twin.transmittance(SHAPE, *cloud(inside=inside), FOCAL, footprint=footprint)
    for occlusion in ("soft", "hard"):
        depth = ground().astype(np.float32)  # A depth that both types hold exactly.
        options = {"footprint": footprint, "occlusion": occlusion, "depth": depth}
        assert np.abs(check(cloud(inside=inside), options) - free).max() > 0.2


@every("footprint", MODELS)
def test_colors_come_in_order(footprint):
    arguments = cloud(150)
    arguments[0][1::9] = arguments[0][::9]  # Of two at one place the first is in front.
    color = np.random.default_rng(5).uniform(0, 4, (150, 3))
    options = {"footprint": footprint, "depth": ground()}
    want = twin.layer(SHAPE, *arguments, color, FOCAL, **options)
    for dtype, limit in (("float32", 3e-5), ("float64", 4e-12)):
        got = fl.gas.splat(SHAPE, *arguments, color, fl.Camera(FOCAL), dtype=dtype, **options)
        np.testing.assert_allclose(got, want, rtol=0, atol=limit)
        # Colors up to 4, and the rest within T's own limit.
        np.testing.assert_allclose(got[..., 3], want[..., 3], rtol=0, atol=LIMITS[dtype])


def test_grey_and_colors_are_told_apart():
    arguments = cloud(4)
    camera = fl.Camera(FOCAL)
    for color in (0.3, (0.3, 0.3, 0.3), [0.3] * 4, np.full((4, 3), 0.3), np.float32(0.3)):
        layer = fl.gas.splat(SHAPE, *arguments, color, camera, dtype=np.float64)
        alpha = fl.gas.alpha(SHAPE, *arguments, camera, dtype=np.float64)
        np.testing.assert_array_equal(layer[..., 3], alpha)
        want = np.repeat(0.3 * alpha[..., None], 3, axis=2)
        np.testing.assert_allclose(layer[..., :3], want, rtol=1e-7)


def test_an_early_end_errs_by_what_it_says():
    centers = np.random.default_rng(4).uniform((-2, -1.5, 2), (2, 1.5, 5), (400, 3))
    through, _ = twin.transmittance(SHAPE, centers, 0.8, 0.5, FOCAL)
    given = SHAPE, centers, 0.8, 0.5, fl.Camera(FOCAL)
    for error in (0.0, 1e-4, 1e-2, 0.1):
        alpha = fl.gas.alpha(*given, error=error, dtype=np.float64)
        worst = np.abs(1 - through - alpha).max()
        assert worst <= max(error, 1e-12)
    # And it does end early.
    assert worst > 1e-6


EYE = fl.Camera(300.0)
EDGES_OF_DEPTH = [
    # The depth of a particle straight ahead, how it is drawn, and its opacity in the middle.
    (0.1, {"radius": 0.9, "near": 1e-3, "near_mode": "cull"}, 0.5),  # 2,450 px wide.
    (0.2, {"near": 0.2}, 0.0), (0.3000001, {"near": 0.2}, 0.5), (-1.0, {}, 0.0),
    (3.0, {"depth": np.full((33, 33), 3.0), "occlusion": "hard"}, 0.0),
    (3.0, {"depth": np.full((33, 33), 3.0)}, 0.25),
    (0.5, {"near": 0.2, "depth": np.full((33, 33), 0.1), "footprint": "volume"}, 0.0),
    (3.0, {"radius": 2.0, "density": 1.0}, 1.0),
]  # fmt: skip


@every(("depth", "given", "want"), EDGES_OF_DEPTH)
def test_edges_of_depth(depth, given, want):
    options = {"radius": 0.3, "density": 0.5, **given}
    for dtype, limit in (("float32", 1e-6), ("float64", 1e-6 if depth < 3.0 else 1e-9)):
        got = fl.gas.alpha((33, 33), [(0.0, 0.0, depth)], camera=EYE, dtype=dtype, **options)
        assert abs(got[16, 16] - want) <= limit * (want != 0.0)


def test_thousands_of_faint_layers():
    # 1 - alpha would round the same way each time, and be wrong by 3e-3 in float32.
    count = 50_000
    centers = np.tile((0.0, 0.0, 3.0), (count, 1))
    alpha = fl.gas.alpha((41, 41), centers, 5.0, 2e-5, fl.Camera(40.0, center=(20.5, 20.5)))
    assert abs(alpha[20, 20] + np.expm1(count * np.log1p(-2e-5))) < 1e-5


@every("footprint", MODELS)
def test_no_particles_and_none_in_sight(footprint):
    for centers in (np.zeros((0, 3)), [(0.0, 0.0, -500.0)], [(1e90, 0.0, 1.0)], [(0, 0, 1e90)]):
        camera = fl.Camera(9.0)
        assert not fl.gas.splat((9, 9), centers, 0.1, 0.5, 1.0, camera, footprint=footprint).any()


# Pixels of one row whose rays lean by 0, 15, 30 and 45 degrees: slopes j / 40 from the first pixel.
LENS = fl.Camera(40.0, center=(0.5, 0.5))
COLUMNS = np.array([0, 11, 23, 40])
LENGTHEN = np.hypot(1.0, COLUMNS / 40.0)
RADIUS, DENSITY = 0.45, 0.4


def mean_transmittance(footprint, near, far, draws, *, edge):
    """Mean T of four rays through slabs of a Poisson number of particles, and its error."""
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
    """A motion's step halves with the time between two frames, a jump's does not."""
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


DIGITS = 700
EPS = np.finfo(float).eps
R, Y = 0.45, 0.8


def direct(x, depth, near):
    """Projection error by direct projection; None where there is none."""
    with mpmath.workdps(DIGITS):
        x, depth, near = mpmath.mpf(x), mpmath.mpf(depth), mpmath.mpf(near)
        c, r = mpmath.matrix([x, Y, depth]), mpmath.mpf(R)
        flat = c + mpmath.matrix([r, 0, 0])
        # Square to (0, 1, 0) and to the way to the eye.
        facing = c + r * mpmath.matrix([depth, 0, -x]) / mpmath.hypot(x, depth)
        if depth <= 0 or facing[2] <= 0:
            return None
        return [near * flat[k] / flat[2] - near * facing[k] / facing[2] for k in (0, 1)]


def off(got, want, allowed=0.0):
    """Relative errors of both components; 0 where the first is within what is allowed."""
    with mpmath.workdps(DIGITS):
        errors = [abs(mpmath.mpf(float(a)) - b) for a, b in zip(got, want, strict=True)]
        errors[0] = errors[0] if errors[0] > allowed else 0
        return [float(e / abs(b)) if e else 0.0 for e, b in zip(errors, want, strict=True)]


def signed(sizes):
    return [x for size in sizes for x in (size, -size)]


def test_exact_forms_against_direct_projection():
    near = 1.3
    places = signed([1e-160, 1e-100, 1e-30, 1e-9, 1e-3, 0.05, R, 1.0, 7.0, 300.0, 1e5])
    for x, depth in product(places, [0.1, 0.3, 1.0, 5.0, 100.0, 1e4, 1e6]):
        got = fl.gas.projection_error([(x, Y, depth)], R, near=near)[0]
        want = direct(x, depth, near)
        if want is None:
            assert np.isnan(got).all()
            continue
        allowed = 0.0
        if -3.5 * R < x < -0.5 * R:
            s = math.hypot(x, depth)  # Near the second zero two terms cancel.
            term = near * R * -x * (-x * s / (s + depth) + R)
            allowed = 4 * EPS * term / (depth * (depth * s - R * x))
        assert max(off(got, want, allowed)) <= 1e-13, (x, depth)


def test_nan_exactly_where_the_domain_ends():
    # Behind, at the eye's plane, and where the facing billboard's edge lies behind it.
    for depth in (0.0, -0.0, -1.0):
        assert np.isnan(fl.gas.projection_error([(0.3, 0.1, depth)], R)).all()
    # D S = r C_x: with r > D. On both sides of the end of the domain, bit by bit.
    depth, x = 0.5, 2.0
    edge = depth * math.hypot(x, depth) / x
    for factor, seen in ((1 - 4 * EPS, True), (1 + 4 * EPS, False)):
        values = fl.gas.projection_error([(x, 0.3, depth)], edge * factor)
        parallax = fl.gas.parallax_error([(x - 0.05, 0.3, depth)], edge * factor, eye_distance=0.1)
        assert (np.isfinite(values) == seen).all() and (np.isfinite(parallax) == seen).all()
    # r > D is no end in itself.
    assert np.isfinite(fl.gas.projection_error([(0.1, 0.0, 0.4)], R)).all()


@pytest.mark.parametrize("apart", [1e-10, 1e-3, 0.065, 2.0])
def test_parallax_error_against_direct_projection(apart):
    places = signed([0.0, 1e-160, 1e-9, 0.01, R, 1.3, 40.0, 1e5])
    for x, depth in product(places, [0.1, 0.6, 1.0, 5.0, 1e3, 1e6]):
        got = fl.gas.parallax_error([(x, Y, depth)], R, eye_distance=apart)[0]
        with mpmath.workdps(DIGITS):
            half = mpmath.mpf(apart) / 2
            right, left = (direct(mpmath.mpf(x) + side, depth, 1) for side in (-half, half))
            if right is None or left is None:
                assert np.isnan(got).all()
                continue
            want = [a - b for a, b in zip(right, left, strict=True)]
        across, down = off(got, want)
        # p_x goes through zero near C_x = -r; elsewhere all digits are there.
        assert down <= 1e-13 and (across <= 1e-13 or -2.5 < x / R < -0.3), (x, depth)


def test_printed_forms_are_the_papers():
    centers = np.random.default_rng(6).uniform((-2, -2, 1), (2, 2, 9), (50, 3))
    got = fl.gas.projection_error(centers, R, near=1.5, form="printed")
    x, y, z = centers.T * [[1], [1], [-1]]
    s = np.sqrt(z * z + x * x)
    e_x = 1.5 * R * (x * x - z * s + R * x - z * z) / (-z * (-z * s + R * x))
    e_y = 1.5 * R * x * y * s / (z * (z * s - R * x))
    np.testing.assert_allclose(got, np.stack([e_x, e_y], axis=1), rtol=1e-12)
    # Opposite sign, and a third of it for r << C_x << D.
    a, b = (
        fl.gas.projection_error([(0.5, 1, 50)], 1e-3, form=f)[0, 0] for f in ("exact", "printed")
    )
    np.testing.assert_allclose(a / b, -1 / 3, rtol=2e-2)
    parallax = fl.gas.parallax_error(centers, R, eye_distance=0.1, form="printed")
    sides = [centers + np.array((s, 0, 0)) for s in (-0.05, 0.05)]
    right, left = (fl.gas.projection_error(c, R, form="printed") for c in sides)
    np.testing.assert_array_equal(parallax, right - left)
