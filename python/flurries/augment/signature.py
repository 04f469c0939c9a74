"""Arguments that nobody knows: a TypeError that names the nearest one that there is."""

from __future__ import annotations

import difflib
import functools
import inspect
from typing import Any, TypeVar

_Kind = TypeVar("_Kind", bound=type)


def suggests(kind: _Kind) -> _Kind:
    """Return a class whose construction answers unknown names with the nearest known one."""
    make = vars(kind)["__init__"]
    known = [name for name in inspect.signature(make).parameters if name != "self"]

    @functools.wraps(make)
    def checked(self: Any, *args: Any, **kwargs: Any) -> None:
        for name in kwargs:
            if name not in known:
                raise TypeError(unknown(kind.__name__, name, known))
        make(self, *args, **kwargs)

    setattr(kind, "__init__", checked)  # noqa: B010 - mypy refuses the plain assignment
    return kind


def unknown(call: str, name: str, known: list[str]) -> str:
    """Return what is wrong with a name."""
    if name == "seed":
        return f"{call} has no argument seed: seed belongs to the pipeline that draws for it"
    near = difflib.get_close_matches(name, known, 1)
    hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(known)}"
    return f"{call} has no argument {name}; {hint}"
