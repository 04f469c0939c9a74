"""The flakes of a frame that are drawn one by one, as an array."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries.effects.drawn import FLAKE, drawn_of
from flurries.scene.scene import Scene, expect_scene


def flakes(scene: Scene, t: float = 0.0) -> npt.NDArray[Any]:
    """Return the flakes and drops of a frame that are drawn one by one.

    Parameters
    ----------
    scene : Scene
    t : float
        Frame number.

    Returns
    -------
    (n,) structured array
        ``id`` (uint64, below 2^53): the same in every frame, eye, crop and size of the picture, and
        that of EXR files and USD points. ``place`` (3,): metres, x right, y down, z ahead, from the
        camera's place at frame 0. ``pixel`` (x, y), of the middle of the exposure; a flake of which
        only a part reaches into the picture lies outside. ``depth``: metres. ``diameter``: metres.
        ``opacity``: mean over the disc of the resting flake, fading included.

    Examples
    --------
    >>> import flurries as fl
    >>> scene = fl.Scene(size=(320, 180), effects=[fl.Snow()])
    >>> flakes = fl.flakes(scene, 3)
    >>> bool((flakes["depth"] > 0.3).all())
    True
    """
    expect_scene(scene)
    program, time = scene._program, scene._time_of(t)
    frame = program.frame(time)
    found = [drawn_of(part.effect, replace(frame, seed=part.seed)) for part in program.parts]
    known = [one for one in found if one is not None]
    return np.concatenate(known) if known else np.empty(0, FLAKE)
