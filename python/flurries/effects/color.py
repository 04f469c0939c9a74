"""The color of an effect: display values, or the light of the background and of lamps."""

import math
from dataclasses import replace
from typing import Any, Literal, NamedTuple, NewType, TypeAlias

import numpy as np

from flurries._contract import Array, ArrayLike, Float64, suggestion
from flurries._kept import kept
from flurries.camera.lens import Camera
from flurries.effects.motion import rays_at
from flurries.frame.layer import Shade
from flurries.frame.needs import PARTS
from flurries.frame.view import Frame
from flurries.io.color import linear_to_srgb, parse_hex, srgb_to_linear
from flurries.light.lamp import ROW, Optics, as_light, radiance
from flurries.light.plate import PlateLight
from flurries.motion.keys import Keys, value_at

RGB = tuple[float, float, float]

# A color as "#rrggbb". Types know it by this name, so that a mistyped word is no color: any text
# will do where nobody checks types.
Hex = NewType("Hex", str)

# One grey, (r, g, b) or "#rrggbb", display values, plain or keyed; or "ambient", the light of the
# background; of some effects "local", that light by places.
Color: TypeAlias = float | tuple[float, float, float] | Keys | Hex | Literal["ambient"]
PlacedColor: TypeAlias = Color | Literal["local"]

# What `color` says instead of a color: the background's own light, or the same by places, that is
# what lies behind and around each flake.
AMBIENT, LOCAL = "ambient", "local"

# A clear sun by day lights what lies across its rays some two times as much as the sky does.
SUN = 2.0

# Cells along the longer side of a frame in which the light of lamps on the texture is found.
CELLS = 48


def as_color(value: object, words: tuple[str, ...] = (AMBIENT,)) -> Any:
    """Return one grey or (r, g, b), plain or keyed, in 0 to 1, or a word for the plate's light."""
    if isinstance(value, Keys) and value.width not in (None, 3):
        raise ValueError(f"color must be keyed with numbers or (r, g, b), got {value!r}")
    if not isinstance(value, str):
        return as_light("color", value, 1.0)
    if value.startswith("#"):
        return tuple(part / 255 for part in parse_hex("color", value))
    if value not in words:
        raise ValueError(
            f"color must be a number, (r, g, b), '#rrggbb' or {' or '.join(map(repr, words))}, "
            f"got {value!r}{suggestion(value, words)}"
        )
    return value


def is_local(color: object) -> bool:
    """Whether a color is the plate's light by places."""
    return isinstance(color, str) and color == LOCAL


def reads_of(color: object) -> frozenset[str]:
    """Return the parts of a scene that an effect of a color reads, its depth included."""
    if is_local(color):
        return PARTS - {"ambient"} | {"plate"}
    return PARTS if isinstance(color, str) else PARTS - {"ambient"}


def color_at(color: Any, frame: Frame) -> RGB:
    if isinstance(color, str):
        return frame.ambient or (1.0, 1.0, 1.0)
    now = value_at(color, frame.t)
    return (now,) * 3 if isinstance(now, float) else now


def bright(color: RGB, gain: float) -> RGB:
    """Return the display values of a color's light times a gain; they may exceed 1."""
    if gain == 1.0:
        return color
    red, green, blue = linear_to_srgb(gain * srgb_to_linear(np.array(color))).tolist()
    return red, green, blue


def shade_of(frame: Frame, colors: Array, cell: float = 1.0) -> Shade:
    """Return linear colors of cells (rows, columns, 3) of a frame, as its window has them."""
    return Shade(np.asarray(colors, np.float32), cell, (frame.window[0], frame.window[2]))


def even_shade(frame: Frame, color: RGB) -> Shade:
    return shade_of(frame, srgb_to_linear(np.asarray(color, np.float64)).reshape(1, 1, 3))


def local_shade(frame: Frame, optics: Optics | None) -> Shade:
    """Return the color that the plate's light gives to particles, or to fog, by places."""
    assert frame.plate is not None
    light, display = _local(frame.plate, frame.camera.focal, optics)
    return replace(shade_of(frame, light, frame.plate.cell), display=display)


@kept(16)
def _local(plate: PlateLight, focal: float, optics: Optics | None) -> tuple[Array, Array]:
    light = plate.veil(focal) if optics is None else plate.local(focal, *optics)
    return (light := light.astype(np.float32)), linear_to_srgb(light)


class Base(NamedTuple):
    """The brightness of a gas, linear light."""

    dim: Float64  # (3,): in the light from all sides.
    sunny: Float64  # (3,): where a white sun lights it in full.


def base_of(color: Any, frame: Frame) -> tuple[Base, RGB, bool]:
    """Return the brightness of a gas, its color in display values, and if that is the plate's."""
    if not is_local(color):
        own = color_at(color, frame)
        light = srgb_to_linear(np.asarray(own, np.float64))
        return Base(light, light), own, False
    assert frame.plate is not None
    # White gas is as bright as the plate's sky, of one color.
    sky = frame.plate.sky
    red, green, blue = linear_to_srgb(sky).tolist()
    return Base(sky, np.full(3, SUN * sky.mean())), (red, green, blue), True


def lamp_shade(frame: Frame, depths: ArrayLike, weights: ArrayLike, optics: Optics) -> Shade:
    """Return the light of lamps on flakes at depths, each weighed by what its layer covers."""
    layers = np.array([depths, np.asarray(weights) / np.sum(weights)])
    about = frame.camera, frame.shape, frame.lamps().tobytes(), layers.tobytes(), optics
    return shade_of(frame, *_lamp_light(*about))


@kept(4, by_mode=True)
def _lamp_light(
    camera: Camera, shape: tuple[int, int], lamps: bytes, layers: bytes, optics: Optics
) -> tuple[Array, float]:
    """Return that light at the middles of cells, and their side: one for lamps that stand."""
    cell = float(max(math.ceil(max(shape) / CELLS), 1))
    rows, columns = (math.ceil(side / cell) for side in shape)
    x, y = ((np.arange(n) + 0.5) * cell for n in (columns, rows))
    eye, (depths, shares) = np.array(camera.offset), np.frombuffer(layers).reshape(2, -1, 1, 1)
    points = depths * rays_at(camera, shape, x, y).reshape(-1, 3) + eye
    lit = np.frombuffer(lamps).reshape(-1, ROW)
    found = radiance(points.reshape(-1, 3), lit, optics, eye).reshape(points.shape)
    return (shares * found).sum(axis=0).reshape(rows, columns, 3).astype(np.float32), cell
