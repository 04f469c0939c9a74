"""A scene's frames as files: the composite, the weather alone, or all layers; one eye or two."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import Array
from flurries._threads import reproducible
from flurries.camera.lens import Camera
from flurries.frame.truth import Rendered
from flurries.io import Pattern, write_layer_views, write_layers, write_picture
from flurries.io.color import to_display, to_integer, to_linear, to_unit, unmultiply
from flurries.io.colorspace import ColorSpace, config_hash
from flurries.io.layers.deep import write_deep
from flurries.io.pictures.slate import Slate
from flurries.io.pictures.writer import Format, format_of
from flurries.output.deep import deep_of
from flurries.output.folder import Store
from flurries.output.journal import Mark
from flurries.output.sequence import Job
from flurries.scene.fingerprint import Inputs, Settings
from flurries.scene.output import MOTION
from flurries.scene.scene import Scene, find_light


@dataclass(frozen=True)
class Content:
    """The contents of a frame's files, and how they are encoded."""

    kind: str = "composite"  # The picture, or of the weather "alone", "layers" or "deep".
    bits: int | str | None = None  # Of a color; what the format and the background have if None.
    codec: str | None = None  # Of a film.
    motion: str = "y-down"  # Which way the second number of motion vectors counts.
    eyes: Mapping[str, Camera] | None = None  # Views instead of the one of the path's camera.
    compression: str = "zip"  # How an EXR is packed, as `flurries.io.write_picture` takes it.
    space: ColorSpace | None = None  # What is written, of a scene that says its own.

    @property
    def mark(self) -> str:
        words = ["half" if self.bits is None else str(self.bits), self.kind]
        words += [] if self.codec is None else [self.codec]
        words += ["y-up"] if self.motion == "y-up" and self.kind == "layers" else []
        words += [self.space.name] if self.space is not None else []
        words += [self.compression] if self.compression != "zip" else []
        if self.eyes is not None:
            told = repr(list(self.eyes.items())).encode()
            words.append(f"eyes{hashlib.sha256(told).hexdigest()[:8]}")
        return "-".join(words)

    def render(self, scene: Scene, number: int) -> Any:
        """Return a frame for `save`, or one for each eye."""
        if self.kind == "deep":
            return deep_of(scene, number)
        if self.bits not in (None, 8):
            # A background of 8 bits is mixed in more.
            scene = scene._fine
        show: Any = scene.render if self.kind == "composite" else scene.layers
        if self.eyes is None:
            return show(number)
        return {name: show(number, eye=eye) for name, eye in self.eyes.items()}

    def save(self, scene: Scene, path: Path, frame: Any, metadata: dict[str, Any]) -> None:
        """Write a rendered frame, with what the background says of itself."""
        form = format_of(path)
        half = self.bits != "float"
        slate = scene._slate(int(metadata["frame"]))
        if self.space is not None and scene._color is not None:
            apart = self.kind in ("layers", "deep") or self.eyes
            own = scene._color.working if apart else self.space
            metadata = {**metadata, "colorspace": own.name}
            slate = replace(slate, video=own.video) if form.name == "dpx" else slate
            slate = slate if own.name == scene._color.name else replace(slate, colored=False)
        # A plate that is a part of its picture remains that part.
        cut = slate.crop if form.name == "openexr" and self.kind != "deep" else None
        slate = slate if cut is None else slate.cropped()
        more: dict[str, Any] = {"half": half, "metadata": metadata, "slate": slate}
        if self.kind == "deep":
            write_deep(path, frame, **more)
            return
        if self.kind == "layers":
            more["metadata"] = metadata = {
                **metadata,
                "motion": MOTION[self.motion],
                "light": "linear" if scene._linear else "display",
                "layers": _order(next(iter(frame.values())) if self.eyes else frame),
            }
        if self.eyes is not None:
            views = {name: self._planes(scene, view, cut) for name, view in frame.items()}
            write_layer_views(path, views, **more)
        elif self.kind == "layers":
            write_layers(path, self._planes(scene, frame, cut), **more)
        else:
            alone, encoding = self.kind == "alone", None
            pixels = frame if form.alpha or alone else without_alpha(frame, path)
            if alone:
                pixels, encoding = weather(frame), "linear" if scene._linear else "display"
            pixels = pixels if cut is None else np.ascontiguousarray(pixels[cut])
            if self.space is not None:
                pixels = self._colored(scene, pixels)
                encoding = "linear" if self.space.linear else "display"
            more["bits"] = self._bits_in(form, slate, encoding, deep=scene._backdrop.deep)
            write_picture(path, pixels, encoding=encoding, compression=self.compression, **more)

    def _bits_in(
        self, form: Format, slate: Slate, encoding: str | None, *, deep: bool
    ) -> int | None:
        """Return the bits of a color of a picture; None where the pixels decide."""
        if isinstance(self.bits, int) or not form.bits:
            return self.bits if isinstance(self.bits, int) else None
        if self.kind == "alone":
            return None if self.bits == "float" else 16 if deep else 8
        known = slate.bits if slate.bits in form.bits else None
        if form.name == "dpx":
            return known or 10
        return known or 8 if self.space is not None and encoding == "display" else None

    def _colored(self, scene: Scene, pixels: Array) -> Array:
        """Return premultiplied light of the scene's working space in what is written."""
        assert self.space is not None and scene._color is not None
        return scene._color.working.convert_rgba(pixels, self.space)

    def levels(self, scene: Scene, frame: Any, bits: int, path: object) -> Array:
        """Return a rendered frame as a film takes it, uint8 or uint16."""
        if self.kind == "alone":
            whole = weather(frame)
            if self.space is not None:
                whole = self._colored(scene, whole)
            colors = unmultiply(whole[..., :3], whole[..., 3:])
            if self.space is None:
                colors = to_display(colors, "linear" if frame.linear else "display")
            return to_integer(np.concatenate([colors, whole[..., 3:]], axis=2), bits)
        image = without_alpha(frame, path)
        if self.space is not None:
            return to_integer(self._colored(scene, image), bits)
        return display_levels(image, bits)

    def _planes(self, scene: Scene, frame: Any, cut: Any) -> dict[str, Array]:
        if self.kind == "layers":
            found = planes(frame, up=self.motion == "y-up")
        else:
            found = {"rgba": weather(frame) if self.kind == "alone" else _light(frame)}
        if cut is None:
            return found
        return {name: np.ascontiguousarray(plane[cut]) for name, plane in found.items()}


