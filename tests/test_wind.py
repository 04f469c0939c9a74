"""Wind over depth, gusts and swirls: no air is made, and waves and flakes move alike."""

import math
import pickle
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flurries as fl
from flurries.effects.uneven import wind_at
from flurries.motion.keys import Course
from flurries.motion.waves import Waves, carry
from measure import FOCAL, LONGEST, frame_of, scene

Wind, Keys, Snow, Camera = fl.Wind, fl.Keys, fl.effects.TentSnow, fl.camera.Camera
RNG = np.random.default_rng(23)
GRID = RNG.normal(size=(4, 5, 6, 7, 3))
WINDS = {
    "gusts": Wind((2.0, 0.0, 0.5), gusts=1.0, seed=3),
    "swirl": Wind((0.5, 0.0, 0.0), swirl=0.7, scale=5.0, seed=4),
    "both": Wind((1.0, 0.0, -0.5), gusts=1.0, swirl=0.5),
}
LENS = Camera(FOCAL)


@pytest.mark.parametrize("name", WINDS)
def test_no_air_is_made(name: str):
    wind, step = WINDS[name], 1e-3
    at = RNG.uniform(-30.0, 30.0, (200, 3))
    ends = ([wind.velocity(at + s * e, 7.3) for e in np.eye(3)] for s in (step, -step))
    slopes = np.subtract(*ends).swapaxes(0, 1) / (2 * step)
    divergence = np.trace(slopes, axis1=1, axis2=2)
    steepest = np.sqrt((slopes**2).sum(axis=(1, 2))).mean()
    # Differences err by k^2 step^2 / 6 < 2e-6 of the slopes.
    assert np.abs(divergence).max() < 1e-5 * steepest
    # The negative control: a part along k would be seen.
    waves = wind.waves
    assert np.abs(np.einsum("mi,mi->m", waves.k, waves.a)).max() < 1e-12
    assert np.abs(np.trace(slopes * np.array([1.0, 1.0, 0.0]), axis1=1, axis2=2)).max() > 1e-2


@pytest.mark.parametrize(("arguments", "speed"), [({"gusts": 1.5}, 1.5), ({"swirl": 0.4}, 0.4),
                                                  ({"gusts": 3.0, "swirl": 4.0}, 5.0)])  # fmt: skip
def test_speeds_are_those_that_were_asked_for(arguments: Any, speed: float):
    found = []
    for seed in range(6):
        wind = Wind(seed=seed, **arguments)
        at = np.random.default_rng(seed).uniform(0.0, 4000.0, (20_000, 3))
        found.append((wind.velocity(at, 11.0) ** 2).sum(axis=1).mean())
    assert math.sqrt(np.mean(found)) == pytest.approx(speed, rel=0.02)
    mean = Wind((1.0, 2.0, 3.0), **arguments).velocity(at, 5.0).mean(axis=0)
    assert np.abs(mean - (1.0, 2.0, 3.0)).max() < 0.05 * speed


def test_gusts_travel_with_the_wind():
    wind = Wind((3.0, 0.0, 1.0), gusts=0.3, seed=9)
    at = RNG.uniform(-50.0, 50.0, (500, 3))
    first = wind.velocity(at, 0.0) - wind.mean
    later = wind.velocity(at + np.array(wind.mean), 1.0) - wind.mean
    still = wind.velocity(at, 1.0) - wind.mean
    alike = [np.sum(first * other) / np.sum(first**2) for other in (later, still)]
    assert alike[0] > alike[1] + 0.05 and alike[0] > 0.85


def test_a_field_of_one_s_own_is_met_at_its_samples():
    wind, plain = (Wind(field=GRID, modes=4096, **how) for how in (
        {"spacing": 2.0, "duration": 3.0}, {},
    ))  # fmt: skip
    t, z, y, x = np.indices(GRID.shape[:4]).reshape(4, -1)
    for time in range(4):
        at = np.stack([x, y, z], axis=1)[t == time] * 2.0
        want = GRID[time].reshape(-1, 3)
        assert np.abs(wind.velocity(at, time * 3.0 / 4) - want).max() < 1e-13
        # A metre and a second, where nobody says.
        assert np.abs(plain.velocity(0.5 * at, time / 4) - want).max() < 1e-13
        # It repeats in space and time.
        again = wind.velocity(at + np.array([14.0, -12.0, 10.0]), time * 0.75 + 6.0)
        assert np.abs(again - want).max() < 1e-12
    still = Wind(field=GRID[0], spacing=2.0, modes=4096)
    assert np.abs(still.velocity(at, 123.4) - GRID[0].reshape(-1, 3)).max() < 1e-13
    few = Wind(field=GRID, modes=20)
    assert len(few.waves.k) == 20 and len(Wind(field=GRID).waves.k) == 64
    kept = [np.sum(np.abs(w.waves.a) ** 2) for w in (few, plain)]
    assert 0.05 < kept[0] / kept[1] < 0.6


