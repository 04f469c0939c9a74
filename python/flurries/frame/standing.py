"""What is found of a scene's depth that stays: once for all frames."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

from flurries._contract import Array
from flurries._threads import reproducible
from flurries.frame.view import Frame

_Made = TypeVar("_Made")

# Results that are kept of one depth: planes of a picture, most of them.
_MOST = 8

_KEPT: dict[int, tuple[weakref.ref[Array], dict[Any, Any]]] = {}


def standing(
    frame: Frame, owner: object, name: str, key: Hashable, make: Callable[[], _Made]
) -> _Made:
    """Return what `make` makes of the frame's depth over its window; if that stays, once."""
    # Made of the depth, the window, `owner` and `key`. Nothing may be written to it afterwards. A
    # frame in bands finds it anew: it would be as large as many of its bands.
    depth = frame.depth
    assert depth is not None
    if frame.banded or depth.flags.writeable:
        return frame.here(owner, name, make)
    number = id(depth)
    there = _KEPT.get(number)
    if there is None or there[0]() is not depth:
        there = _KEPT[number] = weakref.ref(depth, lambda _: _KEPT.pop(number, None)), {}
    kept, place = there[1], (owner, name, key, frame.window, reproducible())
    if place not in kept:
        if len(kept) >= _MOST:
            # The oldest; another thread may have taken it.
            kept.pop(next(iter(kept), None), None)
        kept[place] = make()
    made: _Made = kept[place]
    return made
