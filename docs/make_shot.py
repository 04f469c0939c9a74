"""The six tasks of docs/shot.md, run line by line, and their picture: docs/images/shot.jpg.

python docs/make_shot.py
"""

from __future__ import annotations

import os
import re
import shlex
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from flurries import io
from flurries.cli.main import main as command
from flurries.io.colorspace import ColorSpace

PAGE = Path(__file__).parent / "shot.md"
FILE = Path(__file__).parent / "images" / "shot.jpg"
FRAMES = range(1001, 1009)
SIZE = (480, 320)

TASKS = re.compile(r"^## Six tasks\n(.*?)(?=^## )", re.MULTILINE | re.DOTALL)
TASK = re.compile(r"^### (.*?)\n.*?^```(sh|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def tasks() -> dict[str, tuple[str, str]]:
    """Return the tasks of the page: a language and lines for each title."""
    section = TASKS.search(PAGE.read_text(encoding="utf-8"))
    assert section is not None
    return {title: (kind, lines) for title, kind, lines in TASK.findall(section[1])}


def run(kind: str, lines: str) -> None:
    """Run a task in the folder that this process is in."""
    if kind == "python":
        exec(compile(lines, str(PAGE), "exec"), {"__name__": "task"})
        return
    for line in lines.replace("\\\n", " ").splitlines():
        words = shlex.split(line)
        if words[0] != "flurries" or command([*words[1:], "-q"]) != 0:
            raise RuntimeError(f"{PAGE}: {line}")


def material(size: tuple[int, int] = SIZE) -> None:
    """Write the shot: a plate, its depth, a walker's matte, a plate in ACEScg, a tracked camera."""
    width, height = size
    photograph = io.photograph("rocket", size=size)
    light = io.color.to_linear(photograph, "display").astype(np.float32)
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    horizon = 0.78 * height
    below = np.maximum(rows - horizon, 1e-3)
    ground = np.where(rows > horizon, 1.6 * 1.2 * width / below, np.inf)
    # As far as the rocket.
    depth = np.minimum(ground, 45.0).astype(np.float32)
    aces = ColorSpace.of("colorspace", "ACEScg")
    linear = ColorSpace.of("colorspace", "Linear Rec.709 (sRGB)")
    for frame in FRAMES:
        step = frame - FRAMES[0]
        walker = figure(rows, columns, 0.2 * width + 0.06 * width * step, height)
        plate = light * (1.0 - walker[..., None]) + 0.02 * walker[..., None]
        near = np.where(walker > 0.5, 4.5, depth).astype(np.float32)
        io.write_picture(f"plate.{frame}.exr", plate)
        io.write_picture(f"depth.{frame}.exr", near, half=False)
        io.write_picture(f"roto.{frame}.exr", walker, half=False)
        overscan(f"aces.{frame}.exr", linear.convert(plate, aces))
    tracked(Path("shot.usda"), size)


def figure(rows: Any, columns: Any, x: float, height: int) -> np.ndarray:
    """Return the matte of somebody who stands at x, soft at its edges."""
    tall = 0.55 * height
    head = np.hypot(columns - x, rows - (height - 0.94 * tall)) - 0.085 * tall
    across, down = np.abs(columns - x) - 0.11 * tall, np.abs(rows - (height - 0.4 * tall))
    body = np.maximum(across, down - 0.46 * tall)
    return np.clip(0.5 - np.minimum(head, body), 0.0, 1.0).astype(np.float32)


def overscan(name: str, pixels: np.ndarray) -> None:
    """Write a plate whose data window is a tenth wider and higher than its display window."""
    import OpenImageIO as oiio

    height, width = pixels.shape[:2]
    x, y = width // 20, height // 20
    spec = oiio.ImageSpec(width, height, 3, "half")
    spec.x, spec.y, spec.full_x, spec.full_y = -x, -y, 0, 0
    spec.full_width, spec.full_height = width - 2 * x, height - 2 * y
    out = oiio.ImageOutput.create(name)
    light = np.ascontiguousarray(pixels, np.float32)
    assert out.open(name, spec) and out.write_scanlines(-y, height - y, 0, light) and out.close()


def tracked(path: Path, size: tuple[int, int]) -> None:
    """Write what Blender's File > Export > USD writes of a camera that walks and rolls: z up."""
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    camera = UsdGeom.Camera.Define(stage, "/shot/Camera")
    place, turn = camera.AddTranslateOp(), camera.AddRotateXYZOp()
    camera.GetHorizontalApertureAttr().Set(0.36)
    camera.GetVerticalApertureAttr().Set(0.36 * size[1] / size[0])
    camera.GetFocalLengthAttr().Set(0.35)
    for frame in FRAMES:
        step = frame - FRAMES[0]
        place.Set(Gf.Vec3d(0.05 * step, 0.12 * step, 1.6), frame)
        turn.Set(Gf.Vec3f(90.0, 1.5 * step, 0.0), frame)
    stage.Save()


def picture() -> np.ndarray:
    """Return what the tasks have made, a panel for each."""
    frame = FRAMES[4]
    aces = ColorSpace.of("colorspace", "ACEScg")
    display = ColorSpace.of("colorspace", "sRGB - Display")
    wide = io.read_picture(f"aces_snow.{frame}.exr", overscan=True).pixels
    wide = np.clip(aces.convert(wide, display), 0.0, 1.0)
    height, width = wide.shape[:2]
    x, y = width // 20, height // 20
    wide[[y, -y - 1], x:-x] = wide[y:-y, [x, -x - 1]] = (1.0, 0.6, 0.1)
    eyes = [encoded(eye) for eye in io.read_views(f"pair.{frame}.exr")]
    half = eyes[0].shape[1] // 4
    pair = np.hstack([eye[:, half : half + eye.shape[1] // 2] for eye in eyes])
    panels = [
        shown(f"snow.{frame}.exr"), wide, shown(f"tracked.{frame}.exr"),
        points(Path("flakes.usdc"), frame, (height, width)), over_grey(Path("snow.mov"), 4), pair,
    ]  # fmt: skip
    whole = [np.asarray(io.color.to_integer(panel, 8)) for panel in panels]
    return np.vstack([np.hstack(whole[:3]), np.hstack(whole[3:])])


def shown(name: str) -> np.ndarray:
    """Return the display values of an EXR of ours."""
    return encoded(io.read_picture(name).pixels)


def encoded(light: np.ndarray) -> np.ndarray:
    """Return display values of linear light."""
    return np.asarray(io.color.to_display(np.ascontiguousarray(light[..., :3]), "linear"))


def points(path: Path, frame: int, shape: tuple[int, int]) -> np.ndarray:
    """Return the points of a stage as its own camera sees them, near ones brighter."""
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    view = UsdGeom.Camera(stage.GetPrimAtPath("/flurries/camera")).GetCamera(frame).frustum
    both = view.ComputeViewMatrix() * view.ComputeProjectionMatrix()
    prim = UsdGeom.Points(stage.GetPrimAtPath("/flurries/snow"))
    canvas = np.full((*shape, 3), 0.08, np.float32)
    for point in prim.GetPointsAttr().Get(frame):
        x, y, _ = both.Transform(Gf.Vec3d(point))
        row, column = int((1 - y) * shape[0] / 2), int((x + 1) * shape[1] / 2)
        if 0 <= row < shape[0] and 0 <= column < shape[1]:
            away = (Gf.Vec3d(point) - view.GetPosition()).GetLength()
            canvas[row, column] = max(min(3.0 / away, 1.0), canvas[row, column, 0])
    return canvas


def over_grey(path: Path, number: int) -> np.ndarray:
    """Return a frame of a film with alpha over a chequered grey."""
    import av

    with av.open(str(path)) as film:
        frames = [frame.to_ndarray(format="rgba") for frame in film.decode(video=0)]
    pixels = frames[number].astype(np.float32) / 255.0
    rows, columns = np.mgrid[: pixels.shape[0], : pixels.shape[1]] // 20
    grey = (0.22 + 0.1 * ((rows + columns) % 2))[..., None]
    return np.asarray(pixels[..., :3] * pixels[..., 3:] + grey * (1.0 - pixels[..., 3:]))


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        before = Path.cwd()
        os.chdir(folder)
        try:
            material()
            for title, (kind, lines) in tasks().items():
                print(title, file=sys.stderr)
                run(kind, lines)
            io.write_picture(FILE, picture(), quality=84)
        finally:
            os.chdir(before)
    print(FILE, FILE.stat().st_size)


if __name__ == "__main__":
    main()
