"""Many values in one case: `@every` in the place of `@pytest.mark.parametrize`."""

import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any


def every(names: str | tuple[str, ...], values: Iterable[Any]) -> Callable[..., Any]:
    """Call a test with each of the values; a failure says with which."""
    arguments = [n.strip() for n in names.split(",")] if isinstance(names, str) else list(names)
    rows = list(values)
    assert rows, "a test of nothing"

    def decorate(test: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(test)
        def tested(**given: Any) -> None:
            for row in rows:
                named = dict(zip(arguments, row if len(arguments) > 1 else [row], strict=True))
                try:
                    test(**given, **named)
                except Exception as error:
                    raise AssertionError(f"with {named!r:.500}: {error}") from error

        signature = inspect.signature(test)
        left = [p for p in signature.parameters.values() if p.name not in arguments]
        tested.__signature__ = signature.replace(parameters=left)  # type: ignore[attr-defined]
        del tested.__wrapped__
        return tested

    return decorate
