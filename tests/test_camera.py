"""Cameras and their ways: projection, velocities, places, keys."""

import itertools
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

import flurries as fl
import twin
from every import every
from flurries.motion.keys import integral_to
from flurries.spectral.tables import wave_depth
from measure import frame_of

SHAPE = (480, 640)
CAMERAS: dict[str, dict[str, Any]] = {
    "plain": {"focal": 600.0},
    "centre": {"focal": 500.0, "center": (100.0, 333.5)},
    "eye": {"focal": 700.0, "offset": (0.3, -0.1, 0.05)},
    "convergence": {"focal": 600.0, "center_shift": (12.5, -3.0)},
    "turned": {"focal": 400.0, "rotation": (0.3, -0.5, 0.2)},
    "stretched": {"focal": 120.0, "center": (70.0, 50.0), "aspect": 1.3, "offset": (0.1, -0.2, 0)},
    "all": {
        "focal": 450.0, "center": (300.0, 200.0), "offset": (0.2, 0.1, -0.3),
        "center_shift": (5.0, 6.0), "rotation": (-0.2, 0.4, 1.1),
    },
}  # fmt: skip


def points(count: int = 50) -> np.ndarray:
    return np.random.default_rng(2).uniform(-5.0, 5.0, (count, 3))


def middle(given: dict[str, Any]) -> np.ndarray:
    return np.add(given.get("center", (320.0, 240.0)), given.get("center_shift", (0.0, 0.0)))


@every("name", CAMERAS)
def test_project_is_turn_offset_and_division(name: str):
    given = CAMERAS[name]
    px, depth = fl.camera.project(points(), fl.camera.Camera(**given), SHAPE)
    turn = Rotation.from_rotvec(given.get("rotation", (0.0, 0.0, 0.0)))
    x, y, z = (turn.inv().apply(points()) - given.get("offset", (0.0, 0.0, 0.0))).T
    assert px.dtype == depth.dtype == np.float64
    assert np.abs(depth - z).max() < 1e-14
    near = z > 0.0
    assert 5 < np.sum(near) < 45
    want = middle(given) + given["focal"] * np.stack([x, given.get("aspect", 1.0) * y] / z, axis=1)
    # eps times the size of a pixel coordinate times the condition |p|/z of the division
    assert np.allclose(px[near], want[near], rtol=1e-12, atol=1e-9)
    assert np.all(np.isnan(px[depth <= 0.0]))


@every("turn", [1e-12, 1e-9, 1e-6, np.pi, 7.0])
def test_small_and_large_turns(turn: float):
    # The rotation matrix at angles where a careless formula divides 0 by 0.
    camera = fl.camera.Camera(100.0, rotation=(0.6 * turn, 0.0, 0.8 * turn))
    seen, depth = fl.camera.project([(0.3, -0.2, 5.0)], camera, SHAPE)
    want = Rotation.from_rotvec((0.6 * turn, 0.0, 0.8 * turn)).inv().apply([(0.3, -0.2, 5.0)])[0]
    assert depth[0] == pytest.approx(want[2], abs=1e-14)
    if want[2] > 0.0:
        pixel = (320.0 + 100.0 * want[0] / want[2], 240.0 + 100.0 * want[1] / want[2])
        assert seen[0] == pytest.approx(pixel, abs=1e-11)
    else:
        assert np.all(np.isnan(seen))


