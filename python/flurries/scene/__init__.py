"""A scene, of which a frame is a pure function, and what it is made of beside its effects."""

from flurries.frame.truth import Rendered
from flurries.light.lamp import Lamp, Sun
from flurries.light.shot import Light
from flurries.scene.depth import DepthMap
from flurries.scene.foreground import Foreground
from flurries.scene.output import Output
from flurries.scene.scene import Scene, find_light
from flurries.scene.scene import open_scene as open

__all__ = [
    "DepthMap", "Foreground", "Lamp", "Light", "Output", "Rendered", "Scene", "Sun", "find_light",
    "open",
]  # fmt: skip
