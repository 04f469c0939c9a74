"""Cameras that turn: orientation over time, the way in turning axes, and what is seen of it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.spatial.transform import Rotation, Slerp

import flurries as fl
import measure
from every import every
from flurries.camera.importers import load
from flurries.camera.lens import rotation_vector
from measure import FOCAL, SIZE, TEXTURE, picture, scene

Camera, Keys, Path_ = fl.camera.Camera, fl.Keys, fl.CameraPath
LENS = Camera(300.0)
FPS = 25.0
RNG = np.random.default_rng(17)
TURNS = Rotation.from_rotvec(RNG.normal(scale=0.4, size=(9, 3)))
PLACES = RNG.normal(size=(9, 3)).cumsum(axis=0)
WAY = Keys([(2, (0.0, 1.0, 5.0)), (5, (3.0, 1.0, 4.0)), (11, (3.0, -2.0, 9.0))])
GUST = Keys([(-3, (1.0, 0.0, 0.5)), (4.5, (-2.0, 0.3, 0.0)), (12, (0.0, 0.0, 1.0))])
FALL = Keys([(0, 1.0), (7, 2.0)])
TIMES = [0.0, 1.0, 3.7, 8.0, 11.25, 40.5, -2.5, -33.0]


def quaternions(turns: Rotation) -> np.ndarray:
    return np.roll(turns.as_quat(), 1, axis=1)  # (w, x, y, z)


FORMS: dict[str, Any] = {
    "vectors": TURNS.as_rotvec(), "quaternions": quaternions(TURNS), "matrices": TURNS.as_matrix(),
    "either sign": quaternions(TURNS) * np.where(np.arange(9) % 2, -1.0, 1.0)[:, None],
    "keys": Keys([(i, tuple(v)) for i, v in enumerate(TURNS.as_rotvec())]),
    "keyed quaternions": Keys([(i, tuple(q)) for i, q in enumerate(quaternions(TURNS))]),
}  # fmt: skip


def twin_turn(t: float) -> np.ndarray:
    """Slerp between the keys; the first and the last piece go on."""
    i = int(np.clip(np.floor(t), 0, 7))
    step = (TURNS[i].inv() * TURNS[i + 1]).as_rotvec()
    return (TURNS[i] * Rotation.from_rotvec((t - i) * step)).as_matrix()


@every("form", FORMS)
def test_all_forms_are_one_turn(form: str):
    path = Path_(LENS, orientation=FORMS[form])
    slerp = Slerp(np.arange(9), TURNS)
    for t in TIMES:
        assert np.abs(path.turn(t) - twin_turn(t)).max() < 1e-13
        if 0.0 <= t <= 8.0:
            assert np.abs(path.turn(t) - slerp(t).as_matrix()).max() < 1e-13
        step = 1e-6
        if t != round(t):
            omega = path.spin(t)
            turned = Rotation.from_rotvec(omega * step).as_matrix() @ path.turn(t)
            assert np.abs(path.turn(t + step) - turned).max() < 1e-11


def test_a_mounted_camera_turns_with_the_rig():
    mount = (0.3, -0.2, 0.1)
    path = Path_(Camera(300.0, rotation=mount), orientation=TURNS.as_rotvec())
    want = twin_turn(2.4) @ Rotation.from_rotvec(mount).as_matrix()
    assert np.abs(path.turn(2.4) - want).max() < 1e-14
    assert np.abs(path.pose(path.camera, 2.4).matrix() - want).max() < 1e-14
    assert np.abs(path.rig(2.4) - twin_turn(2.4)).max() < 1e-14


def test_vectors_may_turn_more_than_half():
    path = Path_(LENS, orientation=Keys([(0, (0, 0, 0)), (10, (0, 14.0, 0)), (12, (0, 14.0, 0.1))]))
    assert np.allclose(path.spin(3.0), (0.0, 1.4, 0.0), atol=1e-15)
    assert np.allclose(path.turn(5.0), Rotation.from_rotvec((0, 7.0, 0)).as_matrix(), atol=1e-13)
    # Matrices can't say so: they turn the shorter way.
    short = Path_(LENS, orientation=Rotation.from_rotvec([(0, 0, 0), (0, 14.0, 0)]).as_matrix())
    assert abs(short.spin(0.5)[1]) == pytest.approx(abs(14.0 - 4 * np.pi), abs=1e-12)


def test_rotation_vectors_of_matrices():
    turns = Rotation.random(200, random_state=3)
    for turn in turns:
        assert np.abs(rotation_vector(turn.as_matrix()) - turn.as_rotvec()).max() < 1e-12
    for axis in np.eye(3):
        for angle in (0.0, 1e-12, 1e-7, np.pi - 1e-9, np.pi):
            matrix = Rotation.from_rotvec(angle * axis).as_matrix()
            got = rotation_vector(matrix)
            assert min(np.abs(got - angle * axis).max(), np.abs(got + angle * axis).max()) < 1e-14


WAYS: dict[str, dict[str, Any]] = {
    "still": {}, "array": {"position": PLACES}, "velocity": {"velocity": (0.5, -1.0, 3.0)},
    "keys": {"position": WAY}, "keyed velocity": {"velocity": WAY},
}  # fmt: skip
AIR: dict[str, dict[str, Any]] = {
    "calm": {"fall": 0.0, "wind": (0.0, 0.0, 0.0)}, "wind": {"fall": 1.4, "wind": (0.4, 0.1, -1.0)},
    "gusts": {"fall": FALL, "wind": GUST},
}  # fmt: skip


def value(given: Any, t: float) -> Any:
    return given.at(t) if isinstance(given, Keys) else given


def twin_velocity(path: fl.CameraPath, air: dict[str, Any], t: float) -> np.ndarray:
    """Camera minus what falls in the wind, per frame, house axes."""
    down = np.array([0.0, value(air["fall"], t), 0.0])
    return path.rate(t, fps=FPS) - (np.array(value(air["wind"], t)) + down) / FPS


def integral(what: Callable[[float], np.ndarray], t: float) -> np.ndarray:
    corners = np.array([*range(-1, 12), 4.5, -3, 12, 7, 2, 5, 11], dtype=float)
    points = [c for c in corners if min(0, t) < c < max(0, t)]
    found: np.ndarray = quad_vec(what, 0.0, t, epsabs=1e-12, epsrel=1e-13, points=points or None)[0]
    return found


# Each way, and each air.
@every("way, air", [*((way, "gusts") for way in WAYS), *(("keys", air) for air in AIR)])
def test_p_is_the_integral_in_turning_axes(way: str, air: str):
    path = Path_(LENS, orientation=TURNS.as_rotvec(), **WAYS[way])
    for t in (3.7, 11.25, 40.5, -2.5):
        want = integral(lambda u: twin_turn(u).T @ twin_velocity(path, AIR[air], u), t)
        got = path.rig(t).T @ path.travel(t, fps=FPS, **AIR[air])
        assert np.abs(got - want).max() < 2e-11 * max(1.0, abs(t))


def test_the_sum_of_the_turning_is_its_integral():
    path = Path_(LENS, orientation=TURNS.as_rotvec())
    for t in TIMES:
        angle = integral(lambda u: twin_turn(u).T @ path.spin(u), t)
        assert np.abs(path.rig(t).T @ path.rotation(t) - angle).max() < 2e-11 * max(1.0, abs(t))


def test_a_million_frames_lose_nothing():
    # One turn in 1000 frames, at 0.1 a frame sideways: P runs round a circle of radius 100 / 2 pi.
    rate = 2.0 * np.pi / 1000.0
    path = Path_(LENS, velocity=(0.1 * FPS, 0.0, 0.0), orientation=[(0, 0, 0), (0, rate, 0)])
    for t in (250.0, 1e6 + 250.0, -1e6 + 250.0):
        way = path.rig(t).T @ path.travel(t, fps=FPS, fall=0.0, wind=(0.0, 0.0, 0.0))
        # R^T (1, 0, 0) = (cos, 0, sin) of the angle for a turn about y.
        want = 0.1 / rate * np.array([np.sin(rate * t), 0.0, 1.0 - np.cos(rate * t)])
        assert np.abs(way - want).max() < 2e-8


def test_a_shift_is_the_flow_of_the_rotation_at_the_middle_of_the_tile():
    lens = Camera(280.0, center=(50.0, 33.0), center_shift=(3.0, -1.0))
    angle = (0.02, -0.03, 0.05)
    got = fl.camera.tile_shift((90, 120), angle, lens, tile=(32, 24), overlap=6)
    rows = fl.spectral.tile_starts(90, tile=32, overlap=6) + 16.0
    cols = fl.spectral.tile_starts(120, tile=24, overlap=6) + 12.0
    at = np.array([(x, y) for y in rows for x in cols])
    want = fl.camera.image_velocity(at, 1.0, (0, 0, 0), lens, (90, 120), rotation=angle)
    assert np.abs(got.reshape(-1, 2) - want).max() < 1e-13


CSV = "frame, x,y,z, rx,ry,rz\n0,0,0,0,0,0,0\n10, 1,0,2, 0,0.5,0\n\n25,1,0,3,0.1,0.5,0\n"


def test_a_csv_is_a_path(tmp_path: Path):
    file = tmp_path / "way.csv"
    file.write_text(CSV)
    path = load(file, (40, 50), camera=LENS)
    assert path.place(10.0, fps=1.0).tolist() == [1.0, 0.0, 2.0]
    assert np.allclose(path.turn(5.0), Rotation.from_rotvec((0, 0.25, 0)).as_matrix(), atol=1e-15)
    rows = "\n".join(",".join(map(str, row)) for row in np.hstack([quaternions(TURNS), PLACES]))
    file.write_text("\ufeffqw,qx,qy,qz,x,y,z\r\n" + rows.replace("\n", "\r\n"))
    path = load(file, (40, 50), camera=LENS)
    assert np.array_equal(path.position, PLACES)
    assert np.abs(path.turn(3.5) - twin_turn(3.5)).max() < 1e-13
    file.write_text("x,y,z\n0,0,0\n0,0,1\n")
    assert load(file, (40, 50), camera=LENS).orientation is None
    file.write_text(CSV)
    (tmp_path / "scene.toml").write_text(
        "format = 3\nsize = [50, 40]\n[camera]\nfocal = 60\npath = 'way.csv'\n"
    )
    shown = fl.open(tmp_path / "scene.toml")
    assert (
        np.abs(shown.camera.turn(10.0) - load(file, (40, 50), camera=LENS).turn(10.0)).max() == 0.0
    )


BAD_CSV = {
    "empty": ("", "header"), "no rows": ("x,y,z\n", "at least one row"),
    "unknown": ("x,y,w\n1,2,3\n", "line 1.*'w'"), "twice": ("x,x,y\n1,2,3\n", "line 1.*'x'"),
    "half": ("x,y\n1,2\n", "'z' is missing"), "both": ("rx,qw\n1,2\n", "not both"),
    "nothing": ("frame\n1\n", "neither"), "text": ("x,y,z\n1,2,3\n1,a,3\n", "line 3.*'a'"),
    "NaN": ("x,y,z\n1,nan,3\n", "line 2.*'nan'"), "short": ("x,y,z\n1,2\n", "line 2: 3 entries"),
    "backwards": ("frame,x,y,z\n1,0,0,0\n0,0,0,0\n", "increase"),
    "latin": ("x,y,z\n\xff,1,2\n", "UTF-8"),
}  # fmt: skip


def test_bad_files_are_told(tmp_path: Path):
    for text, words in BAD_CSV.values():
        (tmp_path / "way.csv").write_bytes(text.encode("latin-1"))
        with pytest.raises(ValueError, match=rf"way\.csv.*{words}"):
            load(tmp_path / "way.csv", (40, 50), camera=LENS)


# A camera that pans, tilts, rolls and moves, 10 px a frame in all.
SPIN = np.array([0.004, 0.012, -0.004])


def turning(spin: np.ndarray = SPIN) -> fl.CameraPath:
    turns = Keys([(0, (0, 0, 0)), (100, tuple(100 * spin))])
    return Path_(Camera(FOCAL), velocity=(0.6, -0.4, 0.0), orientation=turns)


def test_two_eyes_of_a_turning_camera_see_one_air():
    path = turning()
    eye = Camera(FOCAL, offset=(0.06, 0.0, 0.0))
    torus = scene({**TEXTURE, "tile": SIZE, "overlap": 0, "alias": "keep"}, camera=path)
    pair = picture(torus, 40.0), picture(torus, 40.0, eye=eye)
    for parallax in measure.parallax(pair):
        assert parallax == pytest.approx((-FOCAL * 0.06, 0.0), abs=0.02 * FOCAL * 0.06)
