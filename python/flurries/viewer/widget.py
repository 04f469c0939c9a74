"""The viewer in a notebook: an anywidget that draws what a session answers."""

import base64
from typing import Any

import anywidget
import traitlets

from flurries.scene.scene import Scene
from flurries.viewer.session import Session
from flurries.viewer.web import text_of


class Viewer(anywidget.AnyWidget):
    """Sliders, a picture that follows them, the spectrum and the tent."""

    _esm = text_of("viewer.js")
    _css = text_of("viewer.css")
    about = traitlets.Dict().tag(sync=True)

    def __init__(self, scene: Scene, **options: Any) -> None:
        self._session = Session(scene, **options)
        super().__init__(about=self._session.describe())
        self.on_msg(self._asked)

    @property
    def scene(self) -> Scene:
        """The scene as the sliders stand now."""
        return self._session.tuned

    def _repr_mimebundle_(self, **options: Any) -> Any:
        """Show itself, with a still picture for pages where no kernel runs."""
        made = super()._repr_mimebundle_(**options)
        _, pictures = self._session.answer({"t": self._session.scene.fps})
        data = made[0] if isinstance(made, tuple) else made
        if data is not None and pictures:
            data["image/jpeg"] = base64.b64encode(pictures[0]).decode()
        return made

    def _asked(self, _: Any, content: dict[str, Any], __: list[Any]) -> None:
        head, buffers = self._session.answer(content.get("ask", {}))
        self.send({"id": content.get("id"), "head": head}, buffers=buffers)
