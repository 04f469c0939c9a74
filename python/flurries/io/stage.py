"""USD stages that are written: points over time, and the camera that sees them."""

from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import Array, library
from flurries.io.atomic import replacing

_UP = np.array([1.0, -1.0, -1.0])  # From the house's axes to a stage's, y up.
_FILM = 0.36  # Width of the film in tenths of a unit, which is a metre: 36 mm.


def require_usd() -> tuple[Any, ...]:
    """Return usd-core's modules Gf, Usd, UsdGeom and Vt."""
    need = "USD files need usd-core: pip install 'flurries[usd]'"
    return tuple(library(f"pxr.{name}", need) for name in ("Gf", "Usd", "UsdGeom", "Vt"))


class PointStage:
    """A stage in memory."""

    def __init__(self, numbers: list[int], fps: float, said: str) -> None:
        self._gf, usd, self._geom, self._vt = require_usd()
        self.stage = stage = usd.Stage.CreateInMemory()
        self.prims: dict[str, Any] = {}
        self.total = 0
        stage.GetRootLayer().customLayerData = {"flurries": said}
        self._geom.SetStageUpAxis(stage, self._geom.Tokens.y)
        self._geom.SetStageMetersPerUnit(stage, 1.0)
        stage.SetTimeCodesPerSecond(fps)
        stage.SetFramesPerSecond(fps)
        stage.SetStartTimeCode(min(numbers))
        stage.SetEndTimeCode(max(numbers))
        stage.SetDefaultPrim(self._geom.Xform.Define(stage, "/flurries").GetPrim())
        self._camera = self._geom.Camera.Define(stage, "/flurries/camera")

    def add(self, name: str, number: int, flakes: Array, speed: Array) -> None:
        """Put flakes of a frame and their velocities, per second, into the points of a name."""
        vt, geom, time = self._vt, self._geom, float(number)
        if name not in self.prims:
            self.prims[name] = geom.Points.Define(self.stage, f"/flurries/{name}")
        prim = self.prims[name]
        self.total += len(flakes)

        def put(attribute: Any, kind: Any, values: Array, dtype: Any = np.float32) -> Any:
            given = kind.FromNumpy(np.ascontiguousarray(values, dtype))
            attribute.Set(given, time)
            return given

        places = put(prim.GetPointsAttr(), vt.Vec3fArray, flakes["place"] * _UP)
        put(prim.GetVelocitiesAttr(), vt.Vec3fArray, speed * _UP)
        widths = put(prim.GetWidthsAttr(), vt.FloatArray, flakes["diameter"])
        put(prim.GetIdsAttr(), vt.Int64Array, flakes["id"], np.int64)
        prim.SetWidthsInterpolation(geom.Tokens.vertex)
        put(prim.CreateDisplayOpacityPrimvar(geom.Tokens.vertex), vt.FloatArray, flakes["opacity"])
        prim.GetExtentAttr().Set(geom.Points.ComputeExtent(places, widths), time)

    def see(
        self, number: int, turn: Array, place: Array, focals: tuple[float, float],
        principal: tuple[float, float], shape: tuple[int, int],
    ) -> None:  # fmt: skip
        """Set the camera of a frame: its axes and place, and its lens in pixels."""
        (height, width), (fx, fy), (x, y) = shape, focals, principal
        matrix = np.eye(4)
        matrix[:3, :3] = (_UP[:, None] * turn * _UP).T
        matrix[3, :3] = place * _UP
        down = _FILM * fx * height / (width * fy)
        seen = self._gf.Camera(
            self._gf.Matrix4d(matrix.tolist()), self._gf.Camera.Perspective, _FILM, down,
            _FILM * (0.5 - x / width), down * (y / height - 0.5), _FILM * fx / width,
            self._gf.Range1f(0.01, 1e5),
        )  # fmt: skip
        self._camera.SetFromCamera(seen, float(number))

    def save(self, path: Path) -> None:
        with replacing(path) as temporary:
            try:
                self.stage.GetRootLayer().Export(str(temporary))
            except RuntimeError as error:
                raise OSError(f"{path}: {str(error).splitlines()[0]}") from error
