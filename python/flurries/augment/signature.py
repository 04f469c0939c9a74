"""Arguments of weathers and of their transforms for pipelines.

The fields of a weather stand twice: as a dataclass, which checks and documents them, and here as
types of keywords, which say to type checkers what a transform of another library takes. What
``help`` shows is made of the first, and ``tests/test_types.py`` compares the two.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
from typing import Any, TypedDict, TypeVar

from flurries._contract import suggestion
from flurries.augment.calibration import Profile
from flurries.augment.distance import Ground
from flurries.augment.draws import Range

_Kind = TypeVar("_Kind", bound=type)


class Fields(TypedDict, total=False):
    """Arguments of every weather in a pipeline: all but its `seed`, which the pipeline has."""

    amount: Range | None
    severity: int | tuple[int, int] | None
    profile: Profile
    color: Range | tuple[float, float, float]
    ground: Ground | None
    focal: float
    white: float
    weather_seed: int | None
    wind: Range


class FallingFields(Fields, total=False):
    """Arguments of snow and rain."""

    veil: float
    fall: Range
    exposure: Range


class FogFields(Fields, total=False):
    """Arguments of fog."""

    visibility: Range | None
    patches: Range


def suggests(kind: _Kind) -> _Kind:
    """Return a class whose construction answers unknown names with the nearest known one.

    Where it takes ``**weather`` its signature has the fields of the weather `KIND` in place of it.
    """
    make = vars(kind)["__init__"]
    signature = inspect.signature(make)
    given = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
    if len(given) < len(signature.parameters):
        given += [
            inspect.Parameter(
                f.name, inspect.Parameter.KEYWORD_ONLY, default=f.default, annotation=f.type
            )
            for f in dataclasses.fields(vars(kind)["KIND"])
            if f.name != "seed"
        ]
    known = [parameter.name for parameter in given if parameter.name != "self"]

    @functools.wraps(make)
    def checked(self: Any, *args: Any, **kwargs: Any) -> None:
        for name in kwargs:
            if name not in known:
                raise TypeError(unknown(kind.__name__, name, known))
        make(self, *args, **kwargs)

    vars(checked)["__signature__"] = signature.replace(parameters=given)
    setattr(kind, "__init__", checked)  # noqa: B010 - mypy refuses the plain assignment
    return kind


def unknown(call: str, name: str, known: list[str]) -> str:
    """Return the complaint about an unknown argument."""
    if name == "seed":
        return f"{call} has no argument seed: seed belongs to the pipeline that draws for it"
    hint = suggestion(name, known) or f"; it has {', '.join(known)}"
    return f"{call} has no argument {name}{hint}"
