"""USD: cameras in, flakes out as points, judged by usd-core's own frustum."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

import flurries as fl
from flurries.camera import importers
from twin_footprints import Canvas

H, W = 60, 80
FRAMES = range(1001, 1006)
OPEN: list[Any] = []
PLACES = np.random.default_rng(3).uniform((-2.0, -2.0, 5.0), (2.0, 2.0, 12.0), (10, 3))


def stage_of(path: Path, *, up: str = "Y", unit: float = 1.0, film: float = 0.75) -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(path))
    OPEN.append(stage)  # A prim does not keep its stage.
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    rig = UsdGeom.Xform.Define(stage, "/rig")
    move = rig.AddTranslateOp()
    camera = UsdGeom.Camera.Define(stage, "/rig/camera")
    turn = camera.AddRotateXYZOp()
    camera.GetHorizontalApertureAttr().Set(36.0)
    camera.GetVerticalApertureAttr().Set(36.0 * film)
    camera.GetHorizontalApertureOffsetAttr().Set(2.5)
    camera.GetVerticalApertureOffsetAttr().Set(-1.5)
    level = 90.0 if up == "Z" else 0.0
    for frame in FRAMES:
        step = frame - FRAMES[0]
        move.Set(Gf.Vec3d(0.3 * step, 0.2 * step, -0.1 * step) / unit, frame)
        turn.Set(Gf.Vec3f(level + 2.0 * step, -3.0 * step, 4.0 * step), frame)
        camera.GetFocalLengthAttr().Set(40.0 + 3.0 * step, frame)
    stage.Save()
    return stage


def seen_by_usd(camera: Any, time: float, points: np.ndarray) -> np.ndarray:
    frustum = camera.GetCamera(time).frustum
    both = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
    at = np.array([both.Transform(Gf.Vec3d(*map(float, point))) for point in points])
    return np.stack([(at[:, 0] + 1.0) * W / 2, (1.0 - at[:, 1]) * H / 2], axis=1)


def seen_by_us(path: fl.CameraPath, time: float, points: np.ndarray) -> np.ndarray:
    pose = path.pose(path.camera, time)
    at, _ = fl.camera.project(points - path.place(time, fps=24.0), pose, (H, W))
    return at


@pytest.mark.parametrize("film", [0.75, 1.5])
@pytest.mark.parametrize("unit", [1.0, 0.01])
@pytest.mark.parametrize("up", ["Y", "Z"])
def test_a_camera_sees_points_where_usd_does(up: str, unit: float, film: float, tmp_path: Path):
    camera = UsdGeom.Camera(stage_of(tmp_path / "a.usda", up=up, unit=unit, film=film)
                            .GetPrimAtPath("/rig/camera"))  # fmt: skip
    path = importers.read_usd(tmp_path / "a.usda", (H, W))
    x, y, z = PLACES.T
    # The house has y down and z ahead.
    theirs = np.stack([x, -y, -z] if up == "Y" else [x, z, -y], axis=1) / unit
    assert path.camera.aspect == pytest.approx(0.75 / film)
    for time in FRAMES:
        np.testing.assert_allclose(
            seen_by_us(path, time, PLACES), seen_by_usd(camera, time, theirs), atol=1e-3
        )


def test_a_camera_that_stands_still_goes_on_for_ever(tmp_path: Path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "still.usda"))
    camera = UsdGeom.Camera.Define(stage, "/camera")
    camera.AddTranslateOp().Set(Gf.Vec3d(1.0, 2.0, 3.0))
    camera.GetHorizontalApertureAttr().Set(24.0)
    camera.GetVerticalApertureAttr().Set(18.0)
    stage.Save()
    # usd-core's own: centimetres where nobody says it.
    path = importers.read_usd(tmp_path / "still.usda", (H, W))
    np.testing.assert_allclose(path.place(77.0, fps=24.0), [0.01, -0.02, -0.03])
    assert path.extend == "on"
    meters = importers.read_usd(tmp_path / "still.usda", (H, W), scale=100.0)
    np.testing.assert_allclose(meters.place(0.0, fps=24.0), [1.0, -2.0, -3.0])


def test_stages_that_say_no_camera_are_refused(tmp_path: Path):
    for name, text, said in [
        ("no.usda", "nonsense", "no USD stage"),
        ("none.usda", "#usda 1.0\n", "one camera is wanted, as none.usda:/its/path; it has none"),
        ("two.usda", '#usda 1.0\ndef Camera "a" {}\ndef Camera "b" {}\n', "it has /a, /b"),
        ("flat.usda", '#usda 1.0\ndef Camera "a" {\ntoken projection = "orthographic"\n}\n',
         "orthographic"),
        ("moves.usda", '#usda 1.0\ndef Camera "a" {\nfloat horizontalAperture = 24\n'
         "float verticalAperture = 18\nfloat horizontalApertureOffset.timeSamples = "
         "{1: 0, 2: 1}\n}\n", "principal point must not change"),
    ]:  # fmt: skip
        (tmp_path / name).write_text(text)
        with pytest.raises(ValueError, match=re.escape(said)):
            importers.load(tmp_path / name, (H, W))
    with pytest.raises(ValueError, match=r"prim '/c' is no camera of the stage; it has /a, /b"):
        importers.load(f"{tmp_path}/two.usda:/c", (H, W))
    with pytest.warns(UserWarning, match="aperture"):
        importers.load(f"{tmp_path}/two.usda:/b", (H, W))
    with pytest.raises(FileNotFoundError):
        importers.load(tmp_path / "missing.usd", (H, W))


def mutants(data: bytes, count: int, seed: int) -> Iterator[bytes]:
    """Yield a file with a byte changed, cut off, without a piece, or with a piece twice."""
    random = np.random.default_rng(seed)
    for number in range(count):
        a, b = sorted(random.integers(0, len(data), 2).tolist())
        changed = data[:a] + random.bytes(1) + data[a + 1 :]
        twice = data[:b] + data[a : a + 30] + data[b:]
        yield (changed, data[:a], data[:a] + data[a + 20 :], twice)[number % 4]


CAMERAS = {
    "a.chan": b"".join(b"%d 1 2.5 -3 4 5 6 40\n" % frame for frame in range(9)),
    "a.csv": b"frame,x,y,z,focal\n" + b"".join(b"%d,1,2.5,-3,80\n" % frame for frame in range(9)),
    "a.txt": b"1 0 0 0 0 1 0 0 0 0 1 0.5\n" * 9,
    "images.txt": b"1 1 0 0 0 1 2 3 1 f_001.png\n1.5 2.5 -1\n2 1 0 0 0 1 2 4 1 f_002.png\n\n",
    "cameras.txt": b"# Cameras\n1 PINHOLE 320 180 200 210 150 95\n",
}


@pytest.mark.filterwarnings("ignore:.*distortion")
@pytest.mark.parametrize("name", ["a.usda", "a.usdc", *CAMERAS])
def test_a_damaged_camera_is_one_sentence_with_the_files_name(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    whole, told = CAMERAS, 0
    if "usd" in name:
        stage_of(tmp_path / name)
        whole = {name: (tmp_path / name).read_bytes()}
    for number, data in enumerate(mutants(whole[name], 24, 7)):
        folder = tmp_path / f"{number}"
        folder.mkdir()
        for other, theirs in whole.items():
            (folder / other).write_bytes(data if other == name else theirs)
        try:
            importers.load(folder if "s.txt" in name else folder / name, (H, W))
        except (ValueError, OSError) as error:
            assert str(folder) in str(error) and "\n" not in str(error)
            told += 1
    assert told > 8
    # The library of stages tells the terminal by itself.
    assert capfd.readouterr() == ("", "")


def test_apertures_of_another_shape_fit_the_width(tmp_path: Path):
    stage_of(tmp_path / "a.usda", film=0.6)
    with pytest.warns(UserWarning, match="another shape than the picture of 80 x 60 px"):
        path = importers.load(tmp_path / "a.usda", (H, W))
    assert path.camera.focal == pytest.approx(40.0 / 36.0 * W) and path.camera.aspect == 1.0


WAY = fl.CameraPath(
    fl.Camera(90.0, center=(43.0, 27.0), aspect=1.25, rotation=(0.05, -0.1, 0.3)),
    velocity=(0.5, -0.2, 2.0),
)
FLAKES = fl.Snow(
    density=0.8, flake_size=(0.1, 0.12, 0.2), near=1.0, far=6.0, method="simulated",
    shape="round", haze=0.0, color=1.0, wind=(1.0, 0.0, 0.5), sway=(0.0, 0.0),
    shutter=0.0,
)  # fmt: skip


def scene_of(effect: Any = FLAKES, **changes: Any) -> fl.Scene:
    given: dict[str, Any] = {"camera": WAY, "effects": [effect], "fps": 24.0, "seed": 4}
    return fl.Scene((0.0, 0.0, 0.0), size=(W, H), **{**given, **changes})


def values(path: Path, frame: int) -> dict[str, np.ndarray]:
    stage = Usd.Stage.Open(str(path))
    prim = UsdGeom.Points(stage.GetPrimAtPath("/flurries/snow"))
    names = {"points": prim.GetPointsAttr(), "speed": prim.GetVelocitiesAttr(),
             "widths": prim.GetWidthsAttr(), "ids": prim.GetIdsAttr(),
             "opacity": prim.GetDisplayOpacityAttr()}  # fmt: skip
    return {name: np.array(attribute.Get(frame)) for name, attribute in names.items()}


def balls(at: np.ndarray, diameter: np.ndarray, opacity: np.ndarray) -> np.ndarray:
    canvas = Canvas((H, W), 0.9)
    canvas.add(np.broadcast_to(at.T, (3, 2, len(at))), diameter, opacity / 0.9)
    return canvas.alpha()


@pytest.mark.parametrize("turning", [False, True])
def test_points_land_on_the_pixels_where_they_are_drawn(turning: bool, tmp_path: Path):
    """Judged by usd-core's frustum and a sum of balls."""
    angles = fl.Keys([(0, (0.0, 0.0, 0.0)), (20, (0.1, 0.2, -0.3))])
    way = fl.CameraPath(WAY.camera, velocity=WAY.velocity, orientation=angles) if turning else WAY
    scene = scene_of(camera=way)
    scene.write(tmp_path / "flakes.usdc", "10-11")
    stage = Usd.Stage.Open(str(tmp_path / "flakes.usdc"))
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/flurries/camera"))
    for frame in (10, 11):
        found = values(tmp_path / "flakes.usdc", frame)
        at = seen_by_usd(camera, frame, found["points"])
        view = camera.GetCamera(frame)
        ahead = np.array(view.frustum.ComputeViewDirection())
        depth = (found["points"] - np.array(view.frustum.GetPosition())) @ ahead
        focal = W * view.focalLength / view.horizontalAperture
        diameter = focal * found["widths"] / depth
        drawn = scene.layers(frame).alpha
        wanted = balls(at, diameter, found["opacity"])
        assert drawn.max() > 0.5 and (drawn > 0.05).mean() > 0.04
        # Tables of balls have steps; a tenth of a pixel aside is seen.
        assert np.abs(drawn - wanted).max() < 0.08
        assert np.abs(drawn - wanted).mean() < 1e-3
        aside = balls(at + 0.1, diameter, found["opacity"])
        assert np.abs(drawn - aside).mean() > 2.5e-3


