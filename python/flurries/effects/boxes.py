"""The boxes that hold the flakes of a population: how many, where, how they move and are seen."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Float64
from flurries.camera.path import CameraPath
from flurries.camera.rotation import rotation_matrix
from flurries.effects.drawing import (
    MOST_IN_BOX,
    gust_room,
    lens_of,
    sight_of,
    triple,
)
from flurries.effects.motion import Motion
from flurries.effects.weather import FAR_FADE, HEIGHTS, NEAR_FADE, Film, Share, Weather
from flurries.frame.view import Frame
from flurries.motion.keys import value_at
from flurries.particles.crowd import Box, Closeup, Crowd, Triple

# What a class adds to the seed: boxes of one population must not be copies of each other.
_CLASS = 0x632BE59BD9B4E019
_BEYOND = 0x2545F4914F6CDD1D

# The widest angle between the axis and what a lens that turns may see of a box is in its ball.
_MARGIN = 0.3

# Sigma of a flake's image in px between which it gets a shape: below, no shape can be told.
SWITCH = (2.5, 3.5)


class Room(NamedTuple):
    """The box that holds what a film sees up to a depth.

    Attributes
    ----------
    sides : (3,)
        Metres; of a camera that turns a cube.
    middle : float
        Distance of its centre ahead, metres.
    """

    sides: tuple[float, float, float]
    middle: float


def crowd_of(weather: Weather, frame: Frame, amount: float, *, beyond: bool = False) -> Crowd:
    """Return the flakes before the frame's camera; `beyond` those behind the near ones."""
    path, camera = frame.path, frame.camera
    film = weather.film(frame)
    exposure = value_at(weather.motion.shutter, frame.t)
    stretch = np.diag([1.0, camera.aspect, 1.0])
    axes = camera.matrix()
    turn = stretch @ (axes.T if path.turns else np.eye(3))
    spin, zoom = frame.spin(), path.zoom(frame.t)[1]
    spread = -np.array(
        [[0.0, -spin[2], spin[1]], [spin[2], 0.0, -spin[0]], [-spin[1], spin[0], 0.0]]
    ) + zoom * np.diag([1.0, 1.0, 0.0])
    spread = exposure * stretch @ spread @ np.linalg.inv(stretch)
    deepest = weather.far * (1.0 + FAR_FADE) if beyond else max(s.end for s in film.shares)
    down = np.array([0.0, 1.0, 0.0])
    boxes = []
    most = 0.0
    for index, share in enumerate(film.shares):
        box, travel = _box(weather, frame, film, share, index, amount, exposure, stretch, beyond)
        if box is not None:
            boxes.append(box)
            most = max(most, travel)
    most += float(np.abs(spread).sum()) * deepest
    waves = None if weather.motion.varied is None else weather.motion.varied.waves
    blur = frame.blur
    if blur is not None:
        # As far as a flake out of focus reaches, at its own depth.
        near = max(weather.near, 1e-3)
        widest = max(depth * blur.circle(depth) for depth in (near, deepest))
        most += 0.75 * widest / frame.camera.focal
    room = most if waves is None else most + 3.0 * waves.spread()
    return Crowd(
        boxes=boxes,
        opacity=weather.population.opacity,
        turn=_rows3(turn),
        spread=_rows3(spread),
        down=triple(down if path.turns else down @ axes),
        heights=(-deepest, deepest),
        room=room,
        lens=lens_of(camera, frame.shape),
        window=frame.window,
        closeup=None if beyond else closeup_of(weather, frame),
    )


def _box(
    weather: Weather,
    frame: Frame,
    film: Film,
    share: Share,
    index: int,
    amount: float,
    exposure: float,
    stretch: Float64,
    beyond: bool,
) -> tuple[Box | None, float]:
    path = frame.path
    all_drawn = share.reach >= weather.far
    last = (weather.far * (1.0 - FAR_FADE), weather.far * (1.0 + FAR_FADE))
    near = (weather.near, weather.near * NEAR_FADE)
    if beyond:
        if all_drawn:
            return None, 0.0
        shown = (share.end, share.end, *last)
    elif all_drawn:
        shown = (*near, *last)
    elif weather.simulated:
        shown = (*near, share.end, share.end)
    else:
        shown = (*near, share.reach, share.end)
    room = room_of(weather, frame.shape, path, shown[3])
    volume = math.prod(room.sides)
    wanted = share.size.density * volume
    count = max(math.ceil(wanted), 1)
    if count > MOST_IN_BOX:
        raise ValueError(
            f"density: {weather.population.density:g} per m3 are {count} in the box that holds "
            f"the view up to {shown[3]:.3g} m; at most {MOST_IN_BOX} are drawn"
        )
    moved, rate = path.relative(
        frame.t, fps=frame.fps, fall=share.motion.fall, wind=share.motion.mean_wind
    )
    axes = frame.camera.matrix()
    rotation = (0.0, 0.0, 0.0) if path.turns else frame.camera.rotation
    center = np.array([0.0, 0.0, room.middle])
    travel = -exposure * stretch @ (rate @ axes)
    heights = np.linspace(-shown[3], shown[3], HEIGHTS)
    if weather.steady:
        heights = heights[:1]
    amounts = weather.amounts(frame, share, amount, heights) * (wanted / count)
    seed = frame.seed ^ (_CLASS * (index + 1) & (2**63 - 1)) ^ (_BEYOND if beyond else 0)
    box = Box(
        number=count,
        sides=room.sides,
        center=triple(axes @ center if path.turns else center),
        seed=seed,
        way=triple(-moved if path.turns else -moved @ axes),
        order=_order(share.motion, path, frame.fps, rotation, room.sides),
        sway=(weather.sway[0], weather.sway[1] * frame.t / frame.fps),
        travel=triple(travel),
        sizes=(share.size.smallest, share.size.largest),
        slope=weather.population.sizes.slope,
        shown=shown,
        amounts=amounts.tolist(),
    )
    return box, float(np.linalg.norm(travel))


def closeup_of(weather: Weather, frame: Frame) -> Closeup | None:
    """Return the looks of flakes from near; None where all are sharp round dots."""
    blur = frame.blur
    if weather.shape == "round" and blur is None:
        return None
    seconds = frame.t / frame.fps
    return Closeup(weather.shape, SWITCH, blur, frame.seed, seconds)


@lru_cache(maxsize=256)
def room_of(weather: Weather, shape: tuple[int, int], path: CameraPath, depth: float) -> Room:
    """Return the box of what a film sees up to a depth: nothing of its walls is ever seen."""
    # With room for the distance of two eyes.
    across, down, ball = sight_of(path, shape, depth)
    room = gust_room(weather.motion)
    room += _MARGIN + weather.sway[0] + weather.population.sizes.largest
    if path.turns:
        side = 2.0 * (ball + room)
        return Room((side, side, side), min(ball, depth))
    return Room((across + 2.0 * room, down + 2.0 * room, depth), 0.5 * depth)


@lru_cache(maxsize=256)
def _order(
    motion: Motion, path: CameraPath, fps: float, rotation: Triple, sides: Triple
) -> tuple[int, int, int]:
    """Return the axes of a box, that which the air of frame 0 passes in the least time first."""
    _, rate = path.relative(0.0, fps=fps, fall=motion.fall, wind=motion.mean_wind)
    share = np.abs(rate @ rotation_matrix(rotation)) / sides
    first, second, third = sorted((1, 0, 2), key=lambda axis: -share[axis])
    return first, second, third


def _rows3(matrix: Float64) -> Any:
    return tuple(triple(row) for row in matrix)
