"""Falling snow, synthesized in the frequency domain, with particles on top.

Arrays in, arrays out: :mod:`flurries.spectral`, :mod:`flurries.camera`, :mod:`flurries.particles`,
:mod:`flurries.gas`, :mod:`flurries.composite`, :mod:`flurries.stereo`.
Pictures and film: :class:`Scene` and its effects.

An argument that is not as described is refused by a TypeError or a ValueError that names it. `out`,
where a function has it, is an array of the result's shape and dtype to write into and return, and
none of the arguments; `dtype` is the type of its numbers, float32 or float64. `shape` is a
picture's (H, W) in pixels, and `seed` any int64.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from flurries import _build as _build
from flurries._core import __version__ as __version__
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
        scene,
        spectral,
        stereo,
    )
    from flurries.camera import Camera
    from flurries.camera.path import CameraPath
    from flurries.effects import Mist, Rain, Snow
    from flurries.matching.match import match
    from flurries.motion.keys import Keys
    from flurries.motion.wind import Wind
    from flurries.scene import Scene, open
    from flurries.scene.scene import flakes
    from flurries.viewer import view

__all__ = [
    "Camera", "CameraPath", "Keys", "Mist", "Rain", "Scene", "Snow", "Wind", "augment", "camera",
    "composite", "cone", "effects", "flakes", "gas", "io", "match", "open", "particles", "scene",
    "set_threads", "settings", "spectral", "stereo", "view",
]  # fmt: skip

# Where the names come from that are imported when somebody asks for them: kernels alone need no
# scenes, and `import flurries` takes little more than NumPy.
_MODULES = {
    "camera": ("Camera",), "camera.path": ("CameraPath",), "effects": ("Mist", "Rain", "Snow"),
    "motion.keys": ("Keys",), "motion.wind": ("Wind",), "scene": ("Scene", "open"),
    "matching.match": ("match",), "scene.scene": ("flakes",), "viewer": ("view",),
}  # fmt: skip
_FROM = {name: module for module, names in _MODULES.items() for name in names}
# Names of 0.2: who asks for one is told where it is.
_MOVED = {
    "effects": "ConeRain ConeSnow Frame Layer TentRain TentSnow register", "camera": "Lens",
    "scene": "DepthMap Foreground Lamp Output Rendered Sun",
}  # fmt: skip

# For who checks types only the names above are there.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name in _FROM:
            found: Any = getattr(import_module(f"flurries.{_FROM[name]}"), name)
        elif name in __all__:
            found = import_module(f"flurries.{name}")
        else:
            there = [f"flurries.{home}.{name}" for home in _MOVED if name in _MOVED[home].split()]
            hint = f"; it is {there[0]}" if there else ""
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
