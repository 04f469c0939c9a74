"""Falling snow, synthesized in the frequency domain, with particles on top.

Arrays in, arrays out: :mod:`flurries.spectral`, :mod:`flurries.camera`, :mod:`flurries.particles`,
:mod:`flurries.hybrid`, :mod:`flurries.composite`. Pictures and film: :class:`Scene`, its effects.
"""

from flurries import camera, composite, hybrid, particles, spectral, stereo, trace
from flurries._core import InternalError
from flurries._threads import set_threads, threads
from flurries.camera import Camera
from flurries.depth import DepthMap
from flurries.effects import Frame, Layer, MatchedSnow, Rain, Snow
from flurries.path import CameraPath
from flurries.scene import Rendered, Scene
from flurries.sun import Sun
from flurries.timeline import Keys
from flurries.wind import Wind

__version__ = "0.1.0"

__all__ = [
    "Camera",
    "CameraPath",
    "DepthMap",
    "Frame",
    "InternalError",
    "Keys",
    "Layer",
    "MatchedSnow",
    "Rain",
    "Rendered",
    "Scene",
    "Snow",
    "Sun",
    "Wind",
    "camera",
    "composite",
    "hybrid",
    "particles",
    "set_threads",
    "spectral",
    "stereo",
    "threads",
    "trace",
]
