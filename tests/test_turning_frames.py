"""What a camera that turns sees: texture, flakes, streaks and two eyes, measured on frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skimage.registration import optical_flow_ilk

import flurries as fl
import measure
from flurries.effects import TentSnow
from measure import FLAKES, FOCAL, LONGEST, NEAR, SIZE, TEXTURE, picture, scene
from test_turning import Camera, Keys, Path_

SMALL = {"flakes": 300}


def test_a_closed_path_returns_the_frame():
    loop = np.array([(0, 0, 0), (1, 0, 2), (3, -1, 2), (1, 1, 1), (0, 0, 0)], dtype=float)
    still = TentSnow(fall=0.0, wind=(0.0, 0.0, 0.0), sway=(0.0, 1.0), shutter=0.0, **SMALL)
    for tilt in (None, np.tile((0.1, 0.2, 0.3), (5, 1))):
        path = Path_(Camera(110.0), position=loop, orientation=tilt)
        assert not path.turns
        shown = fl.Scene(size=(90, 70), camera=path, effects=[still])
        # But for the waves' temporal filter, which goes by the rate of the frame.
        field = still.parts.texture.field
        frames = [one(shown, t) for t in (0.0, 4.0)]
        first, last = (field.request(frame, field.motion.way(frame)) for frame in frames)
        assert np.array_equal(first.drift, last.drift) and np.array_equal(first.shift, last.shift)
        kept = shown.replace(effects=[replace(still, alias="keep")])
        assert np.array_equal(kept.render(0), kept.render(4))
        assert not np.array_equal(kept.render(0), kept.render(2))


def one(shown: fl.Scene, t: float) -> fl.Frame:
    return shown.program.views(t)[0][1]


# A camera that pans, tilts, rolls and moves, 10 px a frame in all.
SPIN = np.array([0.004, 0.012, -0.004])


def turning(spin: np.ndarray = SPIN) -> fl.CameraPath:
    turns = Keys([(0, (0, 0, 0)), (100, tuple(100 * spin))])
    return Path_(Camera(FOCAL), velocity=(0.6, -0.4, 0.0), orientation=turns)


def expected(shown: fl.Scene, t: float, px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Flow at pixels by rotation alone, and by translation at a depth of 1 m; twin of its own."""
    path = shown.camera
    turn = path.turn(t)
    x, y = (px - SIZE / 2.0).T
    ahead = np.column_stack([x / FOCAL, y / FOCAL, np.ones(len(px))])
    omega = turn.T @ path.spin(t)
    snow = shown.effects[0]
    air = np.array([snow.wind[0], snow.wind[1] + snow.fall, snow.wind[2]])
    v = turn.T @ (path.rate(t, fps=shown.fps) - air / shown.fps)

    def image(speed: np.ndarray) -> np.ndarray:
        return FOCAL * (speed[:, :2] - ahead[:, :2] * speed[:, 2:])

    return image(-np.cross(omega, ahead)), image(np.tile(-v, (len(px), 1)))


def fit_of_flow(flow: np.ndarray, judge: fl.Scene, t: float) -> tuple[np.ndarray, float]:
    """A flow as rotation * a + translation / Z: (a, 1 / Z), and the rest."""
    rows, cols = (grid.ravel() for grid in np.mgrid[40 : SIZE - 40 : 12, 40 : SIZE - 40 : 12])
    flow = flow[rows, cols]
    turned, moved = expected(judge, t, np.stack([cols, rows], axis=1) + 0.5)
    system = np.stack([turned.ravel(), moved.ravel()], axis=1)
    found, *_ = np.linalg.lstsq(system, flow.ravel(), rcond=None)
    rest = np.sqrt(np.mean((system @ found - flow.ravel()) ** 2) / np.mean(flow**2))
    return found, float(rest)


# Long waves: those that a turn of 10 px a frame would make alias are few.
SOFT = {**TEXTURE, "wavelengths": (12.0, LONGEST), "shutter": 0.0, "alias": "keep"}


@pytest.mark.parametrize("t", [5.0, 60.0])
def test_the_texture_flows_as_the_camera_turns_and_moves(t: float):
    shown = scene(SOFT, camera=turning())
    first, second = picture(shown, t), picture(shown, t + 0.25)
    down, across = optical_flow_ilk(first, second, radius=24, num_warp=8)
    flow = np.stack([across, down], axis=-1) / 0.25
    (rotation, inverse), rest = fit_of_flow(flow, shown, t + 0.125)
    assert abs(rotation - 1.0) < 0.05
    # What lies between near_depth and the depth of the shortest wave moves as one mean of them.
    assert NEAR < 1.0 / inverse < NEAR * LONGEST / 12.0
    assert rest < 0.06
    # A wrong turn would be seen.
    for wrong in (-SPIN, SPIN[[1, 0, 2]], SPIN * (1, 1, -4), 0.8 * SPIN):
        (rotation, _), rest = fit_of_flow(flow, scene(SOFT, camera=turning(wrong)), t + 0.125)
        assert abs(rotation - 1.0) > 0.05 or rest > 0.06


def test_flakes_move_as_the_camera_turns_and_moves():
    step, way = 0.25, turning()
    for t in (5.0, 60.0):
        rows = np.concatenate([
            measure.flake_shifts(scene(FLAKES, camera=way, seed=seed), t, step)
            for seed in range(6)
        ])  # fmt: skip
        assert len(rows) >= 15
        shown = scene(FLAKES, camera=way)
        turned, moved = expected(shown, t + 0.5 * step, rows[:, 1:3])
        want = turned + moved / rows[:, :1]
        off = np.linalg.norm(rows[:, 3:] / step - want, axis=1) / np.linalg.norm(want, axis=1)
        assert np.median(off) < 0.01 and np.quantile(off, 0.9) < 0.04
        # A camera that turns the other way, or flakes that don't turn, are far off.
        for wrong in (moved / rows[:, :1], moved / rows[:, :1] - turned):
            bad = np.linalg.norm(rows[:, 3:] / step - wrong, axis=1) / np.linalg.norm(want, axis=1)
            assert np.median(bad) > 0.3


def test_density_is_constant_and_nothing_pops():
    flakes = {**FLAKES, "flakes": 2000, "flake_size": (0.02, 0.02)}

    def mean(t: float, **camera: object) -> float:
        shown = [scene(flakes, seed=seed, size=256, **camera) for seed in range(4)]
        return float(np.mean([picture(one, t).mean() for one in shown]))

    camera = replace(turning(), camera=Camera(1.2 * 256))
    # 8000 flakes in all, of unequal size in the picture.
    means = [mean(t, camera=camera) for t in (0.0, 33.0, 150.0, 400.0)]
    assert np.abs(np.array(means) / mean(0.0) - 1.0).max() < 0.06
    one = scene(flakes, seed=0, size=256, camera=camera)
    changes = measure.largest_changes(lambda t: picture(one, t), np.arange(0.0, 60.0, 7.3))
    assert measure.smooth(changes)


def test_two_eyes_of_a_turning_camera_see_one_air():
    path = turning()
    eye = Camera(FOCAL, offset=(0.06, 0.0, 0.0))
    torus = scene({**TEXTURE, "tile": SIZE, "overlap": 0, "alias": "keep"}, camera=path)
    pair = picture(torus, 40.0), picture(torus, 40.0, eye=eye)
    for parallax in measure.parallax(pair):
        assert parallax == pytest.approx((-FOCAL * 0.06, 0.0), abs=0.02 * FOCAL * 0.06)
