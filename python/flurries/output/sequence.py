"""A scene to a folder of frames: what is there stays, what others make is left to them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flurries._threads import reproducible
from flurries.output import manifest
from flurries.output.claims import Claim, awaited, claimed
from flurries.output.contents import Content
from flurries.scene.scene import Scene

# Frames that are encoded while the next is rendered; each holds a picture in memory.
WRITERS = 2

# How a frame says which scene it belongs to.
SCENE_KEY = "scene"

Progress = Callable[[Iterable[int]], Iterable[int]]


@dataclass
class Sequence:
    """Frames of one scene in one folder.

    Attributes
    ----------
    scene : Scene
        What to render.
    content : Content
        What a file holds.
    pattern : str
        The files' names; without a token the name of one still.
    overwrite, skip, listed, tidy : bool
        Whether frames that are there are made again; whether frames whose background cannot be
        read are left out; whether the folder gets a manifest; whether what killed writers left in
        it is removed.
    mark : str
        What tells this scene's files from others'; made of scene and content if not given.
    plain : bool
        The mode that it was asked for in; frames of the two modes are never mixed.
    written, kept, skipped : list of int
        Frames that this process made, found, and left out.
    entries : dict
        Of the manifest, for frames written.
    """

    scene: Scene
    content: Content
    pattern: str
    overwrite: bool = False
    skip: bool = False
    listed: bool = True
    tidy: bool = True
    mark: str = ""
    plain: bool = field(default_factory=reproducible)
    written: list[int] = field(default_factory=list)
    kept: list[int] = field(default_factory=list)
    skipped: list[int] = field(default_factory=list)
    entries: dict[str, dict[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        from flurries.scene.fingerprint import fingerprint

        if not self.mark:
            mode = "-reproducible" if self.plain else ""
            self.mark = f"{fingerprint(self.scene)}-{self.content.mark}{mode}"

    def path_of(self, number: int) -> Path:
        """Return the file of a frame."""
        from flurries.io import Pattern

        still = "%" not in Path(self.pattern).name
        return Path(self.pattern) if still else Pattern(self.pattern).path(number)

    def make(self, frames: list[int], progress: Progress) -> None:
        """Make the frames that are missing."""
        from flurries.io.atomic import checked_target, remove_leftovers
        from flurries.io.pictures.writer import format_of

        first = self.path_of(frames[0])
        # Before anything is rendered: a format that can be written, in a place that can be.
        format_of(first)
        checked_target(first)
        folder = first.parent
        if self.listed:
            manifest.read(folder)
        if not self.overwrite:
            self.kept += [number for number in frames if self.is_there(number)]
        there = set(self.kept)
        wanted = [number for number in frames if number not in there]
        if self.tidy:
            # What a killed run left under temporary names.
            remove_leftovers(folder)
        try:
            others = self._round(progress(wanted), claimed)
            # What others were making should be there by now, unless they were killed.
            self._round(others, awaited)
        finally:
            self.settle(folder, frames)
            if self.tidy:
                remove_leftovers(folder)

    def settle(self, folder: Path, frames: list[int]) -> None:
        """Bring what was done into the order of the frames, and list it."""
        order = {number: place for place, number in enumerate(frames)}
        for numbers in (self.written, self.kept, self.skipped):
            numbers.sort(key=order.__getitem__)
        if self.listed and (self.written or self.kept):
            done = {*self.written, *self.kept}
            paths = [(self.path_of(number), number) for number in frames if number in done]
            manifest.update(folder, manifest.completed(folder, self.entries, paths, self.mark))

    def _round(self, frames: Iterable[int], claiming: Callable[[Path], Claim | None]) -> list[int]:
        """Make the frames that can be claimed; return the others."""
        others = []
        with ThreadPoolExecutor(WRITERS) as writers:
            pending: list[Future[None]] = []
            for number in frames:
                claim = claiming(self.path_of(number))
                if claim is None:
                    others.append(number)
                    continue
                try:
                    frame = self._rendered(number)
                    while len(pending) >= WRITERS:
                        pending.pop(0).result()
                except BaseException:
                    claim.release()
                    raise
                if frame is None:
                    claim.release()
                else:
                    pending.append(writers.submit(self._save, number, frame, claim))
            for job in pending:
                job.result()
        return others

    def _rendered(self, number: int) -> Any:
        """Return a frame, or None if there is nothing to be done for it."""
        if not self.overwrite and self.is_there(number):
            # Made by another since we looked.
            self.kept.append(number)
            return None
        if self.skip and not self._readable(number):
            self.skipped.append(number)
            return None
        return self.content.render(self.scene, number)

    def _readable(self, number: int) -> bool:
        try:
            self.scene.look(number)
        except (OSError, ValueError):
            return False
        return True

    def _save(self, number: int, frame: Any, claim: Claim) -> None:
        from flurries import __version__

        path = self.path_of(number)
        metadata = {
            SCENE_KEY: self.mark,
            "frame": number,
            "version": __version__,
            "seed": self.scene.seed,
        }
        try:
            self.content.save(self.scene, path, frame, metadata)
            if self.listed:
                self.entries[path.name] = manifest.entry(path, number, self.mark)
            self.written.append(number)
        finally:
            claim.release()

    def is_there(self, number: int) -> bool:
        """Whether a frame is there and of this very scene; refuses one that is of another."""
        from flurries.io import read_header, read_picture

        path = self.path_of(number)
        if not path.exists():
            return False
        try:
            found = read_header(path).metadata
        except (OSError, ValueError):
            found = {}
        if (found.get(SCENE_KEY), found.get("frame")) == (self.mark, str(number)):
            try:
                read_picture(path)
            except (OSError, ValueError):
                # Ours, but damaged since: made again.
                return False
            return True
        raise ValueError(
            f"{path} is there already and is not frame {number} of this scene; "
            "choose another name, remove it, or overwrite"
        )
