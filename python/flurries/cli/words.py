"""Words for people, to stderr: sentences, warnings, progress. Data goes to stdout."""

import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, cast

from flurries._trace import Trace

EVERY = 10.0  # A log gets a line of progress this often, in seconds.


def say(text: object) -> None:
    print(f"flurries: {' '.join(str(text).split())}", file=sys.stderr)


def count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


@contextmanager
def plain_warnings() -> Iterator[None]:
    """Show warnings as sentences, without the line of source that they come from."""
    with warnings.catch_warnings():
        warnings.showwarning = cast(Any, lambda message, *_, **__: say(f"warning: {message}"))
        yield


@dataclass(frozen=True)
class Words:
    """The words of a command: fewer when quiet, more when verbose."""

    quiet: bool = False  # Only warnings and errors.
    verbose: bool = False  # Also the plan, and the time of each stage.

    def say(self, text: object) -> None:
        if not self.quiet:
            say(text)

    def progress(self, noun: str) -> Callable[[Iterable[Any]], Iterable[Any]]:
        """Return the progress of a loop: a bar on a terminal, lines in a log."""
        if self.quiet:
            return iter
        if not sys.stderr.isatty():
            return lambda items: lines(items, noun)
        from tqdm import tqdm

        return partial(tqdm, unit=noun, file=sys.stderr, dynamic_ncols=True)


def lines(items: Any, noun: str, *, every: float = EVERY) -> Iterator[Any]:
    """Yield items, and now and then write a line that says how many are done."""
    total = len(items)
    began = said = time.monotonic()
    for done, item in enumerate(items):
        now = time.monotonic()
        if done and now - said >= every:
            left = (now - began) / done * (total - done)
            say(f"{done} of {count(total, noun)}, {left:.0f} s left")
            said = now
        yield item


def stages(trace: Trace, frames: int) -> str:
    spent = {name: 1e3 * seconds / frames for name, seconds in trace.sums("seconds").items()}
    parts = ", ".join(f"{name} {time:.1f}" for name, time in spent.items())
    return f"{sum(spent.values()):.1f} ms a frame: {parts}"
