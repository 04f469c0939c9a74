"""Cameras of USD stages: Blender, Houdini, Maya, Unreal."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import Float64, PathLike, real, shape_of
from flurries.camera.importers.matrices import FLIP, path_of
from flurries.camera.lens import Camera, expect_camera
from flurries.camera.path import CameraPath
from flurries.io.files import plain_file
from flurries.io.films.process import Remote
from flurries.io.stage import require_usd

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")

# From a stage's axes to the house's, by the axis that is up.
AXES = {"Y": FLIP, "Z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])}

_SAME = 1e-5  # Ratios of apertures that are floats differ by their last bits.

# Where apertures are of another shape than the picture by more, they are no edges of it.
_FITS = 0.005

MOST_SAMPLES = 100_000

_SIDES = ("horizontalAperture", "verticalAperture")
_LENS = ("focalLength", *_SIDES, *(f"{side}Offset" for side in _SIDES))

# Bytes of addresses while a stage is opened, beside its own: a damaged one may ask for all.
_MOST_MEMORY = 1 << 32

# Of a stage that is whole and has no camera for us: the other process hands on Python's own alone.
Refused = LookupError


def read_usd(
    path: PathLike, shape: tuple[int, int], *, camera: Camera | None = None,
    prim: str | None = None, scale: float = 1.0,
) -> CameraPath:  # fmt: skip
    """Return the camera path of a USD stage, which says its axes and unit; time codes are frames.

    Parameters
    ----------
    shape : (H, W)
        Of the pictures. Apertures of their shape are their edges, and say how wide a pixel is;
        those of another shape fit the width, with a warning.
    camera, prim : Camera and str, optional
        A camera whose `aspect` is the pictures' own, where the apertures are of another shape; and
        the stage's camera, such as ``/shot/camera``, where it has several.
    """
    require_usd()
    size = shape_of("shape", shape)
    file, scale = plain_file(path), real("scale", scale, above=0.0)
    given = None if camera is None else expect_camera(camera, stretched=True)
    try:
        with closing(Remote(file, "read", Stage)) as stage:
            times, places, turns, lenses = stage.call("camera", file, prim)
        lens, focal, note = _lens(lenses, size, given)
    except Exception as error:
        if isinstance(error, OSError) and str(file) in str(error):
            raise
        said = error if type(error) is Refused else "no USD stage, or a damaged one"
        raise ValueError(f"{file}: {said}") from None
    if note:
        warnings.warn(f"{file}: {note}", UserWarning, stacklevel=2)
    if not len(times):
        return CameraPath(lens, position=scale * places, orientation=turns)
    return path_of(times, places, turns, lens, focal, scale)


class Stage:
    """Reads a stage, in a process of its own."""

    NOUN = "stage"

    def camera(self, file: Path, prim: str | None) -> tuple[Float64, Float64, Float64, Float64]:
        """Return the times (n,) of a camera's poses, the poses, and each lens, (n or 1, ...)."""
        Gf, Usd, UsdGeom, _ = require_usd()
        with _bounded(_MOST_MEMORY + 4 * file.stat().st_size):
            stage = Usd.Stage.Open(str(file))
        cameras = {str(one.GetPath()): one for one in stage.Traverse() if one.IsA(UsdGeom.Camera)}
        names = ", ".join(cameras) or "none"
        if prim is not None and str(prim) not in cameras:
            raise Refused(f"prim {prim!r} is no camera of the stage; it has {names}")
        if prim is None and len(cameras) != 1:
            raise Refused(f"one camera is wanted, as {file.name}:/its/path; it has {names}")
        chosen = cameras[names if prim is None else str(prim)]
        times, found = _times(chosen, UsdGeom), UsdGeom.Camera(chosen)
        unit = UsdGeom.GetStageMetersPerUnit(stage)
        world = AXES[str(UsdGeom.GetStageUpAxis(stage))]
        turns, places, lenses = [], [], []
        for time in times or [Usd.TimeCode.Default()]:
            seen = found.GetCamera(time)
            if seen.projection != Gf.Camera.Perspective:
                raise Refused(f"{chosen.GetPath()} is orthographic, and depth is none in it")
            matrix = np.array(seen.transform).T
            turns.append(world @ _rotation(matrix[:3, :3]) @ FLIP)
            places.append(unit * (world @ matrix[:3, 3]))
            lenses.append([getattr(seen, name) for name in _LENS])
        return np.array(times), np.array(places), np.array(turns), np.array(lenses)


@contextmanager
def _bounded(size: int) -> Iterator[None]:
    """Refuse this process more memory than a size, where the system can."""
    try:
        import resource
    except ImportError:
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def _times(prim: Any, UsdGeom: Any) -> list[float]:
    """Return the times of a camera's samples and the frames between them; none if it is still."""
    found = {time for name in _LENS for time in prim.GetAttribute(name).GetTimeSamples()}
    while prim and not prim.IsPseudoRoot():
        if prim.IsA(UsdGeom.Xformable):
            found.update(UsdGeom.Xformable(prim).GetTimeSamples())
        prim = prim.GetParent()
    if not found:
        return []
    first, last = math.ceil(min(found)), math.floor(max(found))
    if last - first + len(found) > MOST_SAMPLES:
        raise Refused(f"frames {first} to {last} are too many for one camera")
    return sorted(found | set(map(float, range(first, last + 1))))


def _rotation(matrix: Float64) -> Float64:
    """Return the rotation of a matrix without its scale."""
    lengths = np.linalg.norm(matrix, axis=0)
    if not np.isfinite(lengths).all() or lengths.min() == 0.0:
        raise Refused("the camera's matrix is no rotation")
    turn: Float64 = matrix / lengths
    if np.abs(turn.T @ turn - np.eye(3)).max() > 1e-4 or np.linalg.det(turn) < 0.0:
        raise Refused("the camera's matrix shears or mirrors")
    # The nearest rotation: values of a file are rounded.
    left, _, right = np.linalg.svd(turn)
    return np.asarray(left @ right)


def _lens(
    rows: Float64, shape: tuple[int, int], given: Camera | None
) -> tuple[Camera, Float64, str]:
    """Return the lens at the first time, the focal lengths in pixels of all, and a warning."""
    (height, width), note = shape, ""
    length, across, down, right, up = rows.T
    if rows[:, :3].min() <= 0.0 or not np.isfinite(rows).all():
        raise Refused("focal lengths and apertures must be positive")
    ratio = height * across / (width * down)
    plate = 1.0 if given is None else given.aspect
    # Apertures that are edges of a picture with square pixels or the plate's own, to their bits.
    aspect = next((one for one in (plate, 1.0) if np.abs(ratio / one - 1.0).max() < _SAME), None)
    if aspect is None:
        aspect = float(ratio[0])
        if given is not None and np.abs(ratio / plate - 1.0).max() >= _FITS:
            aspect = plate
            note = (
                f"apertures of {across[0]:.4g} x {down[0]:.4g} are of another shape than the "
                f"picture of {width} x {height} px; the width counts"
            )
        if np.ptp(ratio) > _SAME * aspect:
            raise Refused("the pixel aspect of a camera must not change")
    x = width * (0.5 - right / across)
    y = 0.5 * height + aspect * width * up / across
    moves = max(np.ptp(x), np.ptp(y))
    if moves > 1e-3:
        raise Refused(f"a camera's principal point must not change; it moves by {moves:.3g} px")
    focal = width * length / across
    return Camera(float(focal[0]), center=(float(x[0]), float(y[0])), aspect=aspect), focal, note
