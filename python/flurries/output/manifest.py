"""What a folder of frames holds: ``flurries.json``, with a hash of every file."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from flurries.io.atomic import replacing
from flurries.io.files import read_text

__all__ = ["NAME", "check", "read"]

NAME = "flurries.json"

_MOST_BYTES = 1 << 28
_BLOCK = 1 << 20


def read(folder: str | os.PathLike[str]) -> dict[str, dict[str, Any]]:
    """Return the entries of a folder's manifest by the names of the files.

    Returns
    -------
    dict of str to dict
        ``frame``, ``scene`` (the scene's mark, as in the file's own header), ``bytes`` and
        ``sha256`` of each file. None of them where there is no manifest, or a damaged one of ours.

    Raises
    ------
    ValueError
        If ``flurries.json`` is something else.
    OSError
        If it cannot be read.
    """
    path = Path(folder) / NAME
    try:
        text = read_text(path, _MOST_BYTES, "manifest")
    except FileNotFoundError:
        return {}
    try:
        found = json.loads(text)
    except (json.JSONDecodeError, RecursionError):
        raise ValueError(f"{path} is there already and is no manifest; move it away") from None
    if not isinstance(found, dict) or not isinstance(found.get("flurries"), str):
        raise ValueError(f"{path} is there already and is no manifest; move it away")
    files = found.get("files")
    if not isinstance(files, dict) or not all(isinstance(entry, dict) for entry in files.values()):
        return {}
    return files


def entry(path: Path, frame: int, scene: str) -> dict[str, Any]:
    """Return what a manifest says of a file."""
    digest = hashlib.sha256()
    size = 0
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
            size += len(block)
    return {"frame": frame, "scene": scene, "bytes": size, "sha256": digest.hexdigest()}


def update(folder: Path, entries: dict[str, dict[str, Any]]) -> None:
    """Add entries to a folder's manifest; safe beside other processes that do so too."""
    from flurries import __version__
    from flurries.output.claims import awaited

    target = folder / NAME
    claim = awaited(target)
    try:
        files = {**read(folder), **entries}
        text = json.dumps({"flurries": __version__, "files": dict(sorted(files.items()))}, indent=1)
        with replacing(target) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")
    finally:
        claim.release()


def completed(
    folder: Path, known: dict[str, dict[str, Any]], paths: Iterable[tuple[Path, int]], scene: str
) -> dict[str, dict[str, Any]]:
    """Return entries for all files, hashing those that nobody has hashed yet."""
    before = read(folder)
    found = {}
    for path, frame in paths:
        old = known.get(path.name) or before.get(path.name)
        same = old is not None and (old.get("scene"), old.get("frame")) == (scene, frame)
        if old is None or not same or old.get("bytes") != path.stat().st_size:
            old = entry(path, frame, scene)
        found[path.name] = old
    return found


def check(folder: str | os.PathLike[str]) -> list[str]:
    """Compare the files of a folder with its manifest.

    Returns
    -------
    list of str
        One sentence for each file that is missing or has changed; none if all is well.

    Raises
    ------
    FileNotFoundError
        If the folder has no manifest.
    ValueError, OSError
        If ``flurries.json`` is none, or something cannot be read.
    """
    place = Path(folder)
    if not (place / NAME).exists():
        raise FileNotFoundError(f"{place / NAME}: no manifest is there")
    wrong = []
    for name, said in read(place).items():
        path = place / name
        if Path(name).name != name or not path.is_file():
            wrong.append(f"{path} is missing")
        elif entry(path, said.get("frame", 0), "")["sha256"] != said.get("sha256"):
            wrong.append(f"{path} has changed")
    return wrong
