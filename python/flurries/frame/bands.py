"""How a frame is put together: in one piece, or in bands of rows where it is large.

The picture that the layers are mixed in, the layers, and what encoding makes on the way are several
times as large as the frame that is asked for. Of a large one only a band of each is ever held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flurries._contract import Array
from flurries.camera.lens import Camera
from flurries.frame.layer import Frame, Layer, Shared, layers_of
from flurries.frame.mixing import Mix, behind
from flurries.frame.visible import Window
from flurries.scene.foreground import Foreground
from flurries.trace import stage

# Frames of more pixels than this are made in bands.
_WHOLE = 1 << 20

# Pixels of a band, and what its rows are a multiple of: flakes and gas come in tiles of 64 px.
_BAND = 1 << 19
_ROWS = 64


def bands_of(window: Window) -> list[Window]:
    """Return the bands of a window from the top down; itself if it is small."""
    top, bottom, left, right = window
    width = right - left
    if (bottom - top) * width <= _WHOLE:
        return [window]
    rows = max(_BAND // width // _ROWS, 1) * _ROWS
    # Cut where tiles begin in the frame, whatever the window.
    cuts = range(top // rows * rows, bottom, rows)
    return [(max(cut, top), min(cut + rows, bottom), left, right) for cut in cuts]


def most_bands(shape: tuple[int, int]) -> int:
    """Return how many bands a frame has, and no window of it more."""
    return len(bands_of((0, shape[0], 0, shape[1]))) + 1


@dataclass(frozen=True)
class Ask:
    """An effect, its view of a frame, and how it may be asked for it.

    Attributes
    ----------
    effect : effect
        Itself.
    frame : Frame
        Its window is all of the picture in which the weather can be seen.
    by_rows : bool
        Whether it draws any window at its share of the cost.
    in_one_pass : bool
        Whether it may lay itself over a picture.
    """

    effect: Any
    frame: Frame
    by_rows: bool
    in_one_pass: bool


def bands_in(
    window: Window, asks: Sequence[Ask], mix: Mix, matte: Foreground | None
) -> list[Window]:
    """Return the bands that a window is made in; one if no more than the result is held then."""
    plain = mix.same and matte is None
    if plain and (not asks or (len(asks) == 1 and asks[0].in_one_pass)):
        return [window]
    return bands_of(window)


class Picture:
    """A frame that is put together.

    Parameters
    ----------
    asks : sequence of Ask
        What lies over the background, back to front.
    mix : Mix
        In which light.
    plate : (h, w, 3)
        The background's window.
    matte : Foreground, optional
        The window of what stands in front.
    window : (top, bottom, left, right)
        Pixels.
    inner : window, optional
        The part in which the weather can be seen.
    """

    def __init__(
        self,
        asks: Sequence[Ask],
        mix: Mix,
        plate: Array,
        matte: Foreground | None,
        window: Window,
        inner: Window | None,
    ) -> None:
        self.asks, self.mix, self.plate, self.matte = list(asks), mix, plate, matte
        self.window, self.inner = window, inner
        self._result: Array | None = None
        self._drawn: dict[int, tuple[Layer, ...]] = {}

    @property
    def bands(self) -> list[Window]:
        """The bands that it is made in."""
        return bands_in(self.window, self.asks, self.mix, self.matte)

    def share(self, shared: Shared) -> None:
        """Let effects keep what eyes and bands have in common."""
        self.asks = [replace(ask, frame=replace(ask.frame, shared=shared)) for ask in self.asks]

    def whole(self) -> Array:
        """Return the composite."""
        return self._laid(self.window, None)

    def lay(self, band: Window) -> None:
        """Make a band of the composite; they come from the top down."""
        if self._result is None:
            self._result = np.empty_like(self.plate, order="C")
        self._laid(band, cropped(self._result, within(band, self.window)))

    def done(self) -> Array:
        """Return the composite that the bands made."""
        assert self._result is not None
        return self._result

    def _laid(self, band: Window, into: Array | None) -> Array:
        """Return the composite of a band, written to `into` where that is given."""
        mix, place = self.mix, within(band, self.window)
        plate = cropped(self.plate, place)
        matte = None if self.matte is None else self.matte.window(place)
        part = common(band, self.inner) if self.asks and self.inner is not None else None
        working = mix.working(plate)
        if part is not None and matte is None:
            # The last layer lies over the rest in the frame itself.
            working = self._over(part, working, None, into if mix.same else None)
        elif part is not None and matte is not None:
            inside = within(part, band)
            over = np.ascontiguousarray(cropped(working, inside))
            over = self._over(part, over, cropped(matte.cover, inside), None)
            with stage("composite"):
                if over.shape == working.shape:
                    working = over
                else:
                    working = working if working.flags.writeable else working.copy()
                    cropped(working, inside)[...] = over
        with stage("composite"):
            if matte is not None and matte.light is not None:
                working = matte.over(working, linear=mix.linear)
            return mix.finished(working, plate, into)

    def _over(self, part: Window, over: Array, cover: Array | None, into: Array | None) -> Array:
        """Return all layers over what lies behind them, the last one in `into` if it can be."""
        for number, ask in enumerate(self.asks):
            frame = self._frame(ask, part)
            if cover is None and into is None and not frame.banded:
                one_pass = getattr(ask.effect, "over", None)
                done = None if one_pass is None else one_pass(frame, over, self.mix.light)
                if done is not None:
                    over = done
                    continue
            layers = self._layers(number, ask, frame, part)
            for place, layer in enumerate(layers):
                last = number + 1 == len(self.asks) and place + 1 == len(layers)
                with stage("composite"):
                    shown = layer if cover is None else behind(layer, cover)
                    over = self.mix.over(over, shown, into if last else None)
        return over

    def _frame(self, ask: Ask, part: Window) -> Frame:
        frame = ask.frame
        if part == frame.window or not ask.by_rows:
            return frame
        run = frame.run
        return replace(
            frame, window=part, run=None if run is None else replace(run, key=(run.key, part))
        )

    def _layers(self, number: int, ask: Ask, frame: Frame, part: Window) -> tuple[Layer, ...]:
        """Return an effect's layers of a part of the picture."""
        if ask.by_rows or frame.window == part:
            return layers_made(ask.effect, frame, shape_of(frame.window))
        # One that may draw all of it for any part draws it once.
        if number not in self._drawn:
            self._drawn[number] = layers_made(ask.effect, frame, shape_of(frame.window))
        place = within(part, frame.window)
        return tuple(_part_of(layer, place) for layer in self._drawn[number])


