"""Falling snow, synthesized in the frequency domain, with particles on top.

Arrays in, arrays out: :mod:`flurries.spectral`, :mod:`flurries.camera`, :mod:`flurries.particles`,
:mod:`flurries.gas`, :mod:`flurries.hybrid`, :mod:`flurries.composite`, :mod:`flurries.stereo`.
Pictures and film: :class:`Scene` and its effects.
"""

from types import ModuleType

from flurries import camera, composite, cone, gas, hybrid, particles, spectral, stereo, trace
from flurries._core import InternalError
from flurries._threads import reproducible, set_reproducible, set_threads, threads
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


# What only some users need is imported when they ask for it.
_LATER = ("accuracy", "augment", "cameras", "cluster", "manifest")


def __getattr__(name: str) -> ModuleType:
    if name in _LATER:
        import importlib

        return importlib.import_module(f"flurries.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LATER})
