"""Rays to azimuth and height: the frame, the perspective, the pole, the seam, an eye beside."""

import numpy as np
import pytest

import twin_cone as twin
from every import every
from flurries import cone
from flurries.camera import Camera, image_velocity

SHAPE = (90, 120)
CAMERA = Camera(100.0, rotation=(0.2, -0.4, 0.1))
AXES = [(0, 1, 0), (0, -1, 0), (1, 0, 0), (0, 0, 1), (0.3, 0.9, -0.4), (-0.5, 0.2, 0.8)]


@every("axis", AXES)
@every("slope", [0.0, 0.2])
def test_rays_are_the_twins(axis, slope):
    seen = cone.rays(SHAPE, CAMERA, axis=axis, slope=slope)
    points = twin.centres(SHAPE)
    rays = twin.directions(points, CAMERA, SHAPE)
    azimuth, height = twin.hit(rays, axis, slope)
    off = seen.azimuth.ravel() - azimuth
    # Near the axis a rounding of the ray is a large turn: 1e-15 over the distance from it.
    across = np.sqrt(1 - np.minimum((rays @ twin.basis(axis)[0]) ** 2, 1.0))
    assert (np.abs(off - np.round(off)) <= 1e-15 / np.maximum(across, 1e-8)).all()
    # The same where it is seen, in heights: d w is d e / c^2.
    assert (np.abs(seen.height.ravel() - height) * across**2 <= 3e-15).all()
    np.testing.assert_allclose(seen.fade.ravel(), twin.fade(rays, axis), atol=1e-12)
    around, up = twin.steps(points, CAMERA, SHAPE, axis, slope)
    away = across > 0.05
    np.testing.assert_allclose(seen.azimuth_step.ravel()[away], around[away], rtol=1e-5)
    np.testing.assert_allclose(seen.height_step.ravel()[away], up[away], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("travel", [(0.5, 2, 8), (-3, 1, 2), (0.1, 4, -6), (0.3, 1.0, 1e-3)])
def test_the_apex_is_the_focus_of_expansion(travel):
    # The one position from which nothing seems to move, found from Eq. 8 alone.
    camera, shape = Camera(500.0, rotation=(0.1, 0.2, -0.3)), (480, 640)
    points = [(0.0, 0.0), (100.0, 0.0), (0.0, 100.0)]
    # The velocity is camera minus drop.
    flow = image_velocity(points, np.ones(3), -np.array(travel, float), camera, shape)
    focus = np.linalg.solve((flow[1:] - flow[0]).T / 100.0, -flow[0])
    # The apex: where the ray is the axis itself.
    axis = cone.path([0.0], travel).axis[0]
    local = axis @ camera.matrix()
    apex = np.array(camera.principal(shape)) + camera.focal * local[:2] / local[2]
    assert np.abs(apex - focus).max() <= 1e-9 * max(1.0, np.abs(apex).max())
    # And the rays there agree: nothing is shown, nothing lies across.
    seen = cone.rays(shape, camera, axis=axis, points_px=[apex])
    assert seen.fade[0] == 0.0 and abs(seen.height[0]) > 1e5


def test_two_eyes_see_the_cone_at_its_distance():
    # A point of the cylinder straight ahead: its disparity is f b / R.
    shape, radius, apart = (64, 128), 2.0, 0.064
    eyes = [Camera(200.0, offset=(side * apart / 2, 0, 0)) for side in (-1, 1)]
    x = 64.0 + np.linspace(-3, 3, 7)
    look = {"axis": (0, 1, 0), "points_px": np.stack([x, np.full(7, 32.0)], axis=1)}
    left, right = (cone.rays(shape, eye, radius=radius, **look).azimuth for eye in eyes)
    # The right eye sees a point farther left.
    disparity = np.mean(left - right) / np.polyfit(x, left, 1)[0]
    assert abs(disparity - (-200.0 * apart / radius)) < 0.02
    # Without a distance the eyes see the same.
    np.testing.assert_array_equal(*[cone.rays(shape, eye, **look).azimuth for eye in eyes])


def test_azimuths_stay_in_one_turn_and_a_pixel_on_the_axis_is_finite():
    # Rays that turn back from the seam by 1e-32 to 1e-14 among them: a wrap may round up to 1.
    across = np.concatenate([np.logspace(-30, -12, 200), -np.logspace(-30, -12, 200)])
    places = np.column_stack([np.full(400, 20.0), across])
    for seen in (
        cone.rays(SHAPE, Camera(30.0), axis=(0.0, 1e-30, 1.0), slope=0.0),
        cone.rays((16, 16), Camera(30.0, center=(8.0, 0.0)), axis=(0, 0, 1), points_px=places),
        cone.rays((60, 80), Camera(100.0, center=(40.5, 30.5)), axis=(0.0, -0.0, -1.0), slope=0.2),
    ):
        assert (seen.azimuth >= 0.0).all() and (seen.azimuth < 1.0).all()
        numbers = seen.azimuth, seen.height, seen.azimuth_step, seen.height_step, seen.fade
        assert all(np.isfinite(part).all() for part in numbers)
