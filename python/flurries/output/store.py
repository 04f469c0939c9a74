"""The store that a path or a url names, and whether its files are what their journal says."""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from typing import Any

from flurries.output.bucket import Bucket
from flurries.output.folder import Store
from flurries.output.journal import NAME, Journal

__all__ = ["check"]


def store_of(place: str) -> tuple[Store, str]:
    """Return the store of a place, and the way in it."""
    if "://" not in place:
        return Store(), place
    if "::" in place:
        raise ValueError(f"{place}: name the store itself, without a layer over it")
    try:
        core: Any = importlib.import_module("fsspec.core")
    except ImportError as error:
        raise ImportError(f"urls need fsspec; install flurries[stores] ({error})") from error
    try:
        # Listings that are kept would hide what others write.
        system, key = core.url_to_fs(place, use_listings_cache=False)
    except (ValueError, ImportError) as error:
        raise type(error)(f"{place}: {error}") from error
    protocol = system.protocol if isinstance(system.protocol, str) else system.protocol[0]
    if protocol in ("file", "local"):
        return Store(), key
    if not Path(key).name:
        raise ValueError(f"{place} must name files in a bucket or a folder")
    return Bucket(system, protocol), key


def check(place: str | os.PathLike[str]) -> tuple[int, list[str]]:
    """Compare the files of a folder or url with its journal: their number, and what is wrong."""
    store, folder = store_of(os.fspath(place))
    found = Journal(store, Path(folder))
    if not found.names():
        raise FileNotFoundError(f"{place}: no journal ({NAME}) is there")
    made: dict[Any, Any] = {}
    wrong, here = [], str(place).rstrip("/")
    for name in found.names():
        # Whoever made the list cannot have other files looked at.
        path, inside = Path(folder) / name, not Path(name).is_absolute()
        if not inside or ".." in Path(name).parts or not store.exists(path):
            wrong.append(f"{here}/{name} is missing")
            continue
        good = [line for line in found.lines(name) if store.holds(path, line)]
        if not good:
            wrong.append(f"{here}/{name} has changed")
        made |= {line.get("bits"): line.get("version") for line in good}
    if len(made) > 1:
        versions = " and ".join(sorted(map(str, made.values())))
        wrong.append(f"{here} has frames of flurries {versions}, which differ in their bits")
    return len(found.names()), wrong
