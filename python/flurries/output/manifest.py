"""What a file says of how it was made, and a folder of its files in ``flurries.json``."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from flurries import __version__
from flurries.io import read_header, read_picture
from flurries.io.files import read_text
from flurries.io.layers.deep import read_deep, read_deep_header
from flurries.io.pictures.metadata import is_broken
from flurries.scene.fingerprint import BITS, hash_of

NAME = "flurries.json"

MOST_BYTES = 1 << 28

# How every one of ours begins, by which one that is cut short is known.
_HEAD = '{\n "flurries": "'


def read(folder: str | os.PathLike[str]) -> dict[str, dict[str, Any]]:
    """Return the entries of a folder's manifest by the names of the files."""
    path = Path(folder) / NAME
    try:
        text = read_text(path, MOST_BYTES, "manifest")
    except FileNotFoundError:
        return {}
    found = parse(text, path)
    return entries_of(sorted(Path(folder).iterdir())) if found is None else found


def parse(text: str, path: Path | str) -> dict[str, dict[str, Any]] | None:
    """Return the entries in a manifest's text; None, with a warning, where it is cut short."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        if not (text.startswith(_HEAD) or _HEAD.startswith(text.rstrip("\0"))):
            raise _Foreign(path) from None
        warnings.warn(f"{path} is empty or cut short; made again from the frames", stacklevel=3)
        return None
    if not isinstance(found, dict) or not isinstance(found.get("flurries"), str):
        raise _Foreign(path)
    files = found.get("files")
    if not isinstance(files, dict) or not all(isinstance(entry, dict) for entry in files.values()):
        return {}
    return files


class _Foreign(ValueError):
    def __init__(self, path: Path | str) -> None:
        super().__init__(f"{path} is there already and is no manifest; move it away")


def entries_of(paths: Iterable[Path]) -> dict[str, dict[str, Any]]:
    """Return the entries of all whole frames among files, by what their headers say."""
    entries = {}
    for path in paths:
        if path.name.startswith(".") or not path.is_file():
            continue
        said = _header(path, deep=False) or {}
        if {"scene", "frame"} <= set(said) and _decodes(path, read_picture):
            entries[path.name] = entry(path, said)
    return entries


def entry(path: Path, said: dict[str, Any]) -> dict[str, Any]:
    """Return a manifest's entry of a file: the mark in its header, its size and its hash."""
    said = {key: value for key, value in said.items() if key not in ("DateTime", "version", "seed")}
    numbers = {key: int(said[key]) for key in ("frame", "bits") if str(said.get(key)).isdigit()}
    return {**said, **numbers, "bytes": path.stat().st_size, "sha256": hash_of(path)}


def text_of(entries: dict[str, dict[str, Any]]) -> str:
    """Return the text of a manifest: the same whatever order entries came in."""
    ordered = {name: dict(sorted(said.items())) for name, said in sorted(entries.items())}
    return json.dumps({"flurries": __version__, "files": ordered}, indent=1) + "\n"


# Where a header that cannot be read any more is looked for in the file's bytes.
_FIRST_BYTES = 1 << 20


class Refused(ValueError):
    """A file that is in the way and that is not to be replaced unasked."""

    def __init__(self, path: Path | str, why: str) -> None:
        super().__init__(
            f"{path} is there already and {why}; overwrite=True (--overwrite) replaces it"
        )


@dataclass(frozen=True)
class Mark:
    """The note in a file of how it was made."""

    scene: str  # What tells its kind from others': the scene, what is in a file, the mode.
    frame: int  # Which of them it is.
    inputs: str = ""
    names: str = ""  # Hashes of what the files that it was made of hold, and are called.
    bits: int = BITS  # See :data:`flurries.scene.fingerprint.BITS`.

    @property
    def header(self) -> dict[str, Any]:
        """The entries of a file's header and of the manifest."""
        return {key: value for key, value in asdict(self).items() if value != ""}

    def is_of(self, said: Mapping[str, Any]) -> bool:
        """Whether a header or an entry says the very same."""
        return all(str(said.get(key, "")) == str(value) for key, value in asdict(self).items())

    def settled(
        self, path: Path, said: Mapping[str, Any] | None, name: Path | str | None = None
    ) -> dict[str, Any] | None:
        """Return the manifest's entry of a file that is there and right."""
        if not path.exists():
            return None
        listed = said is not None and self.is_of(said)
        if listed and said is not None:
            if hash_of(path) == said.get("sha256"):
                return dict(said)
            if path.stat().st_size == said.get("bytes"):
                # Not one byte longer or shorter than what was written: damaged, not replaced.
                return None
        deep = "-deep" in self.scene
        found = _header(path, deep=deep)
        if found is None:
            # What has no header any more is ours if the list or its own bytes say so.
            if listed or self.scene.encode() in _first_bytes(path):
                return None
            raise Refused(name or path, "cannot be read as a picture")
        if (found.get("scene"), found.get("frame")) != (self.scene, str(self.frame)):
            raise Refused(name or path, "is something else")
        if found.get("bits") != str(self.bits):
            version = found.get("version", "an unknown version")
            said_by = f"was made by flurries {version}, whose frames have other bits"
            raise Refused(name or path, said_by)
        if not self.is_of(found):
            if found.get("names", "") == self.names:
                return None
            raise Refused(name or path, "was made over another background")
        if listed or not _decodes(path, read_deep if deep else read_picture):
            return None
        return entry(path, self.header)


def _header(path: Path, *, deep: bool) -> dict[str, str] | None:
    try:
        return read_deep_header(path) if deep else read_header(path).metadata
    except (OSError, ValueError):
        return None


def _first_bytes(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_FIRST_BYTES)
    except OSError:
        return b""


def _decodes(path: Path, read: Callable[[Path], object]) -> bool:
    try:
        read(path)
        return not is_broken(path)
    except (OSError, ValueError):
        return False
