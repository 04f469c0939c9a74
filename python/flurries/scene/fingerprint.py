"""What tells the frames of two scenes apart."""

from __future__ import annotations

import hashlib
import os
import pickle
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np

from flurries.effects.kinds import kind_of
from flurries.io import Pattern
from flurries.scene.depth import DepthMap
from flurries.scene.scene import Scene, expect_scene
from flurries.scene.toml.writer import describe

__all__ = ["fingerprint"]

# How much of a large file each end gives to its hash.
ENDS = 1 << 20


def fingerprint(scene: Scene) -> str:
    """Return a hash of all that a scene's frames depend on, files' contents included.

    Of a file larger than 2 MiB the size and both ends count: plates of film need not be read.
    """
    expect_scene(scene)
    digest = hashlib.sha256()
    hashed: list[str] = []
    for name in ("background", "foreground", "depth"):
        value = getattr(scene, name)
        value = getattr(value, "source" if isinstance(value, DepthMap) else "spec", value)
        if isinstance(value, np.ndarray):
            digest.update(f"{name} {value.shape} {value.dtype}".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, (str, os.PathLike)) and not str(value).startswith("#"):
            digest.update(name.encode())
            for file in _files(os.fspath(value)):
                digest.update(_content(file))
        else:
            continue
        hashed.append(name)
    for place, effect in enumerate(scene.effects):
        if kind_of(effect) is None:
            # Somebody's own, which no scene file can hold but frames can be made of. Its fields: an
            # effect may keep what it made of them.
            whole = not is_dataclass(effect)
            own = effect if whole else [getattr(effect, f.name) for f in fields(effect)]
            digest.update(f"effect {place}".encode() + pickle.dumps((type(effect), own), 5))
    table = describe(scene, leave_out=(*hashed, "effects"))
    digest.update(repr(sorted(table.items())).encode())
    return digest.hexdigest()[:16]


def _files(spec: str) -> list[Path]:
    """Return the files of a picture, a film or a sequence's pattern."""
    if Path(spec).is_file():
        return [Path(spec)]
    pattern = Pattern(spec)
    return [pattern.path(number) for number in pattern.existing()]


def _content(path: Path) -> bytes:
    """Return a hash of a file: all of it, or its size and both ends."""
    size = path.stat().st_size
    digest = hashlib.sha256(str(size).encode())
    with path.open("rb") as file:
        digest.update(file.read(ENDS))
        if size > ENDS:
            file.seek(max(size - ENDS, ENDS))
            digest.update(file.read(ENDS))
    return digest.digest()
