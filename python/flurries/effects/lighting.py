"""Layers whose color differs over the frame: by the plate's light, by place."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64
from flurries._kept import kept
from flurries.frame.layer import Layer, Shade
from flurries.frame.view import Frame
from flurries.io.color import srgb_to_linear
from flurries.light.lamp import radiance
from flurries.light.phase import Optics
from flurries.light.plate import PlateLight


def even_shade(frame: Frame, color: tuple[float, float, float]) -> Shade:
    """Return one color, display values, for the whole frame."""
    light = srgb_to_linear(np.asarray(color, np.float64)).reshape(1, 1, 3)
    return Shade(light.astype(np.float32), 1.0, (frame.window[0], frame.window[2]))


def veil_layer(
    name: str, frame: Frame, alpha: Array | float, color: tuple[float, float, float] | None
) -> Layer:
    """Return fog of a color, or without one as bright as what it hides, or brighter."""
    cover = np.ascontiguousarray(np.broadcast_to(np.asarray(alpha, np.float32), frame.size))
    if color is not None:
        return Layer(name, cover, color)
    return Layer(name, cover, shade=local_shade(frame, None))


def local_shade(frame: Frame, optics: Optics | None) -> Shade:
    """Return the color that the plate's light gives to particles, or to fog, by places."""
    assert frame.plate is not None
    colors = _colors(frame.plate, frame.camera.focal, optics)
    return Shade(colors, frame.plate.cell, (frame.window[0], frame.window[2]))


# A clear sun by day lights what lies across its rays some two times as much as the sky does.
SUN = 2.0


class Base(NamedTuple):
    """The brightness of a gas, linear light."""

    dim: Float64  # (3,): in the light from all sides.
    sunny: Float64  # (3,): where a white sun lights it in full.

    @staticmethod
    def even(color: tuple[float, float, float]) -> Base:
        """Return the shades of gas of a color, display values."""
        light = srgb_to_linear(np.asarray(color, np.float64))
        return Base(light, light)

    @staticmethod
    def airlight(plate: PlateLight) -> Base:
        """Return the shades of white gas in a plate's light: as bright as its sky, one color."""
        grey = np.full(3, SUN * plate.sky.mean())
        return Base(plate.sky, grey)


@kept(16)
def _colors(plate: PlateLight, focal: float, optics: Optics | None) -> Array:
    """Return the plate's light on particles, or on fog."""
    if optics is None:
        return plate.veil(focal).astype(np.float32)
    return plate.local(focal, asymmetry=optics.asymmetry, albedo=optics.albedo).astype(np.float32)


# Cells along the longer side of a frame in which the light of lamps on the texture is found.
CELLS = 48


def lamp_shade(
    frame: Frame, depths: npt.ArrayLike, weights: npt.ArrayLike, optics: Optics
) -> Shade:
    """Return the light of lamps on flakes at depths, each weighed by what its layer covers."""
    height, width = frame.shape
    cell = float(max(math.ceil(max(height, width) / CELLS), 1))
    rows, columns = math.ceil(height / cell), math.ceil(width / cell)
    (cx, cy), (fx, fy) = frame.camera.principal(frame.shape), frame.camera.focals
    x = ((np.arange(columns) + 0.5) * cell - cx) / fx
    y = ((np.arange(rows) + 0.5) * cell - cy) / fy
    across, down = np.meshgrid(x, y)
    ahead = np.stack([across, down, np.ones_like(across)], axis=-1).reshape(-1, 3)
    eye = np.array(frame.camera.offset)
    points = np.asarray(depths).reshape(-1, 1, 1) * ahead + eye
    found = radiance(points.reshape(-1, 3), frame.lamps(), optics, eye).reshape(points.shape)
    shares = np.asarray(weights) / np.sum(weights)
    total = (shares[:, None, None] * found).sum(axis=0)
    colors = total.reshape(rows, columns, 3).astype(np.float32)
    return Shade(colors, cell, (frame.window[0], frame.window[2]))


def add_light(glow: Array, alpha: Array, shade: Shade) -> None:
    """Add the light of a layer of an opacity to what there is, (h, w, 3)."""
    _core.shade_add(glow, np.ascontiguousarray(alpha), shade.given())
