"""Snow as a population of flakes: drawn one by one, or as the hybrid that looks like it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from flurries import hybrid
from flurries._contract import choice, flag, integer, seed_of
from flurries.effects.color import as_color, color_at
from flurries.effects.motion import comes_nearer
from flurries.frame.layer import Layer
from flurries.frame.view import Frame
from flurries.hybrid.matching import handover_of
from flurries.motion.keys import Number, Vector, as_number, as_vector, value_at
from flurries.spectral.tables import ALIAS
from flurries.trace import stage

METHODS = ("hybrid", "simulated")

_match = lru_cache(maxsize=8)(hybrid.match)


@dataclass(frozen=True, kw_only=True)
class MatchedSnow:
    """Falling snow said in physical terms: how many flakes, how large, from where to where.

    Unlike :class:`TentSnow` it has no look to be tuned: texture and particles follow from the
    flakes, see :func:`flurries.hybrid.match`.

    Parameters
    ----------
    density : float
        Flakes per cubic metre.
    radius : (smallest, largest)
        Metres.
    opacity : float
        Of a flake's middle, above 0 and at most 1.
    depth : (near, far)
        Metres; no snow is nearer or farther.
    fall : float
        Fall speed in still air, metres per second. Keyed.
    wind : (x, y, z)
        Air velocity, metres per second. Keyed.
    color : float, (r, g, b) or "ambient"
        Display values, 0 to 1. Keyed.
    shutter : float
        Exposure in frames. Keyed.
    method : {"hybrid", "simulated"}
        Particles and texture; or every flake, for comparison.
    handover : (low, high)
        Sigma in pixels between which flakes turn from texture into particles.
    tile, overlap : int, optional
        Of the texture, pixels; see :func:`flurries.hybrid.render`. If not given, small and half
        shared where the air comes nearer.
    alias, jitter
        See :func:`flurries.hybrid.render`.
    seed : int, optional
        Of this effect; the scene's if not given.

    Raises
    ------
    ValueError, TypeError
        For an argument outside its range; the message names it. When rendered, for a camera that
        turns: the texture's flakes are known for the depths before one view.

    Examples
    --------
    >>> import flurries as fl
    >>> snow = fl.MatchedSnow(density=60, radius=(0.006, 0.014), depth=(1.5, 24))
    >>> scene = fl.Scene((320, 240), "#203040", effects=[snow])
    >>> scene.render(5).shape
    (240, 320, 3)
    """

    density: float
    radius: tuple[float, float]
    opacity: float = 0.9
    depth: tuple[float, float]
    fall: Number = 1.4
    wind: Vector = (0.36, 0.0, 0.0)
    color: Any = 0.98
    shutter: Number = 0.5
    method: str = "hybrid"
    handover: tuple[float, float] = (0.8, 1.2)
    tile: int | None = None
    overlap: int | None = None
    alias: str = "keep"
    jitter: bool = False
    seed: int | None = None

    NAME: ClassVar[str] = "snow"

    def __post_init__(self) -> None:
        def settle(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        checked = hybrid.Population(
            density=self.density, radius=self.radius, opacity=self.opacity, depth=self.depth
        )
        for name in ("density", "radius", "opacity", "depth"):
            settle(name, getattr(checked, name))
        settle("fall", as_number("fall", self.fall))
        settle("wind", as_vector("wind", self.wind, 3))
        settle("color", as_color(self.color))
        settle("shutter", as_number("shutter", self.shutter, low=0.0))
        choice("method", self.method, METHODS)
        settle("handover", handover_of(self.handover))
        if self.tile is not None:
            settle("tile", integer("tile", self.tile, low=5, high=2**15))
        if self.overlap is not None:
            settle("overlap", integer("overlap", self.overlap, low=0, high=2**15))
        choice("alias", self.alias, ALIAS)
        flag("jitter", self.jitter)
        if self.seed is not None:
            settle("seed", seed_of(self.seed))

    def population(self) -> hybrid.Population:
        """Return the flakes."""
        return hybrid.Population(
            density=self.density, radius=self.radius, opacity=self.opacity, depth=self.depth
        )

    def render(self, frame: Frame) -> Layer:
        """Return this effect's layer of a frame."""
        if frame.path.turns:
            raise ValueError("effects: MatchedSnow needs a camera that does not turn")
        if frame.path.zooms:
            raise ValueError("effects: MatchedSnow needs a lens that does not zoom")
        camera = frame.camera
        # `displacement` has no eye; hybrid's functions add the camera's own.
        options: dict[str, Any] = {
            "seed": frame.seed,
            "displacement": frame.to_camera(frame.displacement(fall=self.fall, wind=self.wind)),
            "velocity": frame.to_camera(frame.velocity(fall=self.fall, wind=self.wind)),
            "shutter": value_at(self.shutter, frame.t),
            "depth": frame.depth,
        }
        with stage(self.method):
            if self.method == "simulated":
                alpha = hybrid.simulate(frame.shape, self.population(), camera, **options)
            else:
                made = _match(self.population(), camera.focal, handover=self.handover)
                tile, overlap = self._tiles(frame, made)
                alpha = hybrid.render(
                    frame.shape, made, camera, tile=tile, overlap=overlap, alias=self.alias,
                    jitter=self.jitter, **options,
                )  # fmt: skip
        return Layer(
            self.NAME, np.ascontiguousarray(frame.crop(alpha)), color_at(self.color, frame)
        )

    def _tiles(self, frame: Frame, made: hybrid.Match) -> tuple[int, int]:
        """Return tile and overlap: smaller, and more of them mixed, where the air comes nearer."""
        axis = frame.camera.matrix()[:, 2]
        forward = comes_nearer(frame.path, axis, self.fall, self.wind)
        longest = round(made.wavelengths[1])
        tile = self.tile or (2 if forward else 4) * longest
        overlap = self.overlap if self.overlap is not None else tile // (2 if forward else 8)
        return tile, min(overlap, tile - 1)
