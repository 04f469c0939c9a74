"""Files by the shot's own frame numbers: frame 1003 is plate 1003, depth 1003 and matte 1003."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from flurries.io.sequences import Span
from flurries.io.sources import VideoSource

_Made = TypeVar("_Made")


@dataclass(frozen=True, eq=False)
class Numbered:
    """A source of pictures, asked by the numbers of the shot."""

    source: Any  # The files, whose frames count from 0.
    span: Span | None  # Their numbers; None of a still, which serves all.

    @staticmethod
    def of(name: str, source: Any, *, extend: str, start: int | None = None) -> Numbered:
        """Return a source with its numbers; a film has none of its own: `start`."""
        if source.count is None:
            return Numbered(source, None)
        first = getattr(source, "first", 0)
        # A source of somebody's own counts from 0, and knows no numbers either.
        if start is not None and (isinstance(source, VideoSource) or not hasattr(source, "first")):
            first = start
        called = f"{name} {Path(source.spec).name}" if hasattr(source, "spec") else name
        return Numbered(source, Span(called, first, first + source.count - 1, extend))

    def place(self, t: float) -> int:
        """Return the place in the source, from 0, of frame floor(t); ValueError if it has none."""
        if self.span is None:
            return 0
        return self.span.number(math.floor(t)) - self.span.first

    def frame(self, t: float) -> Any:
        """Return the picture of frame floor(t)."""
        return self.source.frame(self.place(t))

    def file(self, t: float) -> Path:
        """Return the file that frame floor(t) is in."""
        found: Path = self.source.file(self.place(t))
        return found

    def gaps(self, wanted: list[int]) -> list[int]:
        """Return the wanted numbers whose file is missing."""
        if self.span is None or not hasattr(self.source, "gaps"):
            return []
        numbers = {number: self.span.number(number) for number in wanted}
        missing = set(self.source.gaps(sorted({*numbers.values()})))
        return [number for number, own in numbers.items() if own in missing]


class Last:
    """What was made of the last frame's parts; in a copy or another process it begins anew."""

    def __init__(self) -> None:
        self.kept: tuple[tuple[Any, ...], Any] | None = None

    def of(self, parts: tuple[Any, ...], make: Callable[[], _Made]) -> _Made:
        """Return what `make` makes of numbers, or of objects that are the very same."""
        # Files give the very same picture again while they keep it.
        kept = self.kept
        if kept is None or not all(map(_same, parts, kept[0])):
            kept = self.kept = parts, make()
        made: _Made = kept[1]
        return made

    def __reduce__(self) -> tuple[type[Last], tuple[()]]:
        return Last, ()


def _same(one: object, other: object) -> bool:
    return one is other or (type(one) is int and one == other)
