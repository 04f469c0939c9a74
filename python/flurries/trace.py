"""What ran, and how long it took: off unless asked for."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

__all__ = ["Trace", "count", "stage", "tracing"]


@dataclass
class Trace:
    """The steps that ran.

    Attributes
    ----------
    seconds, calls : dict
        Of each stage, in the order of their first run.
    counts : dict of str to int
        How much was done inside: "tiles" transformed, "particles" drawn.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    calls: dict[str, int] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)

    def add(self, name: str, seconds: float) -> None:
        """Count one run of a stage."""
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds
        self.calls[name] = self.calls.get(name, 0) + 1

    def milliseconds(self, name: str) -> float:
        """Return the mean of a stage in milliseconds for each run."""
        return 1e3 * self.seconds[name] / self.calls[name]


_current: ContextVar[Trace | None] = ContextVar("flurries_trace", default=None)


def count(name: str, number: int) -> None:
    """Add to what was counted, if anybody traces."""
    trace = _current.get()
    if trace is not None:
        trace.counts[name] = trace.counts.get(name, 0) + number


@contextmanager
def tracing() -> Iterator[Trace]:
    """Collect the stages that run inside.

    Examples
    --------
    >>> import flurries as fl
    >>> scene = fl.Scene((64, 48), "#000000", effects=[fl.TentSnow(flakes=0)])
    >>> with fl.trace.tracing() as trace:
    ...     frame = scene.render(3)
    >>> list(trace.calls)
    ['background', 'texture', 'composite']
    """
    trace = Trace()
    token = _current.set(trace)
    try:
        yield trace
    finally:
        _current.reset(token)


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Mark a stage of the work."""
    trace = _current.get()
    if trace is None:
        yield
        return
    start = time.perf_counter()
    try:
        yield
    finally:
        trace.add(name, time.perf_counter() - start)
