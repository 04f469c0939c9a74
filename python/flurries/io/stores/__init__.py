"""Where files are kept: the store that a path or a url names."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from flurries.io.stores.bucket import Bucket as Bucket
from flurries.io.stores.folder import Store as Store


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
