"""What ran, how long it took and what it allocated: off unless asked for."""

import time
import tracemalloc
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any, ClassVar


@dataclass
class Span:
    """The runs of one stage of one effect."""

    seconds: float = 0.0  # Without those of stages inside.
    calls: int = 0
    bytes: int = 0  # The most above what was there when it began; 0 where memory is not traced.
    counts: dict[str, int] = field(default_factory=dict)


class Trace:
    """The stages that ran: spans by (effect, stage), -1 being the scene, and what was outside."""

    def __init__(self, *, memory: bool = False) -> None:
        self.spans: dict[tuple[int, str], Span] = {}
        self.bytes = 0  # The most that was allocated at a time, where memory is traced.
        self.outside = Span()
        self._memory, self._effect = memory, -1
        self._open: list[tuple[Span, int]] = []
        self._since = time.perf_counter()
        self._held = tracemalloc.get_traced_memory()[0] if memory else 0

    def sums(self, what: str) -> dict[str, Any]:
        """Return the "seconds" or "calls" of each stage, of all effects together."""
        found: Counter[str] = Counter()
        for (_, name), span in self.spans.items():
            found[name] += getattr(span, what)
        return dict(found)

    def _now(self) -> Span:
        return self._open[-1][0] if self._open else self.outside

    def _look(self) -> int:
        """Give the time and the memory since the last look to the stages that are open."""
        now = time.perf_counter()
        self._now().seconds += now - self._since
        held = 0
        if self._memory:
            held, most = tracemalloc.get_traced_memory()
            self.bytes = max(self.bytes, most - self._held)
            for span, before in self._open:
                span.bytes = max(span.bytes, most - before)
            tracemalloc.reset_peak()
        self._since = now
        return held

    def count(self, name: str, number: int) -> None:
        """Add to the counts of the stage that runs."""
        counts = self._now().counts
        counts[name] = counts.get(name, 0) + number

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Mark a stage of the work."""
        held = self._look()
        span = self.spans.setdefault((self._effect, name), Span())
        span.calls += 1
        self._open.append((span, held))
        try:
            yield
        finally:
            self._look()
            self._open.pop()

    @contextmanager
    def of_effect(self, effect: int) -> Iterator[None]:
        """Mark the stages inside as those of the scene's effect of a number."""
        before, self._effect = self._effect, effect
        try:
            yield
        finally:
            self._effect = before


class _Off:
    """Nobody traces: the calls of a trace, at no cost."""

    stage: ClassVar[Any] = nullcontext
    of_effect: ClassVar[Any] = nullcontext

    def count(self, name: str, number: int) -> None:
        """Do nothing."""


_OFF = _Off()

current: ContextVar[Trace | _Off] = ContextVar("flurries_trace", default=_OFF)


@contextmanager
def tracing(*, memory: bool = False) -> Iterator[Trace]:
    """Collect the stages that run inside, with memory by `tracemalloc` if asked for."""
    starts = memory and not tracemalloc.is_tracing()
    if starts:
        tracemalloc.start()
    trace = Trace(memory=memory)
    token = current.set(trace)
    try:
        yield trace
    finally:
        current.reset(token)
        trace._look()
        if starts:
            tracemalloc.stop()
