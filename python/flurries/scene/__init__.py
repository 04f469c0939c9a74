"""The scene: a frame is a pure function of it and the frame number."""

from flurries.scene.scene import Scene
from flurries.scene.scene import open_scene as open

__all__ = ["Scene", "open"]
