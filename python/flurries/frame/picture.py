"""How a frame is put together: in one piece, or in bands of rows where it is large."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from flurries._contract import Array
from flurries._trace import current
from flurries.camera.lens import Camera
from flurries.frame.bands import Window, bands_of, common, crop, within
from flurries.frame.layer import Layer, layers_of
from flurries.frame.matte import NOTHING_IN_FRONT, Front
from flurries.frame.mixing import Mix, behind
from flurries.frame.program import Ask, Program
from flurries.frame.view import Frame, Shared


def images(
    program: Program, t: float, eyes: Sequence[Camera | None], window: Window
) -> list[Array]:
    """Return the picture of a window for each eye; None is the path's own camera."""
    # The eyes' bands are made in turn, so that the second finds what the first has made.
    with current.get().stage("background"):
        plate = crop(program.backdrop.frame(t), window)
    dtype = shown_type(plate)
    cameras = tuple([program.camera(eye, t) for eye in eyes])
    # Where none of the weather can be seen, none is made.
    whole_front = program.front(t)
    inner = program.open_part(window, whole_front)
    mix = program.mix(plate)
    front = whole_front
    if front is not NOTHING_IN_FRONT:
        front = front.window(window)
    pictures = []
    for camera in cameras:
        asks = [] if inner is None else program.asks(t, camera, inner, dtype)
        pictures.append(Picture(asks, mix, plate, front, window, inner))
    # One where no more than the result is held then.
    plain = not pictures[0].asks and front is NOTHING_IN_FRONT and mix.same
    bands = [window] if plain else bands_of(window)
    if inner is not None and (len(eyes) > 1 or len(bands) > 1):
        shared = Shared(cameras, inner, len(bands))
        for picture in pictures:
            picture.asks = [
                ask._replace(frame=ask.frame.derive(shared=shared)) for ask in picture.asks
            ]
    if len(bands) == 1:
        return [picture.compose(window, None) for picture in pictures]
    results = [np.empty_like(plate, order="C") for _ in eyes]
    for band in bands:
        for picture, result in zip(pictures, results, strict=True):
            picture.compose(band, crop(result, within(band, window)))
    return results


def shown_type(plate: Array) -> np.dtype[Any]:
    """Return the type whose steps hide what is faint, of a background."""
    # With alpha, integers show what is less than half a step: in the colors of what is faint.
    return plate.dtype if plate.shape[2] == 3 else np.dtype(np.float32)


