"""What a scene's frames depend on, as hashes: its own values, and the files that it reads."""

from __future__ import annotations

import hashlib
import pickle
import socket
import time
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flurries.effects.kinds import kind_of
from flurries.io import Pattern
from flurries.scene.depth import DepthMap
from flurries.scene.foreground import listed
from flurries.scene.scene import Scene, expect_scene
from flurries.scene.toml.writer import describe

__all__ = ["BITS", "fingerprint"]

# Frames that two versions of flurries make go together only where this number is the same: it is
# raised with every change that alters a bit of a frame, in a kernel or in a look.
BITS = 32

# A file that changed less than this before it was hashed, in nanoseconds, may change again and
# keep its time: clocks of file systems tick that slowly.
_TICK = 2_000_000_000


def fingerprint(scene: Scene) -> str:
    """Return a hash of all that a scene's frames depend on, files' contents included."""
    digest = hashlib.sha256(settings(scene).encode())
    for name, spec in _specs(scene).items():
        digest.update(name.encode())
        for file in _files(spec):
            digest.update(hash_of(file).encode())
    return digest.hexdigest()[:16]


def settings(scene: Scene) -> str:
    """Return a hash of all that a scene's frames depend on but the files that it reads."""
    expect_scene(scene)
    digest = hashlib.sha256()
    given = list(_specs(scene))
    for name, value in _values(scene).items():
        value = value.source if isinstance(value, DepthMap) else value
        if isinstance(value, np.ndarray):
            digest.update(f"{name} {value.shape} {value.dtype}".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
            given.append(name)
    for place, effect in enumerate(scene.effects):
        if kind_of(effect) is None:
            # Somebody's own, which no scene file can hold but frames can be made of. Its fields: an
            # effect may keep what it made of them.
            whole = not is_dataclass(effect)
            own = effect if whole else [getattr(effect, f.name) for f in fields(effect)]
            digest.update(f"effect {place}".encode() + pickle.dumps((type(effect), own), 5))
    table = describe(scene, leave_out=(*given, "effects", "output"))
    digest.update(repr((sorted(given), sorted(table.items()))).encode())
    return digest.hexdigest()[:16]


def short_hash(value: object) -> str:
    """Return a hash of what a value's `repr` says."""
    return hashlib.sha256(repr(value).encode()).hexdigest()[:16]


def hash_of(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as file:
        digest = hashlib.sha256()
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


@dataclass
class Hashes:
    """Hashes of files, found again only where a file has changed since."""

    # Size, time of change and place on the disk say whether it has; a file that changed just before
    # it was hashed is hashed again.

    _known: dict[Path, tuple[tuple[int, ...], str]] = field(default_factory=dict)

    def __getitem__(self, path: Path) -> str:
        now = time.time_ns()
        found = path.stat()
        key = (found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino)
        known = self._known.get(path)
        if known is not None and known[0] == key:
            return known[1]
        told = hash_of(path)
        if now - max(found.st_mtime_ns, found.st_ctime_ns) > _TICK:
            self._known[path] = key, told
        return told


class Inputs:
    """The files that a scene's frames are made of."""

    # What serves all frames, a still or a film, is hashed once, and must stay as it is until the
    # last frame is made, on whatever machine. Of a sequence each frame has its own file.

    def __init__(self, scene: Scene) -> None:
        specs = _specs(scene)
        self._hashes = Hashes()
        self._sequences: list[Any] = []
        self._stills: dict[Path, str] = {}
        for name, spec in specs.items():
            files = scene._files.get(name)
            # A frame of a background that holds may be that of any file.
            holds = files is not None and getattr(files.source, "damaged", "stop") == "hold"
            if files is None or Path(spec).is_file() or holds:
                self._stills.update((file, self._told(file)) for file in _files(spec))
            else:
                self._sequences.append(files)

    def of(self, number: int) -> str:
        """Return a hash of a frame's inputs; OSError if a file that serves all has changed."""
        for file, before in self._stills.items():
            now = self._told(file)
            if now == "missing":
                raise FileNotFoundError(2, f"Is not on {socket.gethostname()}", str(file))
            if now != before:
                raise OSError(
                    f"{file} changed while frames were made of it; run again with overwrite=True "
                    "(--overwrite)"
                )
        told = [*self._stills.values()]
        told += [self._told(source.file(number)) for source in self._sequences]
        return short_hash(told) if told else ""

    def _told(self, file: Path) -> str:
        return self._hashes[file] if file.exists() else "missing"


def _values(scene: Scene) -> dict[str, Any]:
    """Return the values that may be files or arrays, by their names in `Scene.files`."""
    found = {"background": scene.background, "depth": scene.depth}
    mattes = [] if scene.foreground is None else listed(scene.foreground)
    for number, matte in enumerate(mattes, 1):
        name = "foreground" if number == 1 else f"foreground{number}"
        found |= {name: matte.source, f"{name} depth": matte.depth}
    return found


def _specs(scene: Scene) -> dict[str, str]:
    """Return the files that a scene reads, by the argument that names them."""
    found = {name: files.source for name, files in scene._files.items()}
    return {
        name: str(Path(source.spec).absolute())
        for name, source in found.items()
        if hasattr(source, "spec")
    }


def _files(spec: str) -> list[Path]:
    """Return the files of a picture, a film or a sequence's pattern."""
    if Path(spec).is_file():
        return [Path(spec)]
    pattern = Pattern(spec)
    return [pattern.path(number) for number in pattern.existing()]
