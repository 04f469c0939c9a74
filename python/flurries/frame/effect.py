"""What may stand in a scene's list of effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol, TypeAlias

if TYPE_CHECKING:
    from flurries.frame.layer import Layer
    from flurries.frame.view import Frame


class Renders(Protocol):
    """Anything that shows something in a frame."""

    def render(self, frame: Frame, /) -> Layer | Sequence[Layer]:
        """Return the layer or layers of the effect in a frame."""
        ...


class Composed(Protocol):
    """Anything that says what it is made of."""

    # `Renders` in truth: pyright does not look into the cached property that effects have.
    @property
    def parts(self) -> object:
        """The parts that render the effect."""
        ...


# One of flurries' effects, or one of your own.
Effect: TypeAlias = Renders | Composed
