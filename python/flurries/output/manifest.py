"""What a folder of files holds: ``flurries.json``, with a hash of every file."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from flurries import __version__
from flurries.io import read_header, read_picture, replacing
from flurries.io.files import read_text
from flurries.io.pictures.seal import is_broken
from flurries.output.claims import awaited
from flurries.scene.fingerprint import hash_of

__all__ = ["NAME", "check", "read"]

NAME = "flurries.json"

MOST_BYTES = 1 << 28

# How every one of ours begins, by which one that is cut short is known.
_HEAD = '{\n "flurries": "'


def read(folder: str | os.PathLike[str]) -> dict[str, dict[str, Any]]:
    """Return the entries of a folder's manifest by the names of the files.

    Returns
    -------
    dict of str to dict
        ``frame``, ``scene`` and what else the file's own header says, ``bytes`` and ``sha256`` of
        each file. None of them where there is no manifest. Where one of ours is empty or cut short,
        what the frames in the folder say of themselves.

    Raises
    ------
    ValueError
        If ``flurries.json`` is something else.
    OSError
        If it cannot be read, or is no plain file.

    Warns
    -----
    UserWarning
        If the manifest is empty or cut short.
    """
    path = Path(folder) / NAME
    try:
        text = read_text(path, MOST_BYTES, "manifest")
    except FileNotFoundError:
        return {}
    found = parse(text, path)
    return entries_of(sorted(Path(folder).iterdir())) if found is None else found


def parse(text: str, path: Path | str) -> dict[str, dict[str, Any]] | None:
    """Return the entries in a manifest's text; None, with a warning, where it is cut short.

    Raises
    ------
    ValueError
        If it is something else.
    """
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


def update(folder: Path, entries: dict[str, dict[str, Any]]) -> None:
    """Add entries to a folder's manifest; safe beside other processes that do so too."""
    target = folder / NAME
    claim = awaited(target)
    try:
        text = text_of({**read(folder), **entries})
        with replacing(target) as temporary:
            temporary.write_text(text, encoding="utf-8")
    finally:
        claim.release()


def text_of(entries: dict[str, dict[str, Any]]) -> str:
    """Return the text of a manifest: the same whatever order entries came in."""
    ordered = {name: dict(sorted(said.items())) for name, said in sorted(entries.items())}
    return json.dumps({"flurries": __version__, "files": ordered}, indent=1) + "\n"


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

    def told(name: str) -> str | None:
        path = place / name
        inside = path.resolve().is_relative_to(place.resolve())
        return hash_of(path) if inside and path.is_file() else None

    return differences(read(place), place, told)


def differences(
    entries: dict[str, dict[str, Any]], place: Path | str, told: Callable[[str], str | None]
) -> list[str]:
    """Return a sentence for each file that is not what its entry says; `told` gives hashes."""
    wrong = []
    for name, said in entries.items():
        found = told(name)
        if found is None:
            wrong.append(f"{place}/{name} is missing")
        elif found != said.get("sha256"):
            wrong.append(f"{place}/{name} has changed")
    return wrong
