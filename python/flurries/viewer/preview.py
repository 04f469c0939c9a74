"""A scene at the size of a preview: the same view, the same weather, fewer pixels."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from flurries._contract import integer
from flurries.io import fit, fit_nearest
from flurries.scene.depth import DepthMap
from flurries.scene.foreground import Foreground
from flurries.scene.scene import Scene

# Of an effect, what is counted in pixels of the picture, with the least that makes sense.
_SCALED = {"tile": 8, "overlap": 0}


class Preview:
    """A scene made small once, to be shown with changing effects and cameras."""

    def __init__(self, scene: Scene, most: int) -> None:
        limit = integer("size", most, low=16, high=4096)
        height, width = scene._shape
        self.scale = min(limit / max(height, width), 1.0)
        self.scene = scene
        if self.scale < 1.0:
            size = (max(round(width * self.scale), 1), max(round(height * self.scale), 1))
            self.scene = scene.replace(
                size=size,
                background=_small(scene.background, size),
                foreground=_small(scene.foreground, size),
                depth=_small(scene.depth, size),
                camera=scene.camera.resize(self.scale),
            )

    @cached_property
    def flat(self) -> Scene:
        """The small scene without its depth."""
        return self.scene.replace(depth=None)

    def shown(self, changes: Mapping[str, Any]) -> Scene:
        """Return the small scene with what was touched, which is given for the large one."""
        # Not `replace`, which would open and fit the background's file for every picture.
        rest = dict(changes)
        base = self.flat if rest.pop("depth", self.scene.depth) is None else self.scene
        if self.scale < 1.0:
            rest["camera"] = rest["camera"].resize(self.scale)
            rest["effects"] = tuple(scaled(effect, self.scale) for effect in rest["effects"])
        return base._derive(**rest)


def scaled(effect: Any, scale: float) -> Any:
    """Return an effect for a picture `scale` times as large."""
    changes: dict[str, Any] = {}
    if getattr(effect, "wavelengths", None) is not None:
        shortest, longest = (scale * length for length in effect.wavelengths)
        shortest = max(shortest, 2.0)
        changes["wavelengths"] = (shortest, max(longest, 1.25 * shortest))
    for name, least in _SCALED.items():
        value = getattr(effect, name, None)
        if isinstance(value, int):
            changes[name] = max(round(scale * value), least)
    return replace(effect, **changes) if changes else effect


def _small(value: Any, size: tuple[int, int]) -> Any:
    """Return arrays at a size: a picture filtered, a matte or a depth by its nearest pixels."""
    if isinstance(value, DepthMap) and isinstance(value.source, np.ndarray):
        law = {key: getattr(value, key) for key in ("near", "far", "white", "law")}
        return DepthMap(fit_nearest(value.source, size), **law)
    if isinstance(value, Foreground):
        return Foreground(_small(value.source, size), _small(value.depth, size))
    if isinstance(value, (list, tuple)):
        return type(value)(_small(one, size) for one in value)
    if not isinstance(value, np.ndarray):
        return value
    return fit_nearest(value, size) if value.ndim == 2 else fit(value, size, "stretch")
