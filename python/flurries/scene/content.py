"""What a file of a frame holds: the composite, the weather alone, deep samples, or all layers."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import Array
from flurries.camera.lens import Camera
from flurries.frame.truth import opaque, order, planes, truth, weather
from flurries.io import write_layer_views, write_layers, write_picture
from flurries.io.color import encoding_of, to_display, to_integer, to_linear, to_unit, unmultiply
from flurries.io.colorspace import ColorSpace, config_hash
from flurries.io.layers.planes import Deep, write_deep
from flurries.io.pictures.slate import Slate
from flurries.io.pictures.writer import Format, format_of
from flurries.scene.depth import Distance
from flurries.scene.numbered import Planes
from flurries.scene.output import MOTION, Output
from flurries.scene.scene import Scene, find_light


@dataclass(frozen=True)
class Content:
    """How frames of a scene are rendered and encoded for files."""

    scene: Scene
    output: Output
    eyes: Mapping[str, Camera] | None  # Views instead of the one of the path's camera.
    space: ColorSpace | None  # What is written, of a scene that says its own.

    @classmethod
    def of(cls, scene: Scene, output: Output, eyes: Any, space: ColorSpace | None) -> "Content":
        """Return contents whose files are read again, whatever the scene has kept of them."""
        scene = scene._anew(hold=output.damaged == "hold")
        lit = any(str(getattr(e, "color", None)) in ("ambient", "local") for e in scene.effects)
        if scene._range is not None and scene._film is None and lit:
            # Frames of a sequence have the light of all of it: whoever makes one has to agree.
            scene = scene.replace(light=scene.light or find_light(scene))
        return cls(scene, output, eyes, space)

    @property
    def way(self) -> tuple[Any, ...]:
        """What a file depends on beside its scene; a configuration counts by what it holds."""
        said = self.output
        return (
            None if self.space is None else (self.space, config_hash()),
            said.kind, said.bits or "half", said.codec, said.compression,
            (said.motion, said.plate) if said.kind == "layers" else None,
            self.eyes and list(self.eyes.items()),
        )  # fmt: skip

    def render(self, number: int, *, fine: bool = False) -> Any:
        """Return a frame for `save`, or one for each eye."""
        scene = self.scene
        if self.output.kind == "deep":
            return deep_of(scene, number)
        if fine or self.output.bits not in (None, 8):
            # A background of 8 bits is mixed in more.
            scene = scene._fine
        show: Any = scene.render if self.output.kind == "composite" else scene.layers
        if self.eyes is None:
            return show(number)
        return {name: show(number, eye=eye) for name, eye in self.eyes.items()}

    def save(self, path: Path, frame: Any, header: dict[str, Any]) -> None:
        """Write a rendered frame, with what the background says of itself."""
        form, scene, kind = format_of(path), self.scene, self.output.kind
        metadata = {**header, "seed": scene.seed}
        slate = scene._slate(int(header["frame"]))
        if self.space is not None and scene._color is not None:
            apart = kind in ("layers", "deep") or self.eyes
            own = scene._color.working if apart else self.space
            metadata["colorspace"] = own.name
            slate = replace(slate, video=own.video) if form.name == "dpx" else slate
            slate = slate if own.name == scene._color.name else replace(slate, colored=False)
        # A plate that is a part of its picture remains that part.
        cut = slate.crop if form.name == "openexr" and kind != "deep" else None
        slate = slate if cut is None else slate.cropped()
        if kind == "layers":
            metadata["motion"] = MOTION[self.output.motion]
            metadata["light"] = "linear" if scene._linear else "display"
            metadata["layers"] = order(next(iter(frame.values())) if self.eyes else frame)
        more: Any = {"half": self.output.bits != "float", "metadata": metadata, "slate": slate}
        if kind == "deep":
            write_deep(path, frame, **more)
        elif self.eyes is not None:
            views = {name: self._planes(view, cut) for name, view in frame.items()}
            write_layer_views(path, views, **more)
        elif kind == "layers":
            write_layers(path, self._planes(frame, cut), **more)
        else:
            pixels, encoding = frame, None
            if kind == "alone":
                pixels, encoding = weather(frame), "linear" if scene._linear else "display"
            elif not form.alpha:
                pixels = without_alpha(frame, path)
            pixels = pixels if cut is None else np.ascontiguousarray(pixels[cut])
            if self.space is not None:
                pixels = self._colored(pixels)
                encoding = "linear" if self.space.linear else "display"
            more["bits"] = self._bits_in(form, slate, encoding)
            packed = self.output.compression
            write_picture(path, pixels, encoding=encoding, compression=packed, **more)

    def _bits_in(self, form: Format, slate: Slate, encoding: str | None) -> int | None:
        """Return the bits of a color of a picture; None where the pixels decide."""
        bits = self.output.bits
        if isinstance(bits, int) or not form.bits:
            return bits if isinstance(bits, int) else None
        if self.output.kind == "alone":
            return None if bits == "float" else 16 if self.scene._backdrop.deep else 8
        known = slate.bits if slate.bits in form.bits else None
        if form.name == "dpx":
            return known or 10
        return known or 8 if self.space is not None and encoding == "display" else None

    def _colored(self, pixels: Array) -> Array:
        if self.space is None or self.scene._color is None:
            return pixels
        return self.scene._color.working.convert_rgba(pixels, self.space)

    def levels(self, frame: Any, bits: int, path: Path) -> Array:
        if self.output.kind == "alone":
            whole = self._colored(weather(frame))
            colors = unmultiply(whole[..., :3], whole[..., 3:])
            if self.space is None:
                colors = to_display(colors, "linear" if frame.linear else "display")
            return to_integer(np.concatenate([colors, whole[..., 3:]], axis=2), bits)
        image = self._colored(without_alpha(frame, path))
        if image.dtype.kind == "u" and image.dtype.itemsize * 8 == bits:
            return image
        known = self.space is not None
        return to_integer(image if known else to_display(image, encoding_of(None, image)), bits)

    def _planes(self, frame: Any, cut: Any) -> dict[str, Array]:
        if self.output.kind == "layers":
            up, whole = self.output.motion == "y-up", self.output.bits == "float"
            found = planes(frame, up=up, plate=self.output.plate, whole=whole)
        else:
            found = {"rgba": opaque(frame)}
        if cut is None:
            return found
        return {name: np.ascontiguousarray(plane[cut]) for name, plane in found.items()}


def without_alpha(image: Array, path: object) -> Array:
    if image.shape[2] == 3:
        return image
    if not (to_unit(image[..., 3]) == 1.0).all():
        raise ValueError(f"{path}: the frame is transparent in places; take .png, .exr or .tif")
    return np.ascontiguousarray(image[..., :3])


# Slices of the air, and the first depth at which one ends: 32 to a distance of 256, each 1.28
# times as far as the one before.
SLICES, FIRST, LAST = 31, 0.15, 256.0

# What is fainter waits for the next slice; the last one takes what is left down to the second.
_FAINT, _FAINTEST = 1.0 / 512.0, 1e-4

MOST_SAMPLES = 1 << 24  # Samples of a frame: each is handed to the writer number by number.


def deep_of(scene: Scene, number: float) -> Deep:
    """Return the weather of a frame as deep samples, without background and foreground."""
    there = scene._depth_at(number)
    limit = np.full(scene._shape, 2.0 * LAST, np.float32)
    if there is not None:
        limit = np.where(np.isfinite(there), there, limit).astype(np.float32)
    whole = _layers(scene, number)
    # What has been written of each effect, and up to which depth.
    written = {name: np.zeros(limit.size, np.float32) for name in whole}
    begun = {name: np.zeros(limit.size, np.float32) for name in whole}
    pixels, samples, total = [], [], 0
    far = scene._distance or Distance.of_planes(Planes(np.full(scene._shape, np.inf, np.float32)))
    for edge in [*np.geomspace(FIRST, LAST, SLICES).tolist(), np.inf]:
        last = edge == np.inf
        before = scene._derive(depth=edge, _distance=far.up_to(edge))
        layers = whole if last else _layers(before, number)
        end = np.minimum(limit, edge).ravel()
        for name, layer in whole.items():
            light, past = layer.reshape(-1, 4), written[name]
            now = cover = light[:, 3]
            if not last:
                now = np.clip(layers[name][..., 3].ravel(), past, np.maximum(cover, past))
            share = (now - past) / np.maximum(1.0 - past, 1e-6)
            shown = np.flatnonzero(share >= (_FAINTEST if last else _FAINT))
            total += len(shown)
            if total > MOST_SAMPLES:
                raise ValueError(
                    f"deep: frame {number:g} has more than {MOST_SAMPLES} samples; take a smaller "
                    "frame, or fewer effects to a file"
                )
            part = share[shown, None]
            color = light[shown, :3] * (part / np.maximum(cover[shown, None], 1e-6))
            ends = begun[name][shown, None], end[shown, None]
            pixels.append(shown)
            samples.append(np.concatenate([color, part, *ends], axis=1))
            past[shown] = now[shown]
            begun[name][shown] = end[shown]
    pixel, values = np.concatenate(pixels), np.concatenate(samples)
    values = values[np.lexsort((values[:, 5], values[:, 4], pixel))]
    if not scene._linear:
        # Premultiplied display colors as light.
        cover = np.maximum(values[:, 3:4], 1e-6)
        values[:, :3] = to_linear(values[:, :3] / cover, "display") * cover
    counts = np.bincount(pixel, minlength=limit.size).reshape(scene._shape)
    return Deep(counts, values)


def _layers(scene: Scene, number: float) -> dict[str, Array]:
    t = scene._time_of(number)
    (seen,) = truth(scene._program, t, [None], scene._program.base.window, known=False)
    return {name: layer.rgba for name, layer in seen.layers.items()}
