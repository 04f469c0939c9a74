"""What is made while the one before it is looked at."""

from collections.abc import Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any


def ahead(parts: Iterator[Any]) -> Generator[Any, None, None]:
    """Yield parts, none of which is None, and make the next one while one is looked at."""
    with ThreadPoolExecutor(1) as maker:
        coming = maker.submit(next, parts, None)
        while (one := coming.result()) is not None:
            coming = maker.submit(next, parts, None)
            yield one
