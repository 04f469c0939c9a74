"""Falling snow, synthesized in the frequency domain, with particles on top.

Arrays in, arrays out: :mod:`flurries.spectral`, :mod:`flurries.camera`, :mod:`flurries.particles`,
:mod:`flurries.gas`, :mod:`flurries.hybrid`, :mod:`flurries.composite`, :mod:`flurries.stereo`.
Pictures and film: :class:`Scene` and its effects.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from flurries._core import InternalError
from flurries._threads import reproducible, set_reproducible, set_threads, threads

if TYPE_CHECKING:
    from flurries import camera, composite, cone, gas, hybrid, particles, spectral, stereo, trace
    from flurries.camera import Camera
    from flurries.depth import DepthMap
    from flurries.effects import ConeRain, ConeSnow, Frame, Layer, MatchedSnow, Mist, Rain, Snow
    from flurries.path import CameraPath
    from flurries.scene import Rendered, Scene
    from flurries.sun import Sun
    from flurries.timeline import Keys
    from flurries.viewer import view
    from flurries.wind import Wind

__version__ = "0.1.0"

__all__ = [
    "Camera",
    "CameraPath",
    "ConeRain",
    "ConeSnow",
    "DepthMap",
    "Frame",
    "InternalError",
    "Keys",
    "Layer",
    "MatchedSnow",
    "Mist",
    "Rain",
    "Rendered",
    "Scene",
    "Snow",
    "Sun",
    "Wind",
    "camera",
    "composite",
    "cone",
    "gas",
    "hybrid",
    "particles",
    "reproducible",
    "set_reproducible",
    "set_threads",
    "spectral",
    "stereo",
    "threads",
    "trace",
    "view",
]


# Where the names come from that are imported when somebody asks for them: kernels alone need no
# scenes, and `import flurries` takes little more than NumPy.
_FROM = {
    "Camera": "camera",
    "CameraPath": "path",
    "DepthMap": "depth",
    "Keys": "timeline",
    "Rendered": "scene",
    "Scene": "scene",
    "Sun": "sun",
    "Wind": "wind",
    "view": "viewer",
    **dict.fromkeys(
        ("ConeRain", "ConeSnow", "Frame", "Layer", "MatchedSnow", "Mist", "Rain", "Snow"), "effects"
    ),
}
_LATER = ("accuracy", "augment", "cameras", "cluster", "manifest")


def __getattr__(name: str) -> Any:
    if name in _FROM:
        found = getattr(import_module(f"flurries.{_FROM[name]}"), name)
        globals()[name] = found
        return found
    if not name.startswith("_") and find_spec(f"flurries.{name}") is not None:
        return import_module(f"flurries.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_LATER})