@every("omega", [(0.0, 0.0, 0.0), (0.02, 0.0, 0.0), (0.01, -0.02, 0.03)])
@every("velocity", [(0.3, 0.0, 0.0), (0.0, -0.2, 0.5), (0.1, 0.2, -0.4)])
@every("name", CAMERAS)
def test_image_velocity_is_the_derivative_of_project(name: str, velocity, omega):
    # Camera minus flake: the points go the other way while the camera turns about its own axes.
    # Central differences with h = 1e-4 err by h^2 times a third derivative of order 10 px.
    given = CAMERAS[name]
    start = Rotation.from_rotvec(given.get("rotation", (0.0, 0.0, 0.0)))
    camera = fl.camera.Camera(**given)
    ahead = np.random.default_rng(4).uniform((-1, -1, 3), (1, 1, 9), (20, 3))
    ahead = start.apply(ahead)
    pixels, depth = fl.camera.project(ahead, camera, SHAPE)
    moved = []
    for t in (1e-4, -1e-4):
        turned = (start * Rotation.from_rotvec(np.multiply(omega, t))).as_rotvec()
        later = fl.camera.Camera(**{**given, "rotation": tuple(turned)})
        moved.append(fl.camera.project(ahead - np.multiply(velocity, t), later, SHAPE)[0])
    difference = (moved[0] - moved[1]) / 2e-4
    got = fl.camera.image_velocity(pixels, depth, velocity, camera, SHAPE, rotation=omega)
    assert np.abs(difference).max() > 1.0
    assert np.abs(got - difference).max() < 1e-6


@every("wavelength", [32.0, 5.0])
@every(("tile", "overlap"), [(64, 10), (64, 0), (48, 47), (31, 10), (512, 10)])
@every("name", CAMERAS)
def test_a_wave_moves_like_a_particle_at_its_depth(
    name: str, tile: int, overlap: int, wavelength: float
):
    # lambda = f S/Z, so that the wave's speed is Eq. 8 at Z = Z_near lam_max/lambda.
    camera = fl.camera.Camera(**CAMERAS[name])
    shape = (100, 130) if overlap == 47 else SHAPE
    velocity = np.array([0.02, -0.05, 0.08])
    options = {"near_depth": 3.0, "tile": tile, "overlap": overlap}
    drift = fl.camera.tile_drift(shape, velocity, camera, **options)
    y, x = (twin.tile_starts(n, tile=tile, overlap=overlap) + tile / 2 for n in shape)
    assert drift.shape == (len(y), len(x), 2) and drift.dtype == np.float64
    centres = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    # By the law that says it, which is its own inverse.
    stands = wave_depth(np.array([wavelength, 0.0]), near_depth=3.0, longest=32.0)
    assert stands[1] == np.inf and wave_depth(stands[0], near_depth=3.0, longest=32.0) == wavelength
    depth = np.full(len(centres), stands[0])
    # The drift is in camera axes, and counts the eye's offset as a way.
    house = Rotation.from_rotvec(camera.rotation).apply(velocity + camera.offset)
    speed = fl.camera.image_velocity(centres, depth, house, camera, shape)
    drift = drift.reshape(-1, 2)
    assert np.abs(speed - drift * wavelength / 32.0).max() < 1e-12 * max(1.0, np.abs(drift).max())


PATHS = {
    "inside": (0.01, -0.02, 0.4), "on the border": (0.4 * 320.0 / 600.0, 0.0, 0.4),
    "outside": (2.0, 1.0, 0.4), "at infinity": (0.3, -0.2, 0.0),
    "nearly at infinity": (0.3, -0.2, 1e-310), "behind": (0.01, -0.02, -0.4),
}  # fmt: skip


@every("path", PATHS)
def test_tile_directions(path: str):
    # Each tile within 1e-12 rad of Eq. 8 taken at its centre, wherever the focus of expansion is:
    # the paper's plain arctan, without the sign of Tz, fails wherever some tile moves left.
    tx, ty, tz = (np.longdouble(v) for v in PATHS[path])
    y, x = np.ix_(*(twin.tile_starts(n) + 32.0 - n / 2 for n in SHAPE))
    want = (tz * x - 600 * tx) + 1j * (tz * y - 600 * ty)
    got = fl.camera.tile_drift(SHAPE, PATHS[path], fl.camera.Camera(600.0), near_depth=3.0)
    assert np.isfinite(got).all()
    across, down = np.moveaxis(got, -1, 0)
    assert np.abs(np.angle((across + 1j * down) * np.conj(want))).max() < 1e-12


