"""What an effect says about a frame before it is made, and what the plan then lets it do.

An effect has one method for it, ``needs(frame) -> Needs``: its steps, what it leaves out by itself
and why, and which parts of the scene it reads. An effect without the method is rendered whenever it
is in the scene, and given everything.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from flurries._contract import Array
from flurries._kept import Kept
from flurries._threads import reproducible
from flurries._trace import current
from flurries.frame.bands import Visible
from flurries.motion.keys import Keys

if TYPE_CHECKING:
    from flurries.frame.view import Frame

_Made = TypeVar("_Made")
_P = ParamSpec("_P")

# What an effect can read of a scene beside its own arguments; each costs something to make.
PARTS = frozenset({"depth", "ambient"})


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
    # Whether the needs differ over time although nothing of the effect is keyed, such as for a
    # cloud that the camera passes.
    varies: bool = False
    brightest: float = 1.0  # The largest of the colors' values, at least 1.


def renderer_of(effect: Any) -> Any:
    """Return what renders an effect: itself, or its parts; None for what is no effect."""
    own = callable(getattr(effect, "render", None))
    found = effect if own else getattr(effect, "parts", None)
    return found if callable(getattr(found, "render", None)) else None


def needs_of(effect: Any, frame: Frame) -> Needs:
    """Return the needs that an effect states, or all there is if it states none."""
    own = getattr(renderer_of(effect), "needs", None)
    if own is None:
        ambient = getattr(effect, "color", None) == "ambient"
        return Needs(
            (Step(type(effect).__name__.lower()),), reads=PARTS if ambient else PARTS - {"ambient"}
        )
    said = own(frame)
    if not isinstance(said, Needs):
        kind = type(effect).__name__
        raise TypeError(f"effects: {kind}.needs must return Needs, got {type(said).__name__}")
    return said


def has_keys(value: Any, depth: int = 3) -> bool:
    """Whether something varies over time: holds keys, or cannot be looked into."""
    if isinstance(value, Keys):
        return True
    if depth == 0:
        return False
    if is_dataclass(value):
        return any(has_keys(getattr(value, f.name, None), depth - 1) for f in fields(value))
    if isinstance(value, (tuple, list)) and len(value) <= 16:
        return any(has_keys(one, depth - 1) for one in value)
    return False


def _read_only(found: _Made) -> _Made:
    """Return what all frames share, so that none writes to it."""
    for part in (found, getattr(found, "alpha", None), getattr(found, "rgb", None)):
        if isinstance(part, np.ndarray):
            part.flags.writeable = False
    return found


@dataclass(frozen=True)
class Run:
    """The plan's hand in a frame: calling it runs a step, if the step is planned."""

    steps: Mapping[str, Step]
    # Where results that are the same in every frame are found, and under which key.
    kept: Kept | None = None
    key: Any = None
    visible: Visible | None = None  # Where anything of the effect can be seen; None is everywhere.

    def keeps(self, name: str) -> bool:
        """Whether the step is made once for all frames."""
        step = self.steps.get(name)
        return step is not None and step.once and self.kept is not None

    def __call__(
        self, name: str, make: Callable[_P, _Made], *args: _P.args, **kwargs: _P.kwargs
    ) -> _Made | None:
        """Return the product of the step, or None where it is left out."""
        if name not in self.steps:
            return None

        def run() -> _Made:
            with current.get().stage(name):
                return make(*args, **kwargs)

        kept = self.kept if self.keeps(name) else None
        return run() if kept is None else kept.once((self.key, name), lambda: _read_only(run()))


# Results that are kept of one depth: planes of a picture, most of them.
_MOST = 8

_KEPT: dict[int, tuple[weakref.ref[Array], Kept]] = {}


def standing(
    frame: Frame, owner: object, name: str, key: Hashable, make: Callable[[], _Made]
) -> _Made:
    """Return what `make` makes of the frame's depth over its window; if that stays, once."""
    # Made of the depth, the window, `owner` and `key`. Nothing may be written to it afterwards. A
    # frame in bands finds it anew: it would be as large as many of its bands.
    depth = frame.depth
    assert depth is not None
    if frame.banded or depth.flags.writeable:
        return frame.here(owner, f"{name}, side {frame.side}", make)
    number = id(depth)
    there = _KEPT.get(number)
    if there is None or there[0]() is not depth:
        there = _KEPT[number] = weakref.ref(depth, lambda _: _KEPT.pop(number, None)), Kept(_MOST)
    return there[1].once((owner, name, key, frame.window, reproducible()), make)