@dataclass(eq=False)
class Picture:
    """The picture of one eye, while it is put together."""

    asks: list[Ask]  # The effects that lie over the background, back to front.
    mix: Mix
    plate: Array  # The background's window, and that of what stands in front.
    front: Front
    window: Window
    inner: Window | None  # The part in which the weather can be seen.
    shown: list[Layer] | None = None  # What lay over the background, if asked for.
    # What draws the whole for any part of it, and layers of the band that is being composed, made
    # before it was known how they are laid.
    _drawn: dict[int, tuple[Layer, ...]] = field(default_factory=dict)
    _ready: tuple[Layer, ...] | None = None

    def compose(self, band: Window, into: Array | None) -> Array:
        """Return the composite of a band, written to `into` where that is given."""
        mix, plate, front, part = self.mix, self.plate, self.front, self.inner
        bare = front is NOTHING_IN_FRONT
        if band != self.window:
            place = within(band, self.window)
            plate = crop(plate, place)
            front = front if bare else front.window(place)
            part = None if part is None else common(band, part)
        part = part if self.asks else None
        alone = self.asks[0] if len(self.asks) == 1 and bare and part == band else None
        # Only what is lit by places may go over bytes at once: else its layer waits in memory.
        if alone is not None and _by_places(alone) and mix.bytes_of(plate):
            made = self._layers(0, alone, _narrow(alone, band), band)
            if len(made) == 1:
                with current.get().stage("composite"):
                    done = mix.in_bytes(made[0], plate, into)
                if done is not None:
                    if self.shown is not None:
                        self.shown.append(made[0])
                    return done
            self._ready = made
        with current.get().stage("composite"):
            light = mix.decode(plate)
        if not bare:
            light = front.behind(light, linear=mix.linear)
        if part is not None and bare:
            # The last layer lies over the rest in the frame itself.
            light = self._over(part, light, None, into if mix.same else None)
        elif part is not None:
            inside = within(part, band)
            cover = None if front.cover is None else crop(front.cover, inside)
            over = self._over(part, np.ascontiguousarray(crop(light, inside)), cover, None)
            with current.get().stage("composite"):
                if over.shape == light.shape:
                    light = over
                else:
                    light = light if light.flags.writeable else light.copy()
                    crop(light, inside)[...] = over
        with current.get().stage("composite"):
            light = light if bare else front.over(light, linear=mix.linear)
            return mix.encode(light, plate, into)

    def _over(self, part: Window, over: Array, cover: Array | None, into: Array | None) -> Array:
        """Return all layers over what lies behind them, the last one in `into` if it can be."""
        for number, ask in enumerate(self.asks):
            frame = _narrow(ask, part)
            layers = self._layers(number, ask, frame, part)
            for place, layer in enumerate(layers):
                last = number + 1 == len(self.asks) and place + 1 == len(layers)
                with current.get().stage("composite"):
                    shown = layer if cover is None else behind(layer, cover)
                    if self.shown is not None:
                        self.shown.append(shown)
                    over = self.mix.over(over, shown, into if last else None)
        return over

    def _layers(self, number: int, ask: Ask, frame: Frame, part: Window) -> tuple[Layer, ...]:
        if self._ready is not None:
            ready, self._ready = self._ready, None
            return ready
        with current.get().of_effect(ask.part.place):
            if frame.window == part:
                return draw(ask.part.renderer, frame)
            # One that may draw all of it for any part draws it once.
            if number not in self._drawn:
                self._drawn[number] = draw(ask.part.renderer, frame)
        place = within(part, frame.window)
        return tuple(_cut(layer, place) for layer in self._drawn[number])


def _narrow(ask: Ask, part: Window) -> Frame:
    """Return an effect's view of a part, or of the whole if it does not draw any window."""
    frame = ask.frame
    if part == frame.window or not ask.needs.by_rows:
        return frame
    return frame.derive(window=part)


def _by_places(ask: Ask) -> bool:
    """Whether the light on an effect differs over the frame."""
    return "plate" in ask.needs.reads or bool(ask.frame.lights)


def _cut(layer: Layer, place: Window) -> Layer:
    """Return the part of a layer, counted from its own first pixel."""
    layer = layer.turned(lambda plane: crop(plane, place), "alpha", "rgb", "glow")
    if layer.shade is None:
        return layer
    first = layer.shade.first[0] + place[0], layer.shade.first[1] + place[2]
    return replace(layer, shade=replace(layer.shade, first=first))


def draw(effect: Any, frame: Frame) -> tuple[Layer, ...]:
    """Return an effect's layers, before what stands in the air with its own depth too."""
    if not frame.nearer:
        return _drawn(effect, frame)
    parts = [deep.seen.within(frame.window) for deep in frame.nearer]
    shared = frame.shared
    if shared is None and any(parts):
        shared = Shared((frame.camera,), frame.window)
    whole = frame.derive(nearer=(), shared=shared)
    layers = _drawn(effect, whole)
    for side, (deep, part) in enumerate(zip(frame.nearer, parts, strict=True), 1):
        if frame.depth is None or part is None:
            continue
        own = {"depth": deep.before(frame.depth), "side": side}
        close = _drawn(effect, whole.derive(window=part, **own))
        pairs = zip(layers, close, strict=True)
        layers = tuple(deep.join(layer, near, frame.window, part) for layer, near in pairs)
    return layers


def _drawn(effect: Any, frame: Frame) -> tuple[Layer, ...]:
    top, bottom, left, right = frame.window
    shape = bottom - top, right - left
    if hasattr(effect, "needs"):
        return layers_of(effect.render(frame), effect, shape)
    # One that does not say what it needs is a step by itself.
    with current.get().stage(type(effect).__name__.lower()):
        return layers_of(effect.render(frame), effect, shape)
