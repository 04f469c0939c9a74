"""The layers of a frame under the names that files and compositors have for them."""

from __future__ import annotations

from typing import Any

import numpy as np

from flurries._contract import Array
from flurries.frame.truth import Rendered
from flurries.io.color import light_of


def planes(rendered: Rendered, *, up: bool = False) -> dict[str, Array]:
    """Return a frame as the layers of an EXR, see `flurries.io.write_layers`."""

    def turned(motion: Array | None) -> Any:
        return motion * np.array([1.0, -1.0], np.float32) if up and motion is not None else motion

    found = {
        "rgba": opaque(rendered.image),
        "alpha": rendered.alpha,
        "background": rendered.background,
        "foreground": rendered.foreground,
        "forward": turned(rendered.motion),
        "backward": turned(rendered.backward),
        "depth": rendered.depth,
        "weather.depth": rendered.weather_depth,
    }
    for name, layer in rendered.layers.items():
        found |= {
            name: layer.rgba,
            f"{name}.depth": layer.depth,
            f"{name}.forward": turned(layer.motion),
            f"{name}.backward": turned(layer.backward),
            f"{name}.coverage": layer.coverage,
            f"{name}.id": None if layer.ids is None else np.maximum(layer.ids, 0),
        }
    return {name: plane for name, plane in found.items() if plane is not None}


def opaque(image: Array) -> Array:
    """Return an image as premultiplied light with alpha, which is 1 where it has none."""
    light = light_of(image)
    alpha = np.ones_like(light[..., :1])
    return light if light.shape[2] == 4 else np.concatenate([light, alpha], axis=2)


def order(rendered: Rendered) -> str:
    front = [] if rendered.foreground is None else ["foreground"]
    return ", ".join(["background", *rendered.layers, *front])


def weather(rendered: Rendered) -> Array:
    """Return (H, W, 4) float32: the layers over each other, premultiplied."""
    whole = np.zeros((*rendered.alpha.shape, 4), np.float32)
    for layer in rendered.layers.values():
        whole = layer.rgba + (1.0 - layer.rgba[..., 3:]) * whole
    return whole
