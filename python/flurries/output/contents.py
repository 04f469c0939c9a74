"""What is in a frame's file: the composite, the weather alone, or all layers; one eye or two."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import Array
from flurries.camera.lens import Camera
from flurries.frame.truth import Rendered
from flurries.io import write_layer_views, write_layers, write_picture
from flurries.io.color import to_display, to_integer, to_linear, to_unit
from flurries.io.pictures.writer import format_of
from flurries.scene.scene import Scene

# What the numbers of `forward` in a file mean.
MOTION = "px per frame, x right, y down"

# The largest id that a float tells from its neighbours.
_MOST_IDS = 2**24


@dataclass(frozen=True)
class Content:
    """What to render and write of a frame.

    Attributes
    ----------
    kind : {"composite", "alone", "layers"}
        The picture; the weather as RGBA; or everything that is known, as named channels.
    half : bool
        EXR as half.
    compression : str
        How an EXR is packed, as `flurries.io.write_picture` takes it.
    eyes : mapping of str to Camera, optional
        Views instead of the one of the path's camera.
    """

    kind: str = "composite"
    half: bool = True
    eyes: Mapping[str, Camera] | None = None
    compression: str = "zip"

    @property
    def mark(self) -> str:
        """What tells files of one scene but other content apart."""
        words = ["half" if self.half else "float", self.kind]
        if self.compression != "zip":
            words.append(self.compression)
        if self.eyes is not None:
            told = repr(list(self.eyes.items())).encode()
            words.append(f"eyes{hashlib.sha256(told).hexdigest()[:8]}")
        return "-".join(words)

    def render(self, scene: Scene, number: int) -> Any:
        """Return what `save` takes: a frame, or one for each eye."""
        layers = self.kind != "composite"
        if self.eyes is None:
            return scene.render(number, layers=layers)
        return {
            name: scene.render(number, eye=eye, layers=layers) for name, eye in self.eyes.items()
        }

    def save(self, scene: Scene, path: Path, frame: Any, metadata: dict[str, Any]) -> None:
        """Write a rendered frame."""
        if self.kind == "layers":
            metadata = {
                **metadata,
                "motion": MOTION,
                "light": "linear" if scene.linear else "display",
            }
        if self.eyes is not None:
            views = {name: self._planes(scene, view) for name, view in frame.items()}
            write_layer_views(path, views, half=self.half, metadata=metadata)
        elif self.kind == "layers":
            write_layers(path, planes(frame), half=self.half, metadata=metadata)
        elif self.kind == "alone":
            encoding = "linear" if scene.linear else "display"
            pixels = weather(frame)
            write_picture(
                path, pixels, encoding=encoding, half=self.half, compression=self.compression,
                metadata=metadata,
            )  # fmt: skip
        else:
            frame = frame if format_of(path).alpha else without_alpha(frame, path)
            write_picture(
                path, frame, half=self.half, compression=self.compression, metadata=metadata
            )

    def _planes(self, scene: Scene, frame: Any) -> dict[str, Array]:
        if self.kind == "layers":
            return planes(frame)
        return {"rgba": weather(frame) if self.kind == "alone" else _light(frame)}


def planes(rendered: Rendered) -> dict[str, Array]:
    """Return a frame as the layers of an EXR, see `flurries.io.write_layers`.

    Returns
    -------
    dict of str to array
        ``rgba``, the composite in linear light with alpha 1; each layer by its name, and the
        ``background`` and ``foreground`` that it lies between, in the light of the composite;
        ``NAME.depth``, ``NAME.forward``, ``NAME.coverage`` and ``NAME.id`` (flakes counted from 1,
        0 for none; as a float holds no more than 2^24 apart, the remainder by that); of the layers
        together ``alpha``, ``forward`` and ``weather.depth``; and ``depth``, the background's.
    """
    found = {"rgba": _light(rendered.image), **rendered.layers}
    together = {
        "alpha": rendered.alpha,
        "background": rendered.background,
        "foreground": rendered.foreground,
        "forward": rendered.motion,
        "depth": rendered.depth,
        "weather.depth": rendered.weather_depth,
    }
    found.update({name: plane for name, plane in together.items() if plane is not None})
    found.update({f"{name}.depth": plane for name, plane in rendered.depths.items()})
    found.update({f"{name}.forward": plane for name, plane in rendered.motions.items()})
    found.update({f"{name}.coverage": plane for name, plane in rendered.coverages.items()})
    for name, ids in rendered.ids.items():
        found[f"{name}.id"] = ((ids.astype(np.int64) + 1) % _MOST_IDS).astype(np.float32)
    return found


def weather(rendered: Rendered) -> Array:
    """Return (H, W, 4) float32: the layers over each other, premultiplied."""
    whole = np.zeros((*rendered.alpha.shape, 4), np.float32)
    for layer in rendered.layers.values():
        whole = layer + (1.0 - layer[..., 3:]) * whole
    return whole


def _light(image: Array) -> Array:
    """Return an image as linear light, premultiplied, with alpha 1 where it has none."""
    light = to_linear(image[..., :3], "display" if image.dtype.kind == "u" else "linear")
    if image.shape[2] == 3:
        return np.concatenate([light, np.ones_like(light[..., :1])], axis=2)
    cover = to_unit(image[..., 3:])
    return np.concatenate([light * cover if image.dtype.kind == "u" else light, cover], axis=2)


def without_alpha(image: Array, path: object) -> Array:
    """Return an image for a file that holds no alpha.

    Raises
    ------
    ValueError
        If something is transparent in it.
    """
    if image.shape[2] == 3:
        return image
    if not (to_unit(image[..., 3]) == 1.0).all():
        raise ValueError(f"{path}: the frame is transparent in places; take .png, .exr or .tif")
    return np.ascontiguousarray(image[..., :3])


def display_bytes(image: Array) -> Array:
    """Return (H, W, 3) uint8 display values of a rendered image."""
    if image.dtype == np.uint8:
        return image
    return to_integer(to_display(image, "display" if image.dtype.kind == "u" else "linear"), 8)