@pytest.mark.parametrize(("arguments", "shortest", "longest"), [
    ({"gusts": 1}, 16.0, 64.0), ({"swirl": 1}, 2.0, 8.0), ({"swirl": 1, "scale": 2}, 0.5, 2.0),
])  # fmt: skip
def test_waves_are_as_long_as_the_scale_says(arguments: Any, shortest: float, longest: float):
    """Evenly over the octaves: of 24 waves the ends are within two shares of them."""
    octaves = np.log2(np.sort(2.0 * np.pi / np.linalg.norm(Wind(**arguments).waves.k, axis=1)))
    step = math.log2(longest / shortest) / 24
    assert np.abs(octaves - np.log2(shortest) - step * (np.arange(24) + 0.5)).max() <= 0.5 * step


@pytest.mark.parametrize("rate", [0.0015, 0.0005])
def test_what_is_carried_swings_about_its_place(rate: float):
    """By a wave that turns slower than this for as long as a film is: it starts where it is."""
    one = Waves(np.array([[1.0, 0.0, 0.0]]), np.zeros(1), np.ones((1, 3), complex), np.zeros(1))
    course = Course(np.empty(0), np.array([[rate, 0.0, 0.0]]))
    _, turns = carry(one, course, 25.0)
    for t in (0.0, 300.0, 2000.0):
        want = (np.exp(1j * rate * t) - (rate < 1e-3)) / (1j * rate)
        assert np.hypot(*(turns.to(t) - [want.real, want.imag])) < 1e-9 / rate


def carried_by(wind: fl.Wind, start: np.ndarray, fall: Any, t: float) -> np.ndarray:
    """Where points come to by frame t that fall through the field along their undisturbed ways."""
    mean, falls = (v if isinstance(v, Keys) else Keys([(0, v)]) for v in (wind.mean, fall))

    def rate(t: float, _: np.ndarray) -> np.ndarray:
        way = np.array(mean.integral(t)) + np.array([0.0, falls.integral(t), 0.0])
        return (wind.velocity(start + way / 30.0, t / 30.0) - mean.at(0.0)).ravel() / 30.0

    got = solve_ivp(rate, (0.0, t), np.zeros(start.size), rtol=1e-11, atol=1e-12)
    return got.y[:, -1].reshape(-1, 3)


def blown(wind: fl.Wind, times: Sequence[float], fall: Any = 1.4) -> tuple[np.ndarray, np.ndarray]:
    """Places of flakes that all frames show, (frame, n, 3): in a wind, and in its mean alone."""
    lists = []
    for air in (wind, wind.mean):
        snow = Snow(wind=air, fall=fall, sway=(0.0, 1.0), flakes=3000, texture=0.0)
        lists += [fl.flakes(scene(snow, camera=Camera(100.0)), t) for t in times]
    shared = lists[0]["id"]
    for found in lists[1:]:
        shared = np.intersect1d(shared, found["id"])
    assert len(shared) > 50
    places = []
    for found in lists:
        own = found[np.isin(found["id"], shared)]
        places.append(own["place"][np.argsort(own["id"])])
    return np.array(places[: len(times)]), np.array(places[len(times) :])


KEYED = Wind(Keys([(0, (1.0, 0.0, 0.0)), (40, (-2.0, 0.5, 1.0))]), gusts=0.8, seed=2)


@pytest.mark.parametrize(("wind", "fall", "t"), [
    (WINDS["both"], 1.4, 12.0), (WINDS["both"], 1.4, 75.5), (WINDS["both"], 1.4, -20.0),
    (KEYED, Keys([(10, 1.0), (30, 2.0)]), 60.0),
])  # fmt: skip
def test_flakes_are_displaced_by_the_integral_along_their_way(wind: Any, fall: Any, t: float):
    (first, later), (start, calm) = blown(wind, (0.0, t), fall)
    # The same flakes as without gusts, each displaced; where the swings begin is free.
    want = carried_by(wind, start, fall, t)
    assert np.abs((later - calm) - (first - start) - want).max() < 1e-8
    assert np.abs(want).max() > 0.05


def test_gusts_stay_bounded_for_ever():
    wind = Wind((1.5, 0.0, 0.0), gusts=1.2, swirl=0.6, seed=5)
    sizes = []
    for t in (1e2, 1e3, 1e4, 1e5, 1e6, -1e6):
        (moved,), (calm,) = blown(wind, (t,))
        sizes.append(np.sqrt(((moved - calm) ** 2).sum(axis=1).mean()))
    # Of each wave the air's speed over how fast it changes: the way to and fro.
    ways = np.abs(wind.waves.a) / wind.waves.own[:, None]
    spread = np.sqrt(0.5 * np.sum(ways**2))
    assert 0.1 * spread < max(sizes) < 2.0 * spread


