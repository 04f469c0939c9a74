"""The programs that take our files: oiiotool, ffprobe, OpenEXR's own module, and Blender."""

import json
import shutil
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

import flurries as fl
import flurries.camera.importers
from flurries import io
from flurries.io.films.reader import Tags
from flurries.io.layers.planes import CHANNELS, read_deep
from flurries.io.timecode import TimeCode
from stills import write_exr

H, W = 48, 64
LIGHT = np.random.default_rng(1).random((H, W, 3)).astype(np.float32)
# Gas wants square pixels, which the plate of the fixture has not.
WIDE = [fl.effects.TentSnow("heavy"), fl.Snow("heavy")]


def needs(program: str) -> Any:
    missing = shutil.which(program) is None
    return pytest.mark.skipif(missing, reason=f"{program} is missing: make test-clients")


def run(*words: object) -> str:
    done = subprocess.run([*map(str, words)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def plate(path: Path) -> None:
    said = {
        "chromaticities": ("float[8]", (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.3217, 0.3377)),
        "smpte:TimeCode": ("timecode", (0x01020304, 0)), "framesPerSecond": ("rational", (24, 1)),
        "Copyright": "the owner", "PixelAspectRatio": 2.0,
    }  # fmt: skip
    write_exr(path, LIGHT, "RGB", data=(-4, -2), display=(0, 0, W - 8, H - 4), header=said)


@pytest.fixture
def shot(tmp_path: Path) -> Path:
    plate(tmp_path / "plate.exr")
    scene = fl.Scene(tmp_path / "plate.exr", effects=WIDE)
    scene.write(tmp_path / "layers.exr", "5", layers=True, bits="float")
    scene.write(tmp_path / "out.exr", "5", bits="float")
    scene.replace(effects=()).write(tmp_path / "same.exr", "5", bits="float")
    return tmp_path


@needs("exrheader")
def test_openexr_knows_the_attributes_by_its_own_names(shot: Path):
    said = run("exrheader", shot / "out.exr")
    for line in ("dataWindow (type box2i): (-4 -2) - (59 45)",
                 "displayWindow (type box2i): (0 0) - (55 43)", 'owner (type string): "the owner"',
                 "time 01:02:03:04", "framesPerSecond (type rational): 24/1",
                 "pixelAspectRatio (type float): 2", "chromaticities"):  # fmt: skip
        assert line in said, line


def test_the_module_of_openexr_counts_deep_samples(tmp_path: Path):
    openexr = pytest.importorskip("OpenEXR", reason="OpenEXR is missing: make test-clients")
    scene = fl.Scene("#334455", size=(72, 54), effects=[fl.Snow("heavy"), fl.Mist("fog")])
    scene.write(tmp_path / "deep.exr", 3, deep=True)
    ours = read_deep(tmp_path / "deep.exr")
    with openexr.File(str(tmp_path / "deep.exr"), separate_channels=True) as file:
        channels = file.channels()
        assert {"A", "B", "G", "R", "Z", "ZBack"} <= set(channels)
        for number, name in enumerate(CHANNELS):
            pixels = channels[name].pixels
            counts = [0 if one is None else len(one) for one in pixels.ravel()]
            assert counts == ours.counts.ravel().tolist(), name
            values = np.concatenate([one for one in pixels.ravel() if one is not None])
            np.testing.assert_array_equal(values.astype(np.float32), ours.values[:, number])


CODE = TimeCode.of_text("10:20:30:05", Fraction(24))
CODECS = {
    "h264": ("a.mp4", 8, "h264", "yuv420p"), "h264 10": ("a.mp4", 10, "h264", "yuv420p10le"),
    "h265": ("a.mp4", 10, "hevc", "yuv420p10le"),
    "prores-hq": ("a.mov", 10, "prores", "yuv422p10le"),
    "prores-4444": ("a.mov", 10, "prores", "yuv444p12le"),
    "dnxhr": ("a.mov", 10, "dnxhd", "yuv422p10le"),
}  # fmt: skip


@needs("ffprobe")
@needs("ffmpeg")
@pytest.mark.parametrize("name", CODECS)
def test_ffprobe_says_what_we_wrote(name: str, tmp_path: Path):
    file, bits, codec, pixels = CODECS[name]
    tags = Tags(primaries=9, transfer=1, matrix=9, aspect=Fraction(2), timecode=CODE)
    tall, wide = 128, 256
    with io.VideoWriter(tmp_path / "mute.mov", (wide, tall), 24, bits=10, tags=tags) as film:
        for level in range(24):
            film.write(np.full((tall, wide, 3), 2000 * level, np.uint16))
    run("ffmpeg", "-v", "error", "-i", tmp_path / "mute.mov", "-f", "lavfi", "-i",
        "sine=frequency=440:duration=1", "-map", "0:v", "-map", "1:a", "-c:v", "copy", "-c:a",
        "aac", "-shortest", tmp_path / "plate.mov")  # fmt: skip
    scene = fl.Scene(tmp_path / "plate.mov", effects=[fl.effects.TentSnow("heavy")])
    done = scene.write(tmp_path / file, codec=name.split()[0], bits=bits)
    assert done.sound == "kept" and io.open_background(tmp_path / file).sound
    said = json.loads(run("ffprobe", "-v", "error", "-show_streams", "-show_format", "-of", "json",
                          tmp_path / file))  # fmt: skip
    picture = next(one for one in said["streams"] if one["codec_type"] == "video")
    sound = next(one for one in said["streams"] if one["codec_type"] == "audio")
    assert (picture["codec_name"], picture["pix_fmt"]) == (codec, pixels)
    assert picture["avg_frame_rate"] == "24/1" and int(picture["nb_frames"]) == 24
    assert picture["color_primaries"] == "bt2020" and picture["color_transfer"] == "bt709"
    assert picture["color_space"] == ("bt709" if codec == "dnxhd" else "bt2020nc")
    assert picture["color_range"] == "tv" and picture["sample_aspect_ratio"] == "2:1"
    assert abs(float(picture["duration"]) - 1.0) < 1e-3
    assert abs(float(sound["duration"]) - 1.0) < 0.06
    codes = [one.get("tags", {}).get("timecode") for one in said["streams"]]
    assert "10:20:30:05" in codes


@pytest.fixture(scope="module")
def bpy() -> Any:
    return pytest.importorskip("bpy", reason="Blender (bpy) is missing: make test-clients")


IN_BLENDER = """
import sys, json, bpy
from math import radians
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
out, flakes, told = sys.argv[1:]
scene = bpy.context.scene
for thing in list(bpy.data.objects):
    bpy.data.objects.remove(thing)
scene.render.resolution_x, scene.render.resolution_y = 64, 48
scene.render.resolution_percentage = 100
scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = 1.5, 1.0
scene.frame_start, scene.frame_end = 1001, 1005

def seen(camera, points):
    at = [world_to_camera_view(scene, camera, Vector(point)) for point in points]
    return [(v[0] * 64, (1.0 - v[1]) * 48) for v in at]

if out:
    lens = bpy.data.cameras.new("lens")
    camera = bpy.data.objects.new("camera", lens)
    scene.collection.objects.link(camera)
    scene.camera = camera
    lens.shift_x, lens.shift_y = 0.1, -0.05
    points = json.loads(told)
    for frame in range(1001, 1006):
        step = frame - 1001
        camera.location = (0.3 * step, -0.2 * step, 1.0 + 0.1 * step)
        camera.rotation_euler = [radians(v) for v in (85 + step, 10 + 4 * step, -3 * step)]
        lens.lens = 30 + 2 * step
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_euler", frame=frame)
        lens.keyframe_insert("lens", frame=frame)
    bpy.ops.wm.usd_export(filepath=out, export_animation=True)
    places = {}
    for frame in range(1001, 1006):
        scene.frame_set(frame)
        places[frame] = seen(camera, points)
else:
    scene.render.pixel_aspect_x = 1.0
    bpy.ops.wm.usd_import(filepath=flakes, scale=1.0)
    camera = next(one for one in bpy.data.objects if one.type == "CAMERA")
    cloud = next(one for one in bpy.data.objects if one.type in ("POINTCLOUD", "MESH"))
    places = {}
    for frame in range(1001, 1004):
        scene.frame_set(frame)
        graph = bpy.context.evaluated_depsgraph_get()
        live = cloud.evaluated_get(graph)
        places[frame] = seen(camera.evaluated_get(graph), [
            live.matrix_world @ Vector(one.vector)
            for one in live.data.attributes["position"].data])
print("SEEN " + json.dumps(places))
"""


def blender(out: object = "", flakes: object = "", told: object = "") -> dict[int, np.ndarray]:
    """Return what Blender sees; in its own process, since it brings a USD library of its own."""
    lines = run(sys.executable, "-c", IN_BLENDER, out, flakes, json.dumps(told)).splitlines()
    seen = next(line for line in lines if line.startswith("SEEN "))
    return {int(frame): np.array(at) for frame, at in json.loads(seen[5:]).items()}


def test_blenders_camera_through_usd_sees_points_where_ours_does(bpy: Any, tmp_path: Path):
    """Roll, shift, zoom and pixel aspect at five frames, ten points."""
    points = np.random.default_rng(2).uniform((-2, 6, -1), (2, 14, 3), (10, 3))
    seen = blender(tmp_path / "shot.usdc", told=points.tolist())
    path = fl.camera.importers.load(
        tmp_path / "shot.usdc", (H, W), camera=fl.Camera(60.0, aspect=1.5)
    )
    # Blender has z up.
    ours = points @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    assert sorted(seen) == [1001, 1002, 1003, 1004, 1005]
    for frame, wanted in seen.items():
        pose = path.pose(path.camera, float(frame))
        at, _ = fl.camera.project(ours - path.place(float(frame), fps=24.0), pose, (H, W))
        np.testing.assert_allclose(at, wanted, atol=1e-3)


def test_our_points_land_in_blender_on_the_pixels_where_we_draw_them(bpy: Any, tmp_path: Path):
    way = fl.CameraPath(
        fl.Camera(70.0, center=(30.0, 26.0), rotation=(0.1, -0.1, 0.2)), velocity=(0.5, 0.1, 2.0)
    )
    snow = fl.Snow("heavy", method="simulated", far=8.0)
    scene = fl.Scene((0.0, 0.0, 0.0), size=(W, H), camera=way, effects=[snow], fps=24.0)
    scene.write(tmp_path / "flakes.usdc", "1001-1003")
    for frame, at in blender(flakes=tmp_path / "flakes.usdc").items():
        wanted = fl.flakes(scene, frame)["pixel"]
        assert len(at) == len(wanted) > 1000
        np.testing.assert_allclose(np.sort(at, axis=0), np.sort(wanted, axis=0), atol=2e-3)


IN_A_SHOT = """
import sys, runpy, bpy
scene, (script, shot, *words) = bpy.context.scene, sys.argv[1:]
scene.render.engine, scene.cycles.samples = "CYCLES", 1
scene.render.resolution_x, scene.render.resolution_y = 64, 48
scene.render.resolution_percentage = 100
scene.frame_start, scene.frame_end = 1001, 1002
bpy.ops.wm.save_as_mainfile(filepath=shot + "/shot.blend")
sys.argv = [script, "--", *words]
runpy.run_path(script, run_name="__main__")
scene.frame_set(1002)
scene.render.image_settings.media_type = "IMAGE"
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
scene.render.filepath = shot + "/again.exr"
bpy.ops.render.render(write_still=True)
"""


def test_the_example_for_blender_composes_what_flurries_does(bpy: Any, tmp_path: Path):
    """Out of a .blend, through our command line, and back over the render: with two veils."""
    script = Path(__file__).parents[2] / "examples" / "blender.py"
    words = ["--snow", "heavy", "--mist", "fog", "--color", "local", "--bits", "float", "--plate"]
    run(sys.executable, "-c", IN_A_SHOT, script, tmp_path, *words)
    again = oiio.ImageBuf(str(tmp_path / "again.exr")).get_pixels(oiio.FLOAT)[..., :3]
    ours = io.read_layers(tmp_path / "weather" / "weather.1002.exr")
    np.testing.assert_allclose(again, ours["rgba"][..., :3], atol=1e-6)
    assert np.abs(again - ours["background"][..., :3]).max() > 0.05
