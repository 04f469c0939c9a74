"""Pictures by the shot's own frame numbers: frame 1003 is plate 1003, depth 1003, matte 1003."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries._contract import Array
from flurries._kept import Kept
from flurries.io.sequences import Span
from flurries.io.sources import VideoSource

if TYPE_CHECKING:
    from typing_extensions import Self

Display = tuple[int, int, int, int]  # (left, top, width, height), px.


@dataclass(frozen=True, eq=False)
class Planes:
    """What is made of one picture, or of each of some files; the last one is kept."""

    given: Any = None  # The picture, where there are no files.
    source: Any = None  # The files, whose frames count from 0.
    span: Span | None = None  # The numbers of the files in the shot; None of what serves all.
    steps: tuple[Callable[[Any], Any], ...] = ()
    kept: Kept = field(default_factory=partial(Kept, 1))

    @classmethod
    def of(
        cls, name: str, source: Any, *steps: Any, extend: str = "stop", start: int | None = None,
        **more: Any,
    ) -> Self:  # fmt: skip
        """Return what is made of files; a film has no numbers of its own: `start`."""
        if source.count is None:
            return cls(None, source, None, steps, **more)
        first = getattr(source, "first", 0)
        # A source of somebody's own counts from 0, and knows no numbers either.
        if start is not None and (isinstance(source, VideoSource) or not hasattr(source, "first")):
            first = start
        called = f"{name} {Path(source.spec).name}" if hasattr(source, "spec") else name
        span = Span(called, first, first + source.count - 1, extend)
        return cls(None, source, span, steps, **more)

    @property
    def still(self) -> bool:
        return self.span is None

    @property
    def spec(self) -> str | None:
        """Where the files are; None of an array, a color and somebody's own source."""
        return getattr(self.source, "spec", None)

    def then(self, step: Callable[[Any], Any]) -> Self:
        return replace(self, steps=(*self.steps, step), kept=Kept(1))

    def frame(self, t: float) -> Any:
        if self.source is None and not self.steps:
            return self.given
        place = self.place(t)

        def make() -> Any:
            made = self.given if self.source is None else self.source.frame(place)
            for step in self.steps:
                made = step(made)
            return made

        return self.kept.once(place, make)

    def place(self, t: float) -> int:
        """Return the place in the source, from 0, of frame floor(t); ValueError if it has none."""
        return 0 if self.span is None else self.span.number(math.floor(t)) - self.span.first

    def beyond(self, t: float) -> int:
        """Return how far beyond the first or the last picture, which is held, floor(t) lies."""
        if self.span is None or self.span.extend != "hold":
            return 0
        return math.floor(t) - self.span.number(math.floor(t))

    def file(self, t: float) -> Path:
        found: Path = self.source.file(self.place(t))
        return found

    def gaps(self, wanted: list[int]) -> list[int]:
        if self.span is None or not hasattr(self.source, "gaps"):
            return []
        numbers = {number: self.span.number(number) for number in wanted}
        missing = set(self.source.gaps(sorted({*numbers.values()})))
        return [number for number, own in numbers.items() if own in missing]


def placed(
    plane: Array, own: Display | None, shape: tuple[int, int], display: Display | None,
    fitted: Callable[[Array, tuple[int, int]], Array], outside: float,
) -> Array:  # fmt: skip
    """Return a plane of a depth or a matte, with the overscan that its file has, for the frame."""
    # `own` is the display window in the plane and `display` that in the frame, None if it is all;
    # `fitted` brings a plane to a (width, height), and `outside` stands beside the display window.
    if plane.shape[:2] == shape:
        return plane
    if own is not None:
        left, top, width, height = own
        plane = np.ascontiguousarray(plane[top : top + height, left : left + width])
    if display is None:
        return fitted(plane, shape[::-1])
    left, top, width, height = display
    inner = plane if plane.shape[:2] == (height, width) else fitted(plane, (width, height))
    whole = np.full((*shape, *inner.shape[2:]), outside, inner.dtype)
    whole[top : top + height, left : left + width] = inner
    return whole
