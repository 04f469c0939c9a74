"""The frames of a scene as files, each with the mark of the scene."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flurries._threads import reproducible
from flurries.io import Pattern
from flurries.output.contents import Content
from flurries.output.mark import Mark
from flurries.output.store import Disk, Store
from flurries.scene.fingerprint import Inputs, settings
from flurries.scene.scene import Scene


@dataclass
class Frames:
    """A `Job` of one scene's frames."""

    scene: Scene  # What to render. Its files are read again, whatever it has kept of them.
    content: Content  # What a file holds.
    pattern: str  # The files' names; without a token the name of one still.
    store: Store = field(default_factory=Disk)  # Where the files are kept.
    overwrite: bool = False
    listed: bool = True  # See `flurries.output.sequence.Job`.
    skip: bool = False  # Whether frames whose background cannot be read are left out.
    tolerant: bool = False
    folder: Path = field(init=False)
    inputs: Inputs = field(init=False)
    _mark: str = field(init=False)

    def __post_init__(self) -> None:
        self.scene = self.scene.anew()
        self.folder = Path(self.pattern).parent
        self.inputs = Inputs(self.scene)
        # Frames of the two modes are never mixed.
        mode = "-reproducible" if reproducible() else ""
        self._mark = f"{settings(self.scene)}-{self.content.mark}{mode}"

    def path_of(self, index: int) -> Path:
        still = "%" not in Path(self.pattern).name
        return Path(self.pattern) if still else Pattern(self.pattern).path(index)

    def mark_of(self, index: int) -> Mark:
        return Mark(self._mark, index, self.inputs.of(index), self.inputs.names)

    def make(self, index: int) -> Any:
        if self.skip and not is_readable(self.scene, index):
            return None
        return self.content.render(self.scene, index)

    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None:
        self.content.save(self.scene, path, made, {**header, "seed": self.scene.seed})

    def notes(self, index: int) -> dict[str, Any]:
        return {}

    def stands_in(self, index: int) -> bool:
        return index in self.scene.held


def is_readable(scene: Scene, number: int) -> bool:
    """Whether background and depth of a frame can be read."""
    try:
        scene.look(number)
    except (OSError, ValueError):
        return False
    return True