def _part_of(layer: Layer, place: Window) -> Layer:
    """Return the part of a layer, counted from its own first pixel."""
    planes = {"alpha": layer.alpha, "rgb": layer.rgb}
    cut = {n: np.ascontiguousarray(cropped(p, place)) for n, p in planes.items() if p is not None}
    return Layer(layer.name, color=layer.color, **cut)


def shape_of(window: Window) -> tuple[int, int]:
    """Return (h, w) of a window."""
    top, bottom, left, right = window
    return bottom - top, right - left


def common(first: Window, second: Window) -> Window | None:
    """Return what two windows have in common, or None."""
    top, left = max(first[0], second[0]), max(first[2], second[2])
    bottom, right = min(first[1], second[1]), min(first[3], second[3])
    return (top, bottom, left, right) if top < bottom and left < right else None


def laid(pictures: Sequence[Picture], cameras: tuple[Camera, ...]) -> list[Array]:
    """Return what one or two eyes see of a frame: band after band, and in each eye after eye."""
    bands = pictures[0].bands
    if len(pictures) > 1 or len(bands) > 1:
        first = pictures[0]
        shared = Shared(cameras, first.inner or first.window, len(bands))
        for picture in pictures:
            picture.share(shared)
    if len(bands) == 1:
        return [picture.whole() for picture in pictures]
    for band in bands:
        for picture in pictures:
            picture.lay(band)
    return [picture.done() for picture in pictures]


def layers_made(effect: Any, frame: Frame, shape: tuple[int, int]) -> tuple[Layer, ...]:
    """Return the layers of an effect."""
    if hasattr(effect, "needs"):
        return layers_of(effect.render(frame), effect, shape)
    # One that does not say what it needs is a step by itself.
    with stage(type(effect).__name__.lower()):
        return layers_of(effect.render(frame), effect, shape)


def cropped(plane: Array, window: Window) -> Array:
    """Return the window of a plane or picture."""
    top, bottom, left, right = window
    return plane[top:bottom, left:right]


def within(inner: Window, window: Window) -> Window:
    """Return a window counted from the first pixel of one around it."""
    top, left = window[0], window[2]
    return inner[0] - top, inner[1] - top, inner[2] - left, inner[3] - left
