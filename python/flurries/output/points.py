"""Flakes of a scene as points of a USD stage, with the camera that sees them."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from flurries.effects.drawn import STEP, drawn_of, velocities
from flurries.frame.mixing import free_name
from flurries.io.stage import PointStage, require_usd
from flurries.output.journal import Mark
from flurries.output.sequence import Job
from flurries.scene.fingerprint import fingerprint, short_hash
from flurries.scene.scene import Scene

EXTENSIONS = (".usd", ".usda", ".usdc")

# Points of all frames together: some 4 GB in the file.
MOST_POINTS = 100_000_000


class Points(Job):
    """A USD stage with the flakes that are in view, and the camera."""

    def __init__(self, scene: Scene, path: Path, frames: list[int], *, overwrite: bool) -> None:
        require_usd()
        self.scene, self.path, self.numbers, self.overwrite = scene, path, frames, overwrite
        self.folder = path.parent
        self._mark = Mark(short_hash((fingerprint(scene), frames)), frames[0])

    def frames(self, index: int) -> list[int]:
        return self.numbers

    def path_of(self, index: int) -> Path:
        return self.path

    def mark_of(self, index: int) -> Mark:
        return self._mark

    def make(self, index: int, numbers: Iterable[int]) -> Any:
        scene, program = self.scene, self.scene._program
        names: list[str] = []
        for effect in scene.effects:
            names.append(free_name(getattr(effect, "NAME", "effect"), names))
        stage = PointStage(self.numbers, scene.fps, self._mark.scene)
        for number in numbers:
            for name, found in points_at(scene, names, number).items():
                stage.add(name, number, *found)
                if stage.total > MOST_POINTS:
                    raise ValueError(
                        f"{self.path}: more than {MOST_POINTS} points up to frame {number}; take "
                        "fewer frames, or a population with a smaller far or density"
                    )
            t = scene._time_of(number)
            eye = program.camera(None, t)
            lens = eye.focals, eye.principal(scene._shape), scene._shape
            place = program.base.path.place(t, fps=scene.fps) + eye.matrix() @ eye.offset
            stage.see(number, eye.matrix(), place, *lens)
        if not stage.prims:
            raise ValueError(
                f"{self.path}: points are flakes of Snow and Rain; the scene has none that are "
                "drawn one by one"
            )
        return stage

    def save(self, path: Path, made: PointStage, header: dict[str, Any]) -> None:
        made.save(path)


def points_at(scene: Scene, names: list[str], number: float) -> dict[str, Any]:
    """Return the flakes of each effect that has any and their velocities, by its name."""
    program = scene._program
    t = scene._time_of(number)
    found = {}
    for part in program.parts:
        frame = replace(program.frame(t), seed=part.seed)
        moment = frame.t + STEP
        later = replace(frame, t=moment, camera=program.camera(None, moment))
        now, then = drawn_of(part.effect, frame), drawn_of(part.effect, later)
        if now is not None and then is not None:
            found[names[part.place]] = now, velocities(now, then, STEP / scene.fps)
    return found
