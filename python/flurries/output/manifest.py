"""What a folder of files holds: ``flurries.json``, with a hash of every file."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from flurries import __version__
from flurries.io import read_header, read_picture
from flurries.io.files import read_text
from flurries.io.pictures.metadata import is_broken
from flurries.scene.fingerprint import hash_of

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
        try:
            said = read_header(path).metadata
            if not {"scene", "frame"} <= set(said):
                continue
            read_picture(path)
            if is_broken(path):
                continue
        except (OSError, ValueError):
            continue
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
