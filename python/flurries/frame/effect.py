"""What may stand in a scene's list of effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from flurries.frame.layer import Layer
    from flurries.frame.view import Frame


class Effect(Protocol):
    """Anything that shows something in a frame: one of flurries' effects, or one of your own."""

    def render(self, frame: Frame, /) -> Layer | Sequence[Layer]:
        """Return what a frame shows of the effect."""
        ...
