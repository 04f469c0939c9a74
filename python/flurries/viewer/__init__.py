"""The viewer: sliders beside a picture that follows them, in a notebook or in a browser."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flurries._contract import library
from flurries.scene.scene import Scene

if TYPE_CHECKING:
    from flurries.viewer.widget import Viewer

__all__ = ["view"]


def view(scene: Scene, *, size: int = 512, save: str = "tuned.toml") -> Viewer:
    """Return a widget that shows a scene in a notebook, with sliders.

    Its `scene` is the scene as the sliders stand. While a slider is dragged the air goes on; a
    saved scene has its values from frame 0 on.

    Parameters
    ----------
    scene : Scene
        The scene that the sliders start from; it is not changed.
    size : int
        Pixels of the longer side of the picture, 16 to 4096. More is slower.
    save : path
        File that the button "Save" writes the scene to, as TOML; it replaces an older file.
    """
    need = "fl.view needs anywidget: pip install 'flurries[view]'"
    made: Viewer = library("flurries.viewer.widget", need).Viewer(scene, size=size, save=save)
    return made