Camera, Keys, Scene, Snow = fl.camera.Camera, fl.Keys, fl.Scene, fl.effects.TentSnow
LENS = Camera(300.0)
FPS = 24.0
W, H = 90, 70
PLACES = np.random.default_rng(4).normal(size=(9, 3)).cumsum(axis=0)
KEYED = fl.Keys([(2, (0.0, 1.0, 5.0)), (5, (3.0, 1.0, 4.0)), (11, (3.0, -2.0, 9.0))])
WAYS: dict[str, fl.CameraPath] = {
    "still": fl.CameraPath(LENS),
    "array": fl.CameraPath(LENS, position=PLACES),
    "one place": fl.CameraPath(LENS, position=[(1.0, 2.0, 3.0)]),
    "keys": fl.CameraPath(LENS, position=KEYED),
    "one key": fl.CameraPath(LENS, position=fl.Keys([(4, (1.0, 2.0, 3.0))])),
    "velocity": fl.CameraPath(LENS, velocity=(0.5, -1.0, 3.0)),
    "keyed velocity": fl.CameraPath(LENS, velocity=KEYED),
}
CORNERS = [*range(9), 11]


@every("name", WAYS)
@every("span", [(0.0, 3.7), (-6.5, 2.0), (1.25, 20.5), (-40.0, -31.5)])
def test_place_is_the_integral_of_rate(name: str, span: tuple[float, float]):
    path, (start, stop) = WAYS[name], span
    moved = path.place(stop, fps=FPS) - path.place(start, fps=FPS)
    corners = [c for c in CORNERS if start < c < stop]
    for axis in range(3):
        want, _ = quad(
            lambda t, i=axis: path.rate(t, fps=FPS)[i], start, stop, points=corners or None
        )
        assert moved[axis] == pytest.approx(want, abs=1e-9)


def test_outside_it_goes_on_with_the_end_rates():
    for name, t, want in [
        ("array", -10.5, PLACES[0] - 10.5 * (PLACES[1] - PLACES[0])),
        ("array", 15.25, PLACES[-1] + 7.25 * (PLACES[-1] - PLACES[-2])),
        ("keys", 0, (-2.0, 1.0, 17 / 3)), ("keys", 13, (3.0, -3.0, 32 / 3)),
    ]:  # fmt: skip
        assert np.allclose(WAYS[name].place(t, fps=FPS), want, rtol=1e-14)
    # A velocity is held instead.
    for t, want in ((-100, (0.0, 1.0, 5.0)), (100, (3.0, -2.0, 9.0))):
        assert np.allclose(WAYS["keyed velocity"].rate(t, fps=FPS), np.array(want) / FPS)


@every(("arguments", "forward"), [
    ({"velocity": (1.0, 1.0, 0.0)}, False), ({"velocity": (0.0, 0.0, -1.0)}, True),
    ({"velocity": fl.Keys([(0, (0, 0, 0)), (9, (0, 0, 1))])}, True),
    ({"velocity": fl.Keys([(0, (1, 0, 0)), (9, (0, 1, 0))])}, False),
    ({"position": [(0, 0, 5), (1, 1, 5)]}, False), ({"position": [(0, 0, 5), (0, 0, 6)]}, True),
    ({"position": fl.Keys([(0, (0, 0, 5)), (3, (1, 0, 5))])}, False),
    ({"position": fl.Keys([(0, (0, 0, 5)), (3, (1, 0, 6))])}, True),
])  # fmt: skip
def test_whether_it_goes_forward(arguments: dict[str, Any], forward: bool):
    assert fl.CameraPath(LENS, **arguments).goes_along(np.array([0.0, 0.0, 1.0])) is forward


def asked(snow: fl.effects.TentSnow, frame: fl.effects.Frame) -> Any:
    field = snow.parts.texture.field
    return field.request(frame, field.motion.way(frame))


