"""What is made while the one before it is looked at."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any


class Ahead(Iterator[Any]):
    """Parts, none of which is None, whose next one is made while one is looked at."""

    # No generator: what collects garbage would end it, and wait for its thread where none may wait.
    def __init__(self, parts: Iterator[Any]) -> None:
        self._parts, self._maker = parts, ThreadPoolExecutor(1)
        self._coming = self._maker.submit(next, parts, None)

    def __next__(self) -> Any:
        if (one := self._coming.result()) is None:
            self.close()
            raise StopIteration
        self._coming = self._maker.submit(next, self._parts, None)
        return one

    def close(self) -> None:
        """Wait for what is being made, and make no more."""
        self._maker.shutdown()
