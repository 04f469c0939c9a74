"""A population's flakes before a lens, as the kernel reads them."""

from __future__ import annotations

from typing import NamedTuple

Triple = tuple[float, float, float]
Matrix = tuple[Triple, Triple, Triple]
Lens = tuple[float, float, float, Triple, float]


class Box(NamedTuple):
    """The flakes of one class of size, in a box that wraps.

    Attributes
    ----------
    number : int
        How many the box holds.
    sides, center : (3,)
        Of the box in its own axes, metres, from the camera.
    seed : int
        Of places, sway and sizes.
    way : (3,)
        Flake minus camera since frame 0, in the box's axes, metres.
    order : (3,)
        The axes, that along which the air passes fastest first: a flake that comes in again along
        one is at a new place along those after it.
    sway : (amplitude, angle)
        Metres, radians.
    travel : (3,)
        Flake minus camera during the exposure, in the eye's axes, metres.
    sizes : (smallest, largest)
        Diameters, metres.
    slope : float
        Of the exponential law of diameters between the two, 1/m.
    shown : (4,)
        Depths between which flakes fade in, and between which they fade out again, metres.
    amounts : list of float
        The shares of them that are there: one for all, or values at even steps of height.
    """

    number: int
    sides: Triple
    center: Triple
    seed: int
    way: Triple
    order: tuple[int, int, int]
    sway: tuple[float, float]
    travel: Triple
    sizes: tuple[float, float]
    slope: float
    shown: tuple[float, float, float, float]
    amounts: list[float]


class Closeup(NamedTuple):
    """The looks of flakes from near and out of focus.

    Attributes
    ----------
    kind : {"aggregate", "drop", "round"}
        What large ones are.
    switch : (low, high)
        Sigma in px between which a round sprite gives way to a shape.
    blur : (strength, focus, blades, turn) or None
        See :class:`flurries.camera.optics.Blur`.
    seed : int
        Of shapes and tumbling.
    seconds : float
        Since frame 0.
    """

    kind: str
    switch: tuple[float, float]
    blur: tuple[float, float, int, float] | None
    seed: int
    seconds: float


class Crowd(NamedTuple):
    """The classes of a population before one lens.

    Attributes
    ----------
    boxes : list of Box
    opacity : float
        Of a resting flake's middle.
    turn : (3, 3)
        From the boxes' axes to the eye's.
    spread : (3, 3)
        What a flake's place adds to its way during the exposure: the camera turns and zooms.
    down : (3,)
        The direction of the fall in the boxes' axes.
    heights : (low, high)
        Metres below the eye, from the first amount to the last.
    room : float
        Metres that flakes may lie beside the view and still touch it, beyond their size and sway.
    lens : (focal, cx, cy, offset, near)
        See :class:`flurries.Camera`.
    window : (top, bottom, left, right)
        Pixels; the rest of the frame may lack flakes.
    closeup : Closeup or None
        None draws all flakes as sharp sprites.
    """

    boxes: list[Box]
    opacity: float
    turn: Matrix
    spread: Matrix
    down: Triple
    heights: tuple[float, float]
    room: float
    lens: Lens
    window: tuple[int, int, int, int]
    closeup: Closeup | None = None


class Flurry(NamedTuple):
    """A box of flakes that all move alike, as the kernel reads it: its fields go by name.

    Attributes
    ----------
    number : int
        Flakes in the box.
    sides, center : (3,)
        The box in the eye's axes, metres.
    seed : int
        Of places, sway and sizes.
    way, travel : (3,)
        Metres since frame 0, and during the exposure.
    sway : (amplitude, angle)
        Metres, radians.
    radius : (smallest, largest)
        Metres.
    opacity, amount, fade_in : float
        Of a flake's middle; the share of flakes that is there; over which the last ones fade in.
    largest : (low, high)
        Sigma in pixels from which flakes fade, and at which they are gone.
    sizes : int
        Stream of the numbers that their sizes are.
    lens : (focal, cx, cy, offset, near)
        See :class:`flurries.Camera`.
    window : (top, bottom, left, right)
        Pixels; the rest of the frame may lack flakes.
    """

    number: int
    sides: Triple
    center: Triple
    seed: int
    way: Triple
    sway: tuple[float, float]
    travel: Triple
    radius: tuple[float, float]
    opacity: float
    amount: float
    fade_in: float
    largest: tuple[float, float]
    sizes: int
    lens: Lens
    window: tuple[int, int, int, int]