@pytest.mark.parametrize("name", WINDS)
def test_rings_and_flakes_of_one_depth_move_alike(name: str):
    """The texture's rings by their own integral; the rates are those of the air at the place."""
    wind = WINDS[name]
    snow = Snow(wind=wind, wavelengths=(4.0, LONGEST))
    frame = frame_of(scene(snow), 33.0)

    ahead = RNG.uniform((-6, -6, 3), (6, 6, 60), (40, 3))
    _, of_air = wind_at(snow.parts.motion, frame, ahead)
    world = wind.velocity(ahead, 33.0 / 30.0) - wind.mean
    assert np.abs(of_air * 30.0 - world).max() < 1e-12
    # The displacement is the integral of the rate at the place.
    step = 1e-4
    frames = [frame_of(scene(snow), 33.0 + s) for s in (-step, step)]
    before, after = (wind_at(snow.parts.motion, f, ahead)[0] for f in frames)
    assert np.abs((after - before) / (2 * step) - of_air).max() < 1e-8
    # And of a camera that flies, with the place.
    path = fl.CameraPath(LENS, velocity=(0.5, -0.2, 3.0))
    frames = [frame_of(scene(snow, camera=path), 33.0 + s) for s in (-step, 0.0, step)]
    before, now, after = (wind_at(snow.parts.motion, f, ahead) for f in frames)
    assert np.abs((after[0] - before[0]) / (2 * step) - now[1]).max() < 1e-8


def test_the_wind_of_a_flake_s_own_place_is_nearly_the_same():
    # By how much flakes and the texture beside them differ: docs/internals/deviations.md.
    wind, step = WINDS["both"], 1.0 / 64.0
    moved, _ = blown(wind, (40.0 - step, 40.0, 40.0 + step))
    felt = (moved[2] - moved[0]) * 15.0 / step - (0.0, 1.4, 0.0)
    off = np.linalg.norm(felt - wind.velocity(moved[1], 40.0 / 30.0), axis=1)
    assert np.median(off / np.linalg.norm(felt, axis=1)) < 0.22


def test_a_profile_of_factors_scales_the_mean():
    wind = Wind(
        Keys([(0, (2.0, 0.0, 0.0)), (20, (4.0, 0.0, 0.0))]), profile=[(5.0, 0.5), (20.0, 3.0)]
    )
    snow = Snow(wind=wind)
    ahead = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, 12.5), (0.0, 0.0, 90.0)])
    moved, rate = wind_at(snow.parts.motion, frame_of(scene(snow), 20.0), ahead)
    assert np.allclose(rate[:, 0] * 30.0, 4.0 * (np.array([0.5, 1.75, 3.0]) - 1.0))
    assert np.allclose(moved[:, 0] * 30.0, 60.0 * (np.array([0.5, 1.75, 3.0]) - 1.0))


def test_equal_winds_are_equal():
    assert Wind((1, 2, 3), gusts=1.0) == Wind((1.0, 2.0, 3.0), gusts=1) != Wind((1, 2, 3))
    assert Wind(field=GRID) == Wind(field=GRID.copy()) != Wind(field=GRID + 1)
    assert hash(Wind(field=GRID)) == hash(pickle.loads(pickle.dumps(Wind(field=GRID))))
    # One air for all: snow and rain that share a wind share its gusts, whatever their own seeds.
    wind = Wind(gusts=1.0)
    at = RNG.uniform(-5, 5, (5, 3))
    effects = [Snow(wind=wind, seed=1), fl.effects.TentRain(wind=wind, seed=2)]
    shown = fl.Scene(size=(64, 48), effects=effects)
    rates = [wind_at(e.parts.motion, frame_of(shown, 9.0, i), at)[1] for i, e in enumerate(effects)]
    assert np.array_equal(*rates)


SHEARED = Wind(profile=[(2.0, (1.0, 0.0, 0.0)), (48.0, (-1.5, 0.4, 0.0))])


@pytest.mark.parametrize("effect", [Snow(wind=SHEARED, flakes=0), fl.Snow(wind=SHEARED)])
def test_a_wind_with_a_profile_wants_a_camera_that_does_not_turn(effect: Any):
    path = fl.CameraPath(LENS, orientation=[(0, 0, 0), (0, 0.01, 0)])
    with pytest.raises(ValueError, match="wind: a profile"):
        fl.Scene(size=(64, 48), camera=path, effects=[effect]).render(3)


@pytest.mark.parametrize("yaw", [-0.5, 0.5])
def test_far_flakes_in_a_profile_stay_as_far_from_a_camera_that_looks_aside(yaw: float):
    aside = fl.Camera(200.0, rotation=(0.0, yaw, 0.0))
    snow = fl.Snow("heavy", wind=SHEARED, handover=2.0, color=1.0, haze=0.0)
    shown = fl.Scene("#000000", size=(192, 128), camera=aside, effects=[snow], fps=30.0)

    def fine(t: float) -> float:
        seen = shown.render(t)[..., 0].astype(float)
        return float(np.abs(np.diff(seen)).mean() / seen.std())

    assert [fine(t) for t in (900.0, 20_000.0)] == pytest.approx([fine(0.0)] * 2, rel=0.1)
