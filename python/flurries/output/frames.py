"""The frames of a scene as files, each by itself."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from flurries._threads import reproducible
from flurries.io import Pattern
from flurries.io.stores import Store
from flurries.output.journal import Mark
from flurries.output.sequence import Job
from flurries.scene.content import Content
from flurries.scene.fingerprint import Inputs, Settings, short_hash


class Frames(Job):
    """One scene's frames, each a file."""

    def __init__(self, content: Content, pattern: str, store: Store, *, overwrite: bool) -> None:
        self.content, self.scene = content, content.scene
        self.pattern, self.store, self.overwrite = Path(pattern), store, overwrite
        self.folder = self.pattern.parent
        self.skip = content.output.damaged == "skip"
        self.fine = False  # Whether all is mixed in more than 8 bits.
        self._inputs = Inputs(self.scene)
        # Eyes of their own see more of the camera's way.
        self._settings = Settings(self.scene, whole=content.eyes is not None)
        # Frames of the two modes are never mixed.
        self._mark = f"{self._settings.common}-{short_hash((reproducible(), content.way))}"

    def path_of(self, index: int) -> Path:
        still = "%" not in self.pattern.name
        return self.pattern if still else Pattern(str(self.pattern)).path(index)

    def mark_of(self, index: int) -> Mark:
        return Mark(self._mark + self._settings.of(index), index, self._inputs.of(index))

    def stands_in(self, number: int) -> bool:
        return number in self.scene._held

    def make(self, index: int, numbers: Iterable[int]) -> Any:
        if self.skip:
            try:
                self.scene._look(index)
            except (OSError, ValueError):
                return None
        return self.content.render(index, fine=self.fine)

    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None:
        self.content.save(path, made, header)
