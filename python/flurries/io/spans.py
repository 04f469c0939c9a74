"""The frame numbers that files have, and what stands for a number that they do not have."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

# What becomes of a number outside: an error, the first or last frame, or the frames over again.
EXTEND = ("stop", "hold", "loop")


def words_of(frames: Iterable[int]) -> str:
    """Return frame numbers as people write them: "1001-1003,1007"."""
    from fileseq import framesToFrameRange

    found = str(framesToFrameRange(frames, sort=True))
    return found if len(found) <= 80 else f"{found[:77]}..."


@dataclass(frozen=True)
class Span:
    name: str  # What has them, for messages: "depth depth.%04d.exr".
    first: int
    last: int
    extend: str = "stop"  # What stands for a number outside.

    @property
    def words(self) -> str:
        return f"{self.first}" if self.first == self.last else f"{self.first}-{self.last}"

    def number(self, wanted: int) -> int:
        """Return the number, from first to last, that stands for a number."""
        if self.first <= wanted <= self.last:
            return wanted
        if self.extend == "stop":
            raise ValueError(self.complaint([wanted]))
        if self.extend == "hold":
            return min(max(wanted, self.first), self.last)
        return self.first + (wanted - self.first) % (self.last - self.first + 1)

    def outside(self, wanted: Iterable[int]) -> list[int]:
        """Return the numbers that nothing stands for."""
        if self.extend != "stop":
            return []
        return [number for number in wanted if not self.first <= number <= self.last]

    def complaint(self, wanted: Iterable[int]) -> str:
        numbers = list(wanted)
        noun = "frame" if len(numbers) == 1 else "frames"
        return (
            f"{noun} {words_of(numbers)} of the shot: the {self.name} has {self.words}; "
            "extend='hold' repeats its ends, extend='loop' repeats all of it"
        )