@pytest.mark.parametrize(("wind", "fall"), [((0.7, 0.0, 0.0), 1.4), ((-3.0, 0.5, 0.0), 0.1)])
def test_the_longest_wave_moves_as_a_flake_at_its_depth(wind: Any, fall: float):
    snow = Snow(wind=wind, fall=fall, near_depth=9.0)
    scene = Scene(size=(W, H), camera=Camera(123.0), effects=[snow], fps=25.0)
    requests = [asked(snow, frame_of(scene, t)) for t in (4.0, 5.0)]
    speed = 123.0 * np.array([wind[0], wind[1] + fall]) / (25.0 * 9.0)
    assert np.abs(requests[1].drift - requests[0].drift - speed).max() < 1e-12
    assert np.abs(requests[0].velocity - speed).max() < 1e-12
    assert requests[0].wavelengths == snow.parts.texture.field.band((H, W))
    assert asked(Snow(overlap=40, wavelengths=(2.0, 8.0)), frame_of(scene, 4.0)).overlap == 23


def test_a_million_frames_are_exact():
    snow = Snow(wind=(0.35, 0.0, 0.0), fall=1.4, near_depth=12.0)
    scene = Scene(size=(256, 256), camera=Camera(307.2), effects=[snow], fps=30.0)
    drift = asked(snow, frame_of(scene, 1_000_000.0)).drift[0, 0, 0]
    longest = Fraction(snow.parts.texture.field.band((256, 256))[1])
    for got, speed in zip(drift, (0.35, 1.4), strict=True):
        cycles = Fraction(307.2) * Fraction(speed) * 1_000_000 / 30 / 12 / longest
        assert abs(Fraction(float(got)) / longest - cycles) <= 1e-9
        single = np.float32(307.2) * np.float32(speed) / np.float32(30 * 12) / np.float32(longest)
        assert abs(Fraction(float(single * np.float32(1e6))) - cycles) > 1e-9


def test_keyed_air_has_come_as_far_as_its_integral():
    wind, fall = Keys([(3, (0, 0, 1)), (8, (6, -1, 0))]), Keys([(-2, 1.0), (5, 3.0)])
    snow = Snow(wind=wind, fall=fall)
    path = fl.CameraPath(LENS, velocity=Keys([(0, (0, 0, 0)), (6, (1, 2, 3))]))
    scene = Scene(size=(W, H), camera=path, effects=[snow], fps=20.0)
    for t in (-7.5, 0.0, 4.25, 30.0):
        air = (np.array(wind.integral(t)) + np.array([0.0, fall.integral(t), 0.0])) / 20.0
        moved = snow.parts.motion.way(frame_of(scene, t)).moved
        assert np.abs(moved - (path.place(t, fps=20.0) - air)).max() < 1e-13
        ahead, behind = (snow.parts.motion.way(frame_of(scene, t + s)).moved for s in (1e-3, -1e-3))
        rate = snow.parts.motion.way(frame_of(scene, t)).rate
        assert np.abs((ahead - behind) / 2e-3 - rate).max() < 1e-3  # a key may lie between


def test_a_lens_far_off_the_middle_is_no_endless_work():
    def shown(center: tuple[float, float]) -> fl.Scene:
        return Scene(size=(W, H), camera=Camera(100.0, center=center), effects=[Snow(flakes=1000)])

    shown((1e6, 35.0)).render(0)
    with pytest.raises(ValueError, match="holds more than 6e7 flakes"):
        shown((1e9, 1e9)).render(0)
    # All drops of a shower before a wide lens would fill the memory.
    drops = fl.Rain("downpour", method="simulated")
    with pytest.raises(ValueError, match="holds more than 6e7 flakes"):
        Scene(size=(64, 120), camera=Camera(38.0), effects=[drops]).render(0)


