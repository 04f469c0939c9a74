"""Cameras from elsewhere: points are seen where the program that wrote them sees them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

import flurries as fl
from flurries.camera import importers as cameras
from flurries.camera import project
from flurries.cli import main
from flurries.cli.render import render as command
from flurries.cli.weather import scene_of
from flurries.io import read_picture, write_picture

W, H = 160, 90
RNG = np.random.default_rng(4)
FRAMES = 7
PLACES = np.cumsum(RNG.normal(0, 0.3, (FRAMES, 3)), axis=0)
ANGLES = np.cumsum(RNG.normal(0, 5.0, (FRAMES, 3)), axis=0)
FLIP = np.array([1.0, -1.0, -1.0])


def seen(path: fl.CameraPath, t: float, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return project(points - path.place(t, fps=24.0), path.pose(path.camera, t), (H, W))


def cloud(turn: np.ndarray, place: np.ndarray, forward: float) -> np.ndarray:
    local = RNG.uniform((-1, -1, 3), (1, 1, 9), (20, 3)) * (1, 1, forward)
    return local @ turn.T + place


@pytest.mark.parametrize("start", [1, 1001])
def test_chan(start: int, tmp_path: Path):
    fov = np.linspace(30.0, 50.0, FRAMES)
    rows = np.c_[start + np.arange(FRAMES), PLACES, ANGLES, fov]
    np.savetxt(tmp_path / "a.chan", rows, fmt="%.12g", header="a comment")
    path = cameras.read_chan(tmp_path / "a.chan", (H, W), scale=0.5)
    for t in range(FRAMES):
        # Nuke: columns, y up, looking along -z; it turns about z first, then x, then y.
        turn = Rotation.from_euler("zxy", ANGLES[t][[2, 0, 1]], degrees=True).as_matrix()
        points = cloud(turn, PLACES[t], -1.0)
        local = (points - PLACES[t]) @ turn
        focal = 0.5 * H / np.tan(np.radians(fov[t] / 2))
        want = np.c_[W / 2 + focal * local[:, 0] / -local[:, 2],
                     H / 2 - focal * local[:, 1] / -local[:, 2]]  # fmt: skip
        got, depth = seen(path, float(start + t), 0.5 * points * FLIP)
        assert np.abs(got - want).max() < 1e-6 and np.abs(depth + 0.5 * local[:, 2]).max() < 1e-9
    assert path.extent == (start, start + FRAMES - 1)


def test_chan_with_gaps_and_a_lens_of_its_own(tmp_path: Path):
    frames = np.array([10, 12, 13, 20, 21, 22, 30])
    np.savetxt(tmp_path / "a.chan", np.c_[frames, PLACES, ANGLES])
    lens = fl.Camera(200.0, center=(70.0, 40.0))
    path = cameras.read_chan(tmp_path / "a.chan", (H, W), camera=lens)
    for frame, place, angles in zip(frames, PLACES, ANGLES, strict=True):
        turn = Rotation.from_euler("zxy", angles[[2, 0, 1]], degrees=True).as_matrix()
        want = FLIP[:, None] * turn * FLIP
        assert np.abs(path.place(float(frame), fps=24.0) - place * FLIP).max() < 1e-12
        assert np.abs(path.turn(float(frame)) - want).max() < 1e-9
    assert path.camera == lens and not path.zooms


def poses() -> tuple[np.ndarray, np.ndarray]:
    turns = Rotation.from_rotvec(np.radians(ANGLES)).as_matrix()
    return turns, np.concatenate([turns, PLACES[:, :, None]], axis=2)


def test_kitti(tmp_path: Path):
    turns, matrices = poses()
    np.savetxt(tmp_path / "00.txt", matrices.reshape(FRAMES, 12))
    path = cameras.load(tmp_path / "00.txt", (H, W), camera=fl.Camera(100.0))
    for t in range(FRAMES):
        points = cloud(turns[t], PLACES[t], 1.0)
        local = (points - PLACES[t]) @ turns[t]
        want = 100.0 * local[:, :2] / local[:, 2:] + (W / 2, H / 2)
        assert np.abs(seen(path, float(t), points)[0] - want).max() < 1e-6


@pytest.mark.parametrize("inverse", [False, True])
@pytest.mark.parametrize("opengl", [False, True])
def test_matrices(inverse: bool, opengl: bool):
    turns, _ = poses()
    whole = np.tile(np.eye(4), (FRAMES, 1, 1))
    whole[:, :3, :3], whole[:, :3, 3] = turns, PLACES
    given = np.linalg.inv(whole) if inverse else whole
    axes = "x right, y up, z back" if opengl else "x right, y down, z forward"
    path = cameras.from_matrices(given, fl.Camera(100.0), axes=axes, inverse=inverse)
    points = cloud(turns[2], PLACES[2], -1.0 if opengl else 1.0)
    local = (points - PLACES[2]) @ turns[2]
    if opengl:
        local, points = local * FLIP, points * FLIP
    want = 100.0 * local[:, :2] / local[:, 2:] + (W / 2, H / 2)
    assert np.abs(seen(path, 2.0, points)[0] - want).max() < 1e-6


def colmap(folder: Path, names: list[str], model: str = "PINHOLE 320 180 200 210 150 95") -> None:
    turns, _ = poses()
    folder.mkdir(exist_ok=True)
    (folder / "cameras.txt").write_text(f"# Camera list\n1 {model}\n")
    lines = ["# Image list", "#   POINTS2D[] as (X, Y, POINT3D_ID)"]
    for i in reversed(range(FRAMES)):
        x, y, z, w = Rotation.from_matrix(turns[i].T).as_quat()
        t = -turns[i].T @ PLACES[i]
        numbers = " ".join(f"{v:.15g}" for v in (w, x, y, z, *t))
        lines += [f"{i + 1} {numbers} 1 {names[i]}", "" if i % 2 else "1.5 2.5 -1 3 4 7"]
    (folder / "images.txt").write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("names", [[f"f_{4 + 2 * i:03d}.png" for i in range(FRAMES)],
                                   [f"{c}.png" for c in "abcdefg"]])  # fmt: skip
def test_colmap(names: list[str], tmp_path: Path):
    colmap(tmp_path / "sparse", names)
    path = cameras.read_colmap(tmp_path / "sparse", (H, W), down=(0.0, 1.0, 0.0), scale=2.0)
    turns, _ = poses()
    first, step = (4.0, 2.0) if names[0] != "a.png" else (0.0, 1.0)
    for i in range(FRAMES):
        points = cloud(turns[i], PLACES[i], 1.0)
        local = points @ turns[i] - turns[i].T @ PLACES[i]
        # The pictures were 320 x 180.
        want = (np.array([200, 210]) * local[:, :2] / local[:, 2:] + (150, 95)) / 2
        assert np.abs(seen(path, first + step * i, 2.0 * points)[0] - want).max() < 1e-6
    assert path.camera.focals == pytest.approx((100.0, 105.0))


def test_the_ground_of_colmap_is_where_the_cameras_have_it(tmp_path: Path):
    colmap(tmp_path, [f"{c}.png" for c in "abcdefg"])
    path = cameras.load(tmp_path, (H, W))
    mean = np.mean([path.turn(float(t))[:, 1] for t in range(FRAMES)], axis=0)
    assert np.abs(mean / np.linalg.norm(mean) - (0, 1, 0)).max() < 1e-9
    upside = cameras.read_colmap(tmp_path, (H, W), down=(0, -1, 0))
    assert np.abs(upside.turn(0.0) - np.diag([1, -1, -1]) @ poses()[0][0]).max() < 1e-9


def test_a_lens_that_distorts_is_told(tmp_path: Path):
    colmap(tmp_path, [f"{c}.png" for c in "abcdefg"], "SIMPLE_RADIAL 320 180 200 160 90 0.1")
    with pytest.warns(UserWarning, match="distortion"):
        path = cameras.load(tmp_path, (H, W))
    assert path.camera.focal == pytest.approx(100.0) and path.camera.aspect == 1.0


BAD: dict[str, tuple[Callable[[Path], Any], str]] = {
    "chan order": (lambda p: (p / "a.chan").write_text("2 0 0 0 0 0 0\n1 0 0 0 0 0 0"), "increase"),
    "chan fov": (lambda p: (p / "a.chan").write_text("2 0 0 0 0 0 0 180"), "vfov"),
    "kitti mirror": (lambda p: (p / "a.txt").write_text("-1 0 0 0 0 1 0 0 0 0 1 0"), "rotation"),
    "colmap none": (lambda p: (p / "a").mkdir(), "cameras.txt"),
    "a picture": (lambda p: (p / "a.png").write_text("x"), "a camera is"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_files_that_are_no_cameras(name: str, tmp_path: Path):
    make, word = BAD[name]
    make(tmp_path)
    (given,) = tmp_path.iterdir()
    with pytest.raises((OSError, ValueError), match=word) as caught:
        cameras.load(given, (H, W))
    assert given.name in str(caught.value) or "cameras.txt" in str(caught.value)


def test_what_files_do_not_say_is_an_option(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    np.savetxt("cam.chan", np.c_[np.arange(FRAMES), PLACES, ANGLES])
    colmap(tmp_path / "sparse", [f"{c}.png" for c in "abcdefg"])
    lens = fl.Camera(1.2 * W, center=(70.0, 40.0))
    words = ["render", "#304050", "--snow", "heavy", "--size", f"{W}x{H}", "-q", "--frames", "3",
             "--overwrite", "-o", "a.png", "--camera"]  # fmt: skip
    for file, name, value, path in (
        ("cam.chan", "center", "[70.0, 40.0]", cameras.read_chan("cam.chan", (H, W), camera=lens)),
        ("cam.chan", "scale", "0.01", cameras.read_chan("cam.chan", (H, W), scale=0.01)),
        ("sparse", "down", "[0, -1, 1]", cameras.read_colmap("sparse", (H, W), down=(0, -1, 1))),
    ):
        scene = fl.Scene("#304050", size=(W, H), camera=path, effects=fl.Snow("heavy"), fps=30)
        wanted = scene.render(3)
        option = f"--{name}".replace("--scale", "--camera-scale")
        assert main([*words, file, option, value.strip("[]")]) == 0
        assert np.array_equal(read_picture("a.png").pixels, wanted)
        Path("a.toml").write_text(
            f'format = 3\nbackground = "#304050"\nsize = [{W}, {H}]\nfps = 30\n[[effects]]\n'
            f'kind = "snow"\npreset = "heavy"\n[camera]\npath = "{file}"\n{name} = {value}\n'
        )
        assert np.array_equal(fl.open("a.toml").render(3), wanted)
    for more in (["sparse", "--center", "1,2"], ["cam.chan", "--down", "0,1,0"]):
        assert main([*words, *more]) == 2


@pytest.mark.parametrize(("size", "scale"), [((48, 32), 0.5), ((48, 48), 0.75)])
def test_a_proxy_has_the_view_of_its_plate(size: tuple[int, int], scale: float, tmp_path: Path):
    write_picture(tmp_path / "plate.png", np.zeros((64, 96, 3), np.uint8))
    (tmp_path / "zoom.csv").write_text("frame,x,y,z,focal\n0,0,0,0,60\n4,1,0,0,90\n")
    words = [str(tmp_path / "plate.png"), "--snow", "--center", "40,30", "-o", "a.png",
             "--camera", str(tmp_path / "zoom.csv"), "--size"]  # fmt: skip
    large, small = (
        scene_of(**command.make_context("", [*words, f"{w}x{h}"]).params)
        for w, h in ((96, 64), size)
    )
    places = np.array([(0.5, -0.2, 3.0), (-0.3, 0.4, 2.0)])
    seen = [
        fl.camera.project(places, scene.camera.pose(scene.camera.camera, 2), scene._shape)[0]
        for scene in (large, small)
    ]
    assert np.allclose(seen[1] - np.array(size) / 2, scale * (seen[0] - (48, 32)), atol=1e-12)


ZOOM = fl.Keys([(0.0, 300.0), (40.0, 450.0), (60.0, 450.0)])


@pytest.mark.parametrize("turns", [False, True])
def test_the_way_across_is_weighed_by_the_focal_length_of_its_time(turns: bool):
    vectors = [(0.0, (0.0, 0.0, 0.0)), (30.0, (0.1, 0.3, 0.05)), (70.0, (0.0, -0.4, 0.2))]
    path = fl.CameraPath(
        fl.Camera(99.0, rotation=(0.2, 0.1, 0.0)),
        velocity=fl.Keys([(0, (0, 0, 3)), (50, (1, 0, 2))]),
        orientation=fl.Keys(vectors) if turns else None, focal=ZOOM,
    )  # fmt: skip
    wind, fall, fps = (0.7, 0.0, 0.2), 1.1, 25.0

    def rate(t: float) -> np.ndarray:
        air = np.array([wind[0], wind[1] + fall, wind[2]])
        return path.turn(t).T @ (path.rate(t, fps=fps) - air / fps)

    for t in (17.0, 55.0, 80.0, -9.0):
        got = path.turn(t).T @ path.travel(t, fps=fps, fall=fall, wind=wind)
        for axis in range(3):

            def weight(u: float, axis: int = axis, t: float = t) -> float:
                return 1.0 if axis == 2 else ZOOM.at(u) / ZOOM.at(t)

            want, _ = quad(
                lambda u, a=axis, w=weight: rate(u)[a] * w(u), 0.0, t,
                points=[p for p in (30.0, 40.0, 50.0, 60.0, 70.0) if p < t] or None, limit=200,
            )  # fmt: skip
            # Two slopes at once are taken as straight within a frame.
            assert got[axis] == pytest.approx(want, abs=2e-4), (t, axis)


def test_a_zoom_that_never_changes_is_none():
    effect = fl.effects.TentSnow(flakes=200)
    plain = fl.Scene(size=(W, H), camera=fl.Camera(180.0), effects=effect)
    same = plain.replace(camera=fl.CameraPath(fl.Camera(9.0), focal=[180.0, 180.0, 180.0]))
    assert np.array_equal(plain.render(12), same.render(12))
    assert same.camera.resize(2.0).camera.focal == 360.0
