"""How a frame is put together: in one piece, or in bands of rows where it is large."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from flurries._contract import Array
from flurries._trace import current
from flurries.camera.lens import Camera
from flurries.frame.bands import Window, bands_of, common, crop, within
from flurries.frame.layer import Layer, layers_of
from flurries.frame.matte import Front
from flurries.frame.mixing import Mix, behind
from flurries.frame.planes import plane
from flurries.frame.program import Ask, Program
from flurries.frame.view import Frame, Shared


def images(
    program: Program, t: float, eyes: Sequence[Camera | None], window: Window
) -> list[Array]:
    """Return the picture of a window for each eye; None is the path's own camera."""
    with current.get().stage("background"):
        plate = crop(program.backdrop.frame(t), window)
    cameras = tuple([program.camera(eye, t) for eye in eyes])
    # Where none of the weather can be seen, none is made.
    front = program.front(t)
    inner, mix = program.open_part(window, front), program.mix(plate)
    asked = [
        [] if inner is None else program.asks(t, camera, inner, shown_type(plate))
        for camera in cameras
    ]
    # One where no more than the result is held then.
    plain = not asked[0] and front is None and mix.same
    bands = [window] if plain else bands_of(window)
    if inner is not None and (len(eyes) > 1 or len(bands) > 1):
        shared = Shared(cameras, inner, len(bands))
        asked = [[ask.derive(shared=shared) for ask in asks] for asks in asked]
    front = front and front.window(window)
    pictures = [Picture(asks, mix, plate, front, window, inner) for asks in asked]
    if len(bands) == 1:
        return [picture.compose(window, None) for picture in pictures]
    results = [plane(plate.shape, plate.dtype) for _ in eyes]
    # The eyes' bands are made in turn, so that the second finds what the first has made.
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
    front: Front | None
    window: Window
    inner: Window | None  # The part in which the weather can be seen.
    shown: list[Layer] | None = None  # What lay over the background, if asked for.
    # Of effects that draw the whole for any part of it.
    _drawn: dict[int, tuple[Layer, ...]] = field(default_factory=dict)

    def compose(self, band: Window, into: Array | None) -> Array:
        """Return the composite of a band, written to `into` where that is given."""
        mix, plate, front, part = self.mix, self.plate, self.front, self.inner
        stage, ready = current.get().stage, None
        if band != self.window:
            place = within(band, self.window)
            plate, front = crop(plate, place), front and front.window(place)
            part = part and common(band, part)
        part = part if self.asks else None
        # The only layer goes over bytes at once.
        if part is not None and front is None and len(self.asks) == 1 and mix.bytes_of(plate):
            ready = self._layers(0, part)
            if len(ready) == 1 and ready[0].rgb is None:
                with stage("composite"):
                    done = mix.in_bytes(ready[0], plate, into)
                if self.shown is not None:
                    self.shown.append(ready[0])
                return done
        with stage("composite"):
            light = mix.decode(plate)
        edged = light.shape[2] == 4 and any(ask.frame.nearer for ask in self.asks)
        own = light.copy() if edged else None  # All of what shows is of the near side of edges.
        if front is None:
            # The last layer lies over the rest in the frame itself.
            if part is not None:
                light = self._over(part, light, None, own, into if mix.same else None, ready)
            with stage("composite"):
                return mix.encode(light, plate, into)
        light = front.behind(light, linear=mix.linear)
        if front.deep is not None and front.deep.pictures:
            own = front.behind(np.zeros((*light.shape[:2], 4), np.float32), linear=mix.linear)
        if part is not None:
            inside = within(part, band)
            cover = None if front.cover is None else crop(front.cover, inside)
            own = None if own is None else crop(own, inside).copy()
            over = self._over(part, np.ascontiguousarray(crop(light, inside)), cover, own, None)
            light = light if light.flags.writeable else light.copy()
            crop(light, inside)[...] = over
        with stage("composite"):
            return mix.encode(front.over(light, linear=mix.linear), plate, into)

    def _over(
        self, part: Window, over: Array, cover: Array | None, own: Array | None,
        into: Array | None, ready: tuple[Layer, ...] | None = None,
    ) -> Array:  # fmt: skip
        """Return all layers over what lies behind them, the last one in `into` if given."""
        # `ready` are the layers of the only effect, if they are made.
        for number in range(len(self.asks)):
            layers = ready or self._layers(number, part)
            for place, layer in enumerate(layers, 1):
                last = number + 1 == len(self.asks) and place == len(layers)
                with current.get().stage("composite"):
                    shown = layer if cover is None else behind(layer, cover)
                    if self.shown is not None:
                        self.shown.append(shown)
                    under, over = over, self.mix.over(over, shown, into if last else None)
                    if own is not None and shown.near is not None:
                        _apart(over, under, own, shown.alpha, shown.near)
        return over

    def _layers(self, number: int, part: Window) -> tuple[Layer, ...]:
        """Return an effect's layers of a part."""
        ask = self.asks[number]
        frame, layers = ask.frame, self._drawn.get(number)
        if ask.needs.by_rows and part != frame.window:
            frame = frame.derive(window=part)
        if layers is None:
            with current.get().of_effect(ask.part.place):
                layers = draw(ask.part.renderer, frame)
        if part == frame.window:
            return layers
        self._drawn[number] = layers
        return tuple(_cut(layer, within(part, frame.window)) for layer in layers)


def _apart(over: Array, under: Array, own: Array, alpha: Array, near: Array) -> None:
    """Give each side of edges what lies before it; `own` is the near one's light, premultiplied."""
    at = np.nonzero(np.isfinite(near) & (own[..., 3] > 0.0) & (own[..., 3] < 1.0))
    most = np.float32(1.0 if over.dtype.kind == "f" else np.iinfo(over.dtype).max)
    close, both, share = near[at][:, None], alpha[at][:, None], own[at][:, 3:]
    mine = at[0], at[1], slice(over.shape[2])
    light, behind, found = own[mine], under[at] / most, over[at] / most
    sent = share * close / np.maximum(both, 1e-9) * (found - (1.0 - both) * behind)
    found += (both - close) / (1.0 - share) * (light - share * behind)
    over[at] = found if most == 1.0 else np.clip(np.rint(most * found), 0.0, most)
    own[mine] = (1.0 - close) * light + sent


def _cut(layer: Layer, place: Window) -> Layer:
    """Return the part of a layer, counted from its own first pixel."""
    layer = layer.turned(lambda plane: crop(plane, place), "alpha", "rgb", "glow", "near")
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
    if hasattr(effect, "needs"):
        return layers_of(effect.render(frame), effect, frame.size)
    # One that does not say what it needs is a step by itself.
    with current.get().stage(type(effect).__name__.lower()):
        return layers_of(effect.render(frame), effect, frame.size)
