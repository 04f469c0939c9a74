"""Falling snow, synthesized in the frequency domain, with particles on top.

Arrays in, arrays out: :mod:`flurries.spectral`, :mod:`flurries.camera`, :mod:`flurries.particles`,
:mod:`flurries.gas`, :mod:`flurries.composite`, :mod:`flurries.stereo`.
Pictures and film: :class:`Scene` and its effects.

An argument that is not as described is refused by a TypeError or a ValueError that names it. `out`,
where a function has it, is an array of the result's shape and dtype to write into and return;
`dtype` is the type of its numbers, float32 or float64.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from flurries import _build as _build
from flurries._core import InternalError
from flurries._threads import set_threads, settings

if TYPE_CHECKING:
    from flurries import (
        augment,
        camera,
        composite,
        cone,
        effects,
        gas,
        io,
        particles,
        spectral,
        stereo,
    )
    from flurries.camera import Camera
    from flurries.camera.optics import Lens
    from flurries.camera.path import CameraPath
    from flurries.effects import Mist, Rain, Snow, register
    from flurries.frame.layer import Layer
    from flurries.frame.truth import Rendered
    from flurries.frame.view import Frame
    from flurries.light.lamp import Lamp, Sun
    from flurries.motion.keys import Keys
    from flurries.motion.wind import Wind
    from flurries.scene import Scene, open
    from flurries.scene.depth import DepthMap
    from flurries.scene.flakes import flakes
    from flurries.scene.foreground import Foreground
    from flurries.scene.output import Output
    from flurries.viewer import view

    __version__: str

__all__ = [
    "Camera",
    "CameraPath",
    "DepthMap",
    "Foreground",
    "Frame",
    "InternalError",
    "Keys",
    "Lamp",
    "Layer",
    "Lens",
    "Mist",
    "Output",
    "Rain",
    "Rendered",
    "Scene",
    "Snow",
    "Sun",
    "Wind",
    "augment",
    "camera",
    "composite",
    "cone",
    "effects",
    "flakes",
    "gas",
    "io",
    "open",
    "particles",
    "register",
    "set_threads",
    "settings",
    "spectral",
    "stereo",
    "view",
]


# Where the names come from that are imported when somebody asks for them: kernels alone need no
# scenes, and `import flurries` takes little more than NumPy.
_FROM = {
    "Camera": "camera",
    "CameraPath": "camera.path",
    "DepthMap": "scene.depth",
    "Foreground": "scene.foreground",
    "Output": "scene.output",
    "flakes": "scene.flakes",
    "Frame": "frame.view",
    "Keys": "motion.keys",
    "Layer": "frame.layer",
    "Rendered": "frame.truth",
    "Scene": "scene",
    "open": "scene",
    "Lamp": "light.lamp",
    "Lens": "camera.optics",
    "Sun": "light.lamp",
    "Wind": "motion.wind",
    "view": "viewer",
    "register": "effects",
    "Mist": "effects",
    "Rain": "effects",
    "Snow": "effects",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        # It stands in Cargo.toml alone. Asking the installed package takes tens of milliseconds.
        from importlib.metadata import version

        found: Any = version("flurries")
    elif name in _FROM:
        found = getattr(import_module(f"flurries.{_FROM[name]}"), name)
    elif name in __all__:
        found = import_module(f"flurries.{name}")
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
