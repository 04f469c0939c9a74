"""What an effect says about a frame before it is made; without `needs` it is given everything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from flurries.motion.keys import Keys

if TYPE_CHECKING:
    from flurries.frame.layer import Layer
    from flurries.frame.view import Frame

# What an effect can read of a scene beside its own arguments; each costs something to make.
PARTS = frozenset({"depth", "ambient"})


class Renders(Protocol):
    """Anything that shows something in a frame."""

    def render(self, frame: Frame, /) -> Layer | Sequence[Layer]:
        """Return the layer or layers of the effect in a frame."""
        ...


class Composed(Protocol):
    """An effect whose `parts` are drawn in its place."""

    # `Renders` in truth: pyright does not look into the cached property that effects have.
    @property
    def parts(self) -> object:
        """The parts that render the effect."""
        ...


Effect: TypeAlias = Renders | Composed  # One of flurries' effects, or one of your own.


@dataclass(frozen=True)
class LeftOut:
    """Something that is not done, and why."""

    what: str
    why: str


@dataclass(frozen=True)
class Step:
    """A part of an effect's work that can be left out or kept."""

    name: str  # What the trace calls it.
    once: bool = False  # Whether all frames have the same, for a camera and depth that stand still.


@dataclass(frozen=True)
class Needs:
    """The needs of an effect for a frame: its steps."""

    steps: tuple[Step, ...]  # In their order. None: the effect shows nothing, and is not rendered.
    left_out: tuple[LeftOut, ...] = ()
    # The scene's "depth" and "ambient" light; "plate" is that light by places.
    reads: frozenset[str] = frozenset()
    most: float = 1.0  # The largest opacity.
    # Whether the effect draws any window by itself, in its share of the whole's time: a large frame
    # is then made in bands of rows. Else the whole is drawn once, and held.
    by_rows: bool = False
    brightest: float = 1.0  # The largest of the colors' values, at least 1.

    @staticmethod
    def none(what: str, why: str) -> Needs:
        return Needs((), (LeftOut(what, why),), most=0.0)


def renderer_of(effect: Any) -> Any:
    """Return what renders an effect: itself, or its parts; None for what is no effect."""
    own = callable(getattr(effect, "render", None))
    found = effect if own else getattr(effect, "parts", None)
    return found if callable(getattr(found, "render", None)) else None


def needs_of(effect: Any, frame: Frame) -> Needs:
    """Return the needs that an effect states, or all there is if it states none."""
    own, kind = getattr(renderer_of(effect), "needs", None), type(effect).__name__
    if own is None:
        ambient = getattr(effect, "color", None) == "ambient"
        return Needs((Step(kind.lower()),), reads=PARTS if ambient else PARTS - {"ambient"})
    said = own(frame)
    if not isinstance(said, Needs):
        raise TypeError(f"effects: {kind}.needs must return Needs, got {type(said).__name__}")
    return said


def has_keys(value: Any, depth: int = 3) -> bool:
    """Whether something varies over time: holds keys, or cannot be looked into."""
    if isinstance(value, Keys) or depth == 0:
        return isinstance(value, Keys)
    if is_dataclass(value):
        return any(has_keys(getattr(value, f.name, None), depth - 1) for f in fields(value))
    several = isinstance(value, (tuple, list)) and len(value) <= 16
    return several and any(has_keys(one, depth - 1) for one in value)