RAMP = Keys([(-3, 2.0), (4, -1.0), (4.5, 5.0), (90, 5.0), (100, 0.25)])
VECTOR = Keys([(2, (1.0, 0.0, -1.0)), (10, (3.0, -8.0, 1.0)), (11, (0.0, 0.0, 0.5))])
TIMES = [-1e6, -5.5, -3.0, 0.0, 1.0, 3.999, 4.0, 4.25, 4.5, 17.3, 90.0, 99.9, 100.0, 101.0, 1e6]


def exact(keys: Keys, t: float) -> Fraction:
    """The integral from 0 to `t` in exact rational arithmetic, values held outside."""
    pairs = [(Fraction(f), Fraction(v)) for f, v in keys.keys]

    def area(end: Fraction) -> Fraction:
        first, last = pairs[0], pairs[-1]
        if end <= first[0]:
            return first[1] * (end - first[0])
        total = Fraction(0)
        for (f0, v0), (f1, v1) in itertools.pairwise(pairs):
            stop = min(end, f1)
            if stop > f0:
                at_stop = v0 + (v1 - v0) * (stop - f0) / (f1 - f0)
                total += (v0 + at_stop) / 2 * (stop - f0)
        return total + last[1] * max(end - last[0], Fraction(0))

    return area(Fraction(t)) - area(Fraction(0))


def test_values_at_and_between_the_keys():
    for keys in (RAMP, VECTOR):
        assert all(keys.at(frame) == value for frame, value in keys.keys)
    assert (RAMP.at(0.5), RAMP.at(4.25), RAMP.at(95.0)) == (0.5, 2.0, 2.625)
    assert VECTOR.at(6) == (2.0, -4.0, 0.0)
    assert isinstance(RAMP.at(1), float) and isinstance(VECTOR.at(1), tuple)
    assert (RAMP.width, VECTOR.width) == (None, 3)


def test_outside_the_keys_values_hold_or_go_on():
    assert RAMP.at(-1e9) == 2.0 and RAMP.at(1e9) == 0.25
    assert RAMP.slope(-4) == 0.0 and RAMP.slope(101) == 0.0 and RAMP.slope(100) == 0.0
    assert RAMP.at(-10, extend=True) == 2.0 + 7 * 3 / 7
    assert RAMP.at(104, extend=True) == pytest.approx(0.25 - 4 * 4.75 / 10, rel=1e-15)
    assert RAMP.slope(-10, extend=True) == -3 / 7
    assert RAMP.slope(100, extend=True) == -4.75 / 10
    assert VECTOR.at(0) == (1.0, 0.0, -1.0)
    assert VECTOR.at(0, extend=True) == (0.5, 2.0, -1.5)


@pytest.mark.parametrize("extend", [False, True])
def test_slope_is_the_change_of_the_value(extend: bool):
    step = 2.0**-12  # smaller than any distance from a key below
    for t in (-9.3, -1.7, 3.3, 4.2, 50.1, 95.5, 120.2):
        for keys in (RAMP, VECTOR):
            ahead, behind = (np.array(keys.at(t + s, extend=extend)) for s in (step, -step))
            wanted = (ahead - behind) / (2 * step)
            assert np.abs(np.array(keys.slope(t, extend=extend)) - wanted).max() < 1e-10
    assert RAMP.slope(4) == 12.0, "at a key the slope is that of what comes"


@every("t", TIMES)
def test_integral_is_exact(t: float):
    want = exact(RAMP, t)
    assert abs(RAMP.integral(t) - want) <= 1e-15 * max(1.0, float(abs(want)), abs(t))
    parts = [Keys([(f, v[i]) for f, v in VECTOR.keys]) for i in range(3)]
    for got, part in zip(VECTOR.integral(t), parts, strict=True):
        assert abs(got - exact(part, t)) <= 1e-15 * max(1.0, abs(t) * 3)
    assert integral_to(RAMP, t) == RAMP.integral(t)
