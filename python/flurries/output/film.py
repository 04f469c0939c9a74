"""A scene's frames as files, or a video with the sound of the film that it lies over."""

from collections.abc import Callable, Iterable
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from flurries._threads import reproducible
from flurries._trace import current
from flurries.io import Pattern, VideoWriter, replacing
from flurries.io.atomic import flush_folder
from flurries.io.films.codecs import bits_for
from flurries.io.films.process import Remote
from flurries.io.films.writer import GROUP, Film, Plan
from flurries.io.stores import Store
from flurries.output.cluster import run_on
from flurries.output.journal import Journal, Mark, is_journal
from flurries.output.sequence import Fates, Job, Progress, run
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


def write_film(
    shots: Frames, frames: list[int], progress: Progress, dask: Any, patience: float
) -> tuple[Fates, str]:
    """Render frames into a video, unless the very same one is there."""
    scene, output, path = shots.scene, shots.content.output, shots.pattern
    if scene._film is not None and path.exists() and path.samefile(scene._film.spec):
        raise ValueError(f"{path} is the scene's own background; choose another name")
    heard, part = scene._sound(frames, skip=shots.skip) if output.sound else ("none", None)
    if isinstance(output.bits, str):
        raise ValueError(f"bits must be 8, 10 or 16 for a film, got {output.bits!r}")
    tags, bits = scene._tags(frames[0]), cast("int | None", output.bits)
    least = tags.bits if scene._film is not None else 8
    if bits is None and (output.codec is None or least > 8):
        bits = bits_for(path.suffix.lower(), output.codec, least)
    way = output.quality, part and (part.start, part.length)
    mark = _mark(shots, frames, way)
    plan = VideoWriter(
        path, scene.size, scene.fps, quality=output.quality, sound=part, bits=bits, tags=tags,
        codec=output.codec, alpha=output.kind == "alone",
        comment=f"flurries {mark.scene} {mark.inputs}",
    ).plan  # fmt: skip
    shots.fine = plan.codec.bits > 8
    groups = _Groups(shots, plan, frames)
    indices = [[index] for index in range(len(groups.groups))]
    film = _Joined(groups, frames, way, partial(run_on, dask, patience, groups, indices, progress))
    fates = Fates()
    try:
        fates = run(film, [0], iter)
    finally:
        groups.clear(whole=bool(fates), made=film.made is not None)
    return film.made or fates, heard


def _mark(shots: Frames, frames: list[int], way: object) -> Mark:
    """Return the mark of a film, or of a part of it, that is encoded in a way."""
    marks = [shots.mark_of(number) for number in frames]
    scene = short_hash(([mark.scene for mark in marks], frames, way, shots.skip))
    return replace(marks[0], scene=scene, inputs=short_hash([mark.inputs for mark in marks]))


class _Groups(Job):
    """The groups of frames of a film, each a file of packets."""

    scratch = True

    def __init__(self, shots: Frames, plan: Plan, frames: list[int]) -> None:
        self.shots, self.plan = shots, plan
        self.groups = [frames[first : first + GROUP] for first in range(0, len(frames), GROUP)]
        self.folder = plan.path.with_name(f"{plan.path.name}.parts")

    def frames(self, index: int) -> list[int]:
        return self.groups[index]

    def path_of(self, index: int) -> Path:
        return self.folder / f"{index:04d}.npz"

    def mark_of(self, index: int) -> Mark:
        plan = self.plan
        way = (plan.size, plan.fps, plan.codec, plan.threads, replace(plan.tags, timecode=None))
        return _mark(self.shots, self.groups[index], way)

    def make(self, index: int, numbers: Iterable[int]) -> Any:
        plan, shots, skipped = self.plan, self.shots, []
        levels = 8 if plan.codec.bits == 8 else 16
        with closing(Remote(plan.path, "written", Film, plan)) as film:
            for number in numbers:
                image = shots.make(number, ())
                if image is None:
                    skipped.append(number)
                    continue
                # While it is encoded, the next one is rendered.
                with current.get().stage("encode"):
                    film.begin("encode", shots.content.levels(image, levels, plan.path))
            with current.get().stage("encode"):
                return *film.call("end_group"), skipped

    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None:
        times, data, _ = made
        with replacing(path) as place:
            np.savez(place, times=times, data=data)

    def notes(self, index: int, made: Any) -> dict[str, Any]:
        return {"skipped": made[2]}

    def stands_in(self, number: int) -> bool:
        return self.shots.stands_in(number)

    def clear(self, *, whole: bool, made: bool) -> None:
        """Remove what a film that is whole does not need, or the folder if it has no group."""
        groups = [self.path_of(index) for index in range(len(self.groups))]
        with suppress(OSError, ValueError):
            noted = Journal(self.store, self.folder).names()
            # Ctrl-C can miss a writer that has just begun: what is noted may yet take its name.
            if whole or not (noted or any(path.exists() for path in groups)):
                # A run that was killed, here or elsewhere, had no time for it.
                self.store.tidy(self.folder)
                # What was made or kept now is ours, even if somebody has lost the lines since.
                ours = [*noted, *(path.name for path in groups if made)]
                found = list(self.folder.iterdir())
                # Groups go when the film has its name for certain, and before their lines: a group
                # without its line would be a stranger's.
                flush_folder(self.folder.parent)
                for part in (part for part in found if part.name in ours):
                    part.unlink()
                flush_folder(self.folder)
                for part in (part for part in found if is_journal(part.name)):
                    part.unlink()
                self.folder.rmdir()


@dataclass
class _Joined(Job):
    """The film: one file, of the packets of all groups."""

    groups: _Groups
    numbers: list[int]
    way: object
    make_groups: Callable[[], Fates]
    made: Fates | None = None  # What became of its frames, if it was not there.

    def __post_init__(self) -> None:
        self.folder, self.overwrite = self.path_of(0).parent, self.groups.shots.overwrite

    def frames(self, index: int) -> list[int]:
        return self.numbers

    def path_of(self, index: int) -> Path:
        return self.groups.plan.path

    def mark_of(self, index: int) -> Mark:
        return _mark(self.groups.shots, self.numbers, self.way)

    def make(self, index: int, numbers: Iterable[int]) -> Any:
        self.made = self.make_groups()
        return self.made

    def save(self, path: Path, made: Fates, header: dict[str, Any]) -> None:
        plan = self.groups.plan
        with replacing(path) as place, closing(Remote(path, "written", Film, plan)) as film:
            film.call("open", place)
            for index in range(len(self.groups.groups)):
                with np.load(self.groups.path_of(index), allow_pickle=False) as packets:
                    film.call("join", packets["times"], packets["data"])
            film.call("finish", len(made) - len(made.of("skipped")))

    def notes(self, index: int, made: Fates) -> dict[str, Any]:
        return {"skipped": made.of("skipped")}