def test_velocities_lead_to_the_next_frame(tmp_path: Path):
    scene_of().write(tmp_path / "flakes.usdc", "10-11")
    now, then = (values(tmp_path / "flakes.usdc", frame) for frame in (10, 11))
    _, first, second = np.intersect1d(now["ids"], then["ids"], return_indices=True)
    assert len(first) > 20
    way = then["points"][second] - now["points"][first]
    near = np.abs(way).max(axis=1) < 1.0
    assert near.mean() > 0.95
    np.testing.assert_allclose(
        way[near], now["speed"][first][near] / 24.0, atol=2e-5, err_msg="metres a second"
    )
    # y up and z back: it falls, and the wind blows to the right and away.
    fall = now["speed"].mean(axis=0)
    assert fall[1] < -0.5 and fall[0] == pytest.approx(1.0) and fall[2] == pytest.approx(-0.5)
    assert now["widths"].min() > 0.0999 and now["widths"].max() < 0.2001
    assert len(np.unique(now["ids"])) == len(now["ids"])


def test_a_stage_says_its_axes_rate_and_numbers(tmp_path: Path):
    scene_of().write(tmp_path / "flakes.usda", "10-12")
    stage = Usd.Stage.Open(str(tmp_path / "flakes.usda"))
    assert UsdGeom.GetStageUpAxis(stage) == "Y" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (10, 12)
    assert stage.GetTimeCodesPerSecond() == 24.0
    # Its camera comes back to us, too.
    path = importers.read_usd(tmp_path / "flakes.usda", (H, W), camera=WAY.camera)
    for frame in (10, 12):
        np.testing.assert_allclose(
            path.place(frame, fps=24.0), WAY.place(frame, fps=24.0), atol=1e-6
        )
        pose, ours = path.pose(path.camera, frame), WAY.pose(WAY.camera, frame)
        np.testing.assert_allclose(pose.rotation, ours.rotation, atol=1e-6)
        np.testing.assert_allclose(pose.principal((H, W)), ours.principal((H, W)), atol=1e-4)
        assert pose.focals == pytest.approx(ours.focals, rel=1e-6)


def test_a_stage_that_is_there_is_not_replaced(tmp_path: Path):
    file = tmp_path / "flakes.usdc"
    assert scene_of().write(file, "10-11").written == [10, 11]
    assert scene_of().write(file, "10-11").kept == [10, 11]
    with pytest.raises(ValueError, match=r"is there already and is of another scene, .*overwrite"):
        scene_of(seed=5).write(file, "10-11")
    before = file.read_bytes()
    assert scene_of(seed=5).write(file, "10-11", overwrite=True).written == [10, 11]
    assert file.read_bytes() != before
    with pytest.raises(ValueError, match="points are flakes of Snow and Rain"):
        scene_of(fl.Mist("fog"), camera=None).write(tmp_path / "no.usdc", "1-2")
    with pytest.raises(ValueError, match="it takes no layers"):
        scene_of().write(tmp_path / "no.usdc", "1-2", layers=True)
    assert not (tmp_path / "no.usdc").exists()
