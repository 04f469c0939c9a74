"""Effects that are made of parts: what frames ask of them, their parts answer."""

from __future__ import annotations

from typing import Any

from flurries._contract import Array
from flurries.effects.color import LOCAL
from flurries.effects.described import Described
from flurries.frame.layer import Layer, Light
from flurries.frame.needs import Needs
from flurries.frame.view import Frame


class Composed(metaclass=Described):
    """An effect that is made of parts."""

    parts: Any
    color: Any

    @property
    def lit_by_places(self) -> bool:
        """Whether its color differs over the frame: light of that kind is mixed as light."""
        return isinstance(self.color, str) and self.color == LOCAL

    def needs(self, frame: Frame) -> Needs:
        """Return what a frame takes: its steps, and what is left out."""
        needs: Needs = self.parts.needs(frame)
        return needs

    def render(self, frame: Frame) -> Layer | tuple[Layer, ...]:
        """Return the layer of a frame, or one for each population that takes its turn."""
        made: Layer | tuple[Layer, ...] = self.parts.render(frame)
        return made


class Tented(Composed):
    """An effect with the paper's texture, which may lie over a picture in one pass."""

    def over(self, frame: Frame, behind: Array, light: Light) -> Array | None:
        """Return the layer over a picture in one pass, or None where there is no such way."""
        laid: Array | None = self.parts.over(frame, behind, light)
        return laid

    def warn_ambiguous(
        self, shape: tuple[int, int], focal: float, distance: float, index: int
    ) -> None:
        """Warn if two eyes see the texture half a wavelength apart or more."""
        self.parts.texture.warn_ambiguous(shape, focal, distance, index)
