"""What an effect answers: its part of a frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flurries._contract import Array

# The planes that a layer may have beside its opacity, and the numbers that each has for a pixel.
_NUMBERS: dict[str, tuple[int, ...]] = {
    "rgb": (3,), "glow": (3,), "depth": (), "motion": (2,), "backward": (2,), "coverage": (),
    "ids": (), "near": (),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Shade:
    """Colors at the middles of cells of a frame, linear between them."""

    colors: Array  # (rows, columns, 3) float32, linear light.
    cell: float  # Side, px.
    first: tuple[int, int]  # (row, column) of the frame that the layer begins at.
    display: Array | None = None  # Their display values, where these are kept.

    def given(self, colors: Array | None = None) -> tuple[Array, float, int, int]:
        """Return the shade as kernels read it, with other colors if given."""
        chosen = self.colors if colors is None else colors
        return np.ascontiguousarray(chosen, np.float32), float(self.cell), *self.first


@dataclass(frozen=True)
class Layer:
    """One effect's part of a frame.

    Attributes
    ----------
    name : str
        Name of the layer: letters, digits and "_", parts joined by "." as in layers of an EXR.
    alpha : (h, w) float32
        Opacity over the window, 0 to 1.
    color : (r, g, b)
        Its one color, display values 0 to 1; not used where `rgb` is given.
    rgb : (h, w, 3) float32, optional
        Color of each pixel, linear light multiplied by alpha. Light without opacity (a glow) shows
        in linear light only: display values have no way to add it.
    depth, motion, backward, coverage, ids : optional
        See :class:`flurries.scene.Rendered`'s layers: (h, w), (h, w, 2), (h, w, 2) and (h, w)
        float32, and (h, w) int64.
    shade, glow : Shade, (h, w, 3) float32, optional
        A color that changes slowly over the frame, in place of `color`, and additional light beside
        that, linear and multiplied by opacity.
    """

    name: str
    alpha: Array
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    rgb: Array | None = None
    depth: Array | None = None
    motion: Array | None = None
    backward: Array | None = None
    coverage: Array | None = None
    ids: Array | None = None
    shade: Shade | None = None
    glow: Array | None = None
    near: Array | None = None  # Where pixels show two depths the opacity before the near one.

    def planes(self) -> dict[str, Array]:
        found = {name: getattr(self, name) for name in ("alpha", *_NUMBERS)}
        return {name: plane for name, plane in found.items() if plane is not None}

    def turned(self, turn: Callable[[Array], Array], *names: str) -> Layer:
        """Return the layer with some of its planes changed, those that are given."""
        changes: dict[str, Any] = {
            name: np.ascontiguousarray(turn(plane))
            for name, plane in self.planes().items()
            if name in names
        }
        return replace(self, **changes)


def layers_of(answer: object, effect: object, shape: tuple[int, int]) -> tuple[Layer, ...]:
    """Return the result of an effect as layers, or refuse anything else."""
    layers = []
    for layer in answer if isinstance(answer, (tuple, list)) else (answer,):
        if not isinstance(layer, Layer):
            raise TypeError(
                f"effects: {type(effect).__name__}.render must return a Layer or a tuple of them, "
                f"got {type(layer).__name__}"
            )
        planes: dict[str, Any] = {"alpha": layer.alpha, **layer.planes()}
        for name, given in planes.items():
            kind = getattr(given, "dtype", type(given).__name__)
            own = np.dtype(np.int64 if name == "ids" else np.float32)
            wanted = (*shape, *_NUMBERS.get(name, ()))
            if not isinstance(given, np.ndarray) or kind != own or given.shape != wanted:
                raise TypeError(
                    f"effects: {name} of the layer {layer.name!r} must be {own} of shape "
                    f"{wanted}, got {kind} of shape {np.shape(given)}"
                )
        if not all(part.flags.c_contiguous for part in planes.values()):
            # Windows cut out of a whole frame; kernels read rows that follow each other.
            layer = layer.turned(np.asarray, *planes)
        layers.append(layer)
    return tuple(layers)
