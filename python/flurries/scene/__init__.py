"""The scene: a frame is a pure function of it and the frame number."""

from flurries.scene.scene import Scene

__all__ = ["Scene"]
