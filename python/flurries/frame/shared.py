"""What the two eyes and the bands of rows of one frame have in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from flurries.camera.lens import Camera

_Made = TypeVar("_Made")
_Key = tuple[int, int, str]


class Shared:
    """The objects that eyes and bands of rows of one frame share while they are made."""

    # `cameras` are the eyes as they are at the frame's time, `window` that of all bands together.

    def __init__(
        self, cameras: tuple[Camera, ...], window: tuple[int, int, int, int], bands: int = 1
    ) -> None:
        self.cameras, self.window, self.bands = cameras, window, bands
        # With the owner, which must not go while its id is known.
        self._known: dict[_Key, tuple[object, Any]] = {}
        self._here: dict[_Key, tuple[object, Any]] = {}
        self._at = window

    def once(self, key: _Key, owner: object, make: Callable[[], _Made]) -> _Made:
        """Return the object of this effect, seed and name, made by `make` the first time."""
        if key not in self._known:
            self._known[key] = owner, make()
        made: _Made = self._known[key][1]
        return made

    def here(
        self,
        key: _Key,
        owner: object,
        window: tuple[int, int, int, int],
        make: Callable[[], _Made],
    ) -> _Made:
        """Return the same for a window; it is kept for the other eye, until the next window."""
        if len(self.cameras) == 1:
            return make()
        if window != self._at:
            self._here, self._at = {}, window
        if key not in self._here:
            self._here[key] = owner, make()
        made: _Made = self._here[key][1]
        return made
