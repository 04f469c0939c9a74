"""Frames in groups that are worth a task, and such groups as arrays: lazy ones, or in order."""

from __future__ import annotations

import math
import uuid
from typing import Any

import numpy as np

from flurries._contract import Array, integer
from flurries._threads import reproducible
from flurries.output.cluster import required
from flurries.output.crew import on_one_core
from flurries.scene.files import frames_of
from flurries.scene.rendering import Rendering
from flurries.scene.scene import Scene, expect_scene

__all__ = ["grouped", "to_dask"]

# Pixels of layers in a task: of most weather half a second's work. A scheduler takes 2 to 10 ms for
# a task, below 2 % of it.
PIXELS_OF_A_TASK = 1 << 23

# Frames that a task may give back as arrays, in bytes.
_MOST_BYTES = 1 << 28


def grouped(scene: Scene, frames: Any) -> list[list[int]]:
    """Return frames in groups of half a second's work or so each, by their pixels."""
    scene = expect_scene(scene)
    wanted = frames_of(scene, frames)
    pixels = scene._shape[0] * scene._shape[1] * max(len(scene.effects), 1)
    size = math.ceil(PIXELS_OF_A_TASK / pixels)
    return [wanted[first : first + size] for first in range(0, len(wanted), size)]


def to_dask(scene: Rendering, frames: Any = None, *, group: int | None = None) -> Any:
    """Return the frames of a scene as a lazy array, see :meth:`flurries.Scene.to_dask`."""
    dask = required("dask")
    array = required("dask.array")
    scene = expect_scene(scene)
    wanted = frames_of(scene, frames)
    height, width = scene._shape
    # The background decides.
    dtype = scene.replace(effects=()).render(wanted[0], region=np.s_[:1, :1]).dtype
    if group is None:
        most = max(_MOST_BYTES // (height * width * 3 * dtype.itemsize), 1)
        size = min(len(grouped(scene, wanted)[0]), most)
    else:
        size = int(integer("group", group, low=1, high=2**31))
    # Files that the scene reads may change: what one array has found is not another's.
    name, plain = uuid.uuid4().hex, reproducible()
    # One node of the graph, not a copy in each of its tasks.
    shared = dask.delayed(scene, name=f"scene-{name}", pure=True, traverse=False)
    block = dask.delayed(_block, pure=True)
    parts = []
    for first in range(0, len(wanted), size):
        numbers = wanted[first : first + size]
        part = block(shared, plain, numbers, dask_key_name=f"frames-{name}-{first}")
        parts.append(array.from_delayed(part, (len(numbers), height, width, 3), dtype=dtype))
    return array.concatenate(parts, axis=0)


def _block(scene: Scene, plain: bool, numbers: list[int]) -> Array:
    with on_one_core(plain):
        return np.stack([scene.render(number) for number in numbers])
