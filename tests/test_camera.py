"""The camera: where points are seen, how their images move, and the drift of every tile."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flurries as fl
import twin
from every import every
from flurries.spectral.tables import wave_depth

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
    """Points all around, some of them behind."""
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
