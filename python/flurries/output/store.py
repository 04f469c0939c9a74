"""Whether the files of a folder or a url are what their journal says."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from flurries.io.stores import store_of
from flurries.output.journal import NAME, Journal

__all__ = ["check"]


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
        good = store.held(path, found.lines(name))
        if not good:
            wrong.append(f"{here}/{name} has changed")
        made |= {line.get("bits"): line.get("version") for line in good}
    if len(made) > 1:
        versions = " and ".join(sorted(map(str, made.values())))
        wrong.append(f"{here} has frames of flurries {versions}, which differ in their bits")
    return len(found.names()), wrong
