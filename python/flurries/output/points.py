"""Flakes of a scene as points of a USD stage, with the camera that sees them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import Array
from flurries.camera.importers.usd import require_usd
from flurries.effects.drawn import STEP, drawn_of, velocities
from flurries.frame.mixing import free_name
from flurries.io.atomic import replacing
from flurries.output.folder import Store
from flurries.output.journal import Journal, Mark
from flurries.output.sequence import Done, Progress
from flurries.scene.fingerprint import fingerprint, short_hash
from flurries.scene.scene import Scene

EXTENSIONS = (".usd", ".usda", ".usdc")

# From the house's axes to a stage's, y up.
_UP = np.array([1.0, -1.0, -1.0])

# Width of the film in tenths of a unit, which is a metre: 36 mm.
_FILM = 0.36

# Points of all frames together: some 4 GB in the file.
MOST_POINTS = 100_000_000


def write_points(
    scene: Scene, path: Path, frames: Sequence[int], progress: Progress, *, overwrite: bool
) -> Done:
    """Write the flakes that are in view, and the camera, to a USD stage."""
    Gf, _, Usd, UsdGeom, Vt = require_usd()
    names: dict[str, Any] = {}
    for effect in scene.effects:
        names[free_name(getattr(effect, "NAME", "effect"), names)] = effect
    mark = Mark(short_hash((fingerprint(scene), list(frames))), frames[0])
    journal = Journal(Store(), path.parent)
    if not overwrite and journal.settled(path, mark) is not None:
        return Done(kept=list(frames))
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().customLayerData = {"flurries": mark.scene}
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(scene.fps)
    stage.SetFramesPerSecond(scene.fps)
    stage.SetStartTimeCode(min(frames))
    stage.SetEndTimeCode(max(frames))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/flurries").GetPrim())
    camera = UsdGeom.Camera.Define(stage, "/flurries/camera")
    pose = camera.AddTransformOp()
    prims: dict[str, Any] = {}
    total = 0
    for number in progress(frames):
        for name, (flakes, speed) in points_at(scene, names, number).items():
            if name not in prims:
                prims[name] = UsdGeom.Points.Define(stage, f"/flurries/{name}")
            total += len(flakes)
            if total > MOST_POINTS:
                raise ValueError(
                    f"{path}: more than {MOST_POINTS} points up to frame {number}; take fewer "
                    "frames, or a population with a smaller far or density"
                )
            _set_points(prims[name], flakes, speed, float(number), UsdGeom, Vt)
        _set_camera(camera, pose, scene, number, Gf)
    if not prims:
        raise ValueError(
            f"{path}: points are flakes of Snow and Rain; the scene has none that are drawn one by "
            "one"
        )
    if not overwrite:
        journal.settled(path, mark)
    with journal.recording(path, mark.facts), replacing(path) as temporary:
        try:
            stage.GetRootLayer().Export(str(temporary))
        except RuntimeError as error:
            raise OSError(f"{path}: {str(error).splitlines()[0]}") from error
    journal.join()
    return Done(written=list(frames))


def points_at(scene: Scene, names: dict[str, Any], number: float) -> dict[str, Any]:
    """Return the flakes of each effect that has any and their velocities, by its name."""
    program = scene._program
    t = scene._time_of(number)
    effects = list(names)
    found = {}
    for part in program.parts:
        frame = replace(program.frame(t), seed=part.seed)
        moment = frame.t + STEP
        later = replace(frame, t=moment, camera=program.camera(None, moment))
        now, then = drawn_of(part.effect, frame), drawn_of(part.effect, later)
        if now is not None and then is not None:
            found[effects[part.place]] = now, velocities(now, then, STEP / scene.fps)
    return found


def _set_points(prim: Any, flakes: Array, speed: Array, time: float, UsdGeom: Any, Vt: Any) -> None:
    def vectors(values: Array) -> Any:
        return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values * _UP, np.float32))

    def numbers(values: Array) -> Any:
        return Vt.FloatArray.FromNumpy(np.ascontiguousarray(values, np.float32))

    places = vectors(flakes["place"])
    widths = numbers(flakes["diameter"])
    prim.GetPointsAttr().Set(places, time)
    prim.GetVelocitiesAttr().Set(vectors(speed), time)
    prim.GetWidthsAttr().Set(widths, time)
    ids = np.ascontiguousarray(flakes["id"].astype(np.int64))
    prim.GetIdsAttr().Set(Vt.Int64Array.FromNumpy(ids), time)
    prim.SetWidthsInterpolation(UsdGeom.Tokens.vertex)
    opacity = prim.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.vertex)
    opacity.Set(numbers(flakes["opacity"]), time)
    prim.GetExtentAttr().Set(UsdGeom.Points.ComputeExtent(places, widths), time)


def _set_camera(camera: Any, pose: Any, scene: Scene, number: int, Gf: Any) -> None:
    program = scene._program
    t = scene._time_of(number)
    eye = program.camera(None, t)
    height, width = scene.shape
    turn = _UP[:, None] * eye.matrix() * _UP
    place = program.base.path.place(t, fps=scene.fps) + eye.matrix() @ eye.offset
    matrix = np.eye(4)
    matrix[:3, :3], matrix[3, :3] = turn.T, place * _UP
    pose.Set(Gf.Matrix4d(matrix.tolist()), float(number))
    fx, fy = eye.focals
    x, y = eye.principal(scene.shape)
    down = _FILM * fx * height / (width * fy)
    camera.GetFocalLengthAttr().Set(_FILM * fx / width, float(number))
    camera.GetHorizontalApertureAttr().Set(_FILM, float(number))
    camera.GetVerticalApertureAttr().Set(down, float(number))
    camera.GetHorizontalApertureOffsetAttr().Set(_FILM * (0.5 - x / width), float(number))
    camera.GetVerticalApertureOffsetAttr().Set(down * (y / height - 0.5), float(number))
    camera.GetClippingRangeAttr().Set(Gf.Vec2f(0.01, 1e5))