def planes(rendered: Rendered, *, up: bool = False) -> dict[str, Array]:
    """Return a frame as the layers of an EXR, see `flurries.io.write_layers`."""

    def turned(motion: Array | None) -> Any:
        return motion * np.array([1.0, -1.0], np.float32) if up and motion is not None else motion

    found = {"rgba": _light(rendered.image)}
    together = {
        "alpha": rendered.alpha,
        "background": rendered.background,
        "foreground": rendered.foreground,
        "forward": turned(rendered.motion),
        "backward": turned(rendered.backward),
        "depth": rendered.depth,
        "weather.depth": rendered.weather_depth,
    }
    found.update({name: plane for name, plane in together.items() if plane is not None})
    for name, layer in rendered.layers.items():
        numbers = None if layer.ids is None else np.maximum(layer.ids, 0)
        known = {
            name: layer.rgba,
            f"{name}.depth": layer.depth,
            f"{name}.forward": turned(layer.motion),
            f"{name}.backward": turned(layer.backward),
            f"{name}.coverage": layer.coverage,
            f"{name}.id": numbers,
        }
        found.update({key: plane for key, plane in known.items() if plane is not None})
    return found


def _order(rendered: Rendered) -> str:
    """Return the names of what is laid over each other, back to front."""
    front = [] if rendered.foreground is None else ["foreground"]
    return ", ".join(["background", *rendered.layers, *front])


