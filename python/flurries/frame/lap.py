"""A film that begins again after some frames."""

from __future__ import annotations

from typing import NamedTuple


class Lap(NamedTuple):
    """The frames of a film that come over and over."""

    first: int
    frames: int  # How many: frame `first + frames` is frame `first` again.

    @property
    def end(self) -> int:
        """The frame that is the first again."""
        return self.first + self.frames

    def place(self, t: float) -> float:
        """Return the frame of the first round that a frame is."""
        return self.first + (t - self.first) % self.frames

    def part(self, t: float) -> float:
        """Return the share of the round that has passed, 0 to 1."""
        return (t - self.first) / self.frames