def weather(rendered: Rendered) -> Array:
    """Return (H, W, 4) float32: the layers over each other, premultiplied."""
    whole = np.zeros((*rendered.alpha.shape, 4), np.float32)
    for layer in rendered.layers.values():
        whole = layer.rgba + (1.0 - layer.rgba[..., 3:]) * whole
    return whole


def _light(image: Array) -> Array:
    """Return an image as linear light, premultiplied, with alpha 1 where it has none."""
    light = to_linear(image[..., :3], "display" if image.dtype.kind == "u" else "linear")
    if image.shape[2] == 3:
        return np.concatenate([light, np.ones_like(light[..., :1])], axis=2)
    cover = to_unit(image[..., 3:])
    return np.concatenate([light * cover if image.dtype.kind == "u" else light, cover], axis=2)


def without_alpha(image: Array, path: object) -> Array:
    """Return an image for a file that holds no alpha."""
    if image.shape[2] == 3:
        return image
    if not (to_unit(image[..., 3]) == 1.0).all():
        raise ValueError(f"{path}: the frame is transparent in places; take .png, .exr or .tif")
    return np.ascontiguousarray(image[..., :3])


def display_levels(image: Array, bits: int) -> Array:
    if image.dtype.itemsize * 8 == bits and image.dtype.kind == "u":
        return image
    return to_integer(to_display(image, "display" if image.dtype.kind == "u" else "linear"), bits)


@dataclass
class Frames(Job):
    """One scene's frames."""

    scene: Scene  # What to render. Its files are read again, whatever it has kept of them.
    content: Content  # What a file holds.
    pattern: str  # The files' names; without a token the name of one still.
    store: Store = field(default_factory=Store)  # Where the files are kept.
    overwrite: bool = False
    skip: bool = False  # Whether frames whose background cannot be read are left out.
    tolerant: bool = False
    folder: Path = field(init=False)
    inputs: Inputs = field(init=False)
    _settings: Settings = field(init=False)
    _mark: str = field(init=False)
    _pattern: Pattern | None = field(init=False)

    def __post_init__(self) -> None:
        self.scene = scene = self.scene._anew()
        if scene.range is not None and scene._film is None and scene._takes_light:
            # Frames of a sequence have the light of all of it: whoever makes one has to agree.
            self.scene = scene.replace(light=scene.light or find_light(scene))
        self.folder = Path(self.pattern).parent
        self.inputs = Inputs(self.scene)
        # Frames of the two modes are never mixed.
        mode = "-reproducible" if reproducible() else ""
        # A configuration counts by what it holds.
        ocio = "" if self.scene._color is None else f"-{config_hash()[:8]}"
        # Eyes of their own see more of the camera's way.
        self._settings = Settings(self.scene, whole=self.content.eyes is not None)
        self._mark = f"{self._settings.common}-{self.content.mark}{mode}{ocio}"
        still = "%" not in Path(self.pattern).name
        self._pattern = None if still else Pattern(self.pattern)

    def path_of(self, index: int) -> Path:
        return Path(self.pattern) if self._pattern is None else self._pattern.path(index)

    def mark_of(self, index: int) -> Mark:
        return Mark(self._mark + self._settings.of(index), index, self.inputs.of(index))

    def make(self, index: int) -> Any:
        if self.skip and not is_readable(self.scene, index):
            return None
        return self.content.render(self.scene, index)

    def save(self, path: Path, made: Any, header: dict[str, Any]) -> None:
        self.content.save(self.scene, path, made, {**header, "seed": self.scene.seed})

    def stands_in(self, index: int) -> bool:
        return index in self.scene._held


def is_readable(scene: Scene, number: int) -> bool:
    """Whether background and depth of a frame can be read."""
    try:
        scene._look(number)
    except (OSError, ValueError):
        return False
    return True
