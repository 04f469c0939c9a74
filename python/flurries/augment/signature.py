"""Arguments of weathers and of their transforms for pipelines, also as types of keywords."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Iterator
from typing import Any, TypedDict, TypeVar

from flurries._contract import suggestion
from flurries.augment.calibration import Profile
from flurries.augment.distance import Ground
from flurries.augment.draws import Range

_Kind = TypeVar("_Kind", bound=type)


class Fields(TypedDict, total=False):
    """Arguments of all weathers in a pipeline: but `seed`, which the pipeline has."""

    amount: Range | None
    severity: int | tuple[int, int] | None
    profile: Profile
    color: Range | tuple[float, float, float]
    ground: Ground | None
    focal: float
    white: float
    weather_seed: int | None
    wind: Range
    veil: float
    fall: Range
    exposure: Range
    visibility: Range | None
    patches: Range


def transforms(host: _Kind, *weathers: type) -> Iterator[_Kind]:
    """Yield a transform of a pipeline's library for each weather, named like it."""
    for weather in weathers:
        name = weather.__name__
        page = f":class:`flurries.augment.{name}` in a pipeline; all but its `seed`."
        own = {"KIND": weather, "__doc__": page, "__module__": host.__module__}
        yield suggests(type(host)(name, (host,), own))


def suggests(kind: _Kind) -> _Kind:
    """Return a class whose construction answers unknown names with the nearest known one."""
    make = getattr(kind, "__init__")  # noqa: B009 - mypy refuses the plain name
    signature = inspect.signature(make)
    given = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
    if len(given) < len(signature.parameters):
        # In place of **weather it shows the fields of its own weather.
        given += [
            inspect.Parameter(
                f.name, inspect.Parameter.KEYWORD_ONLY, default=f.default, annotation=f.type
            )
            for f in dataclasses.fields(getattr(kind, "KIND"))  # noqa: B009
            if f.name != "seed"
        ]
    known = [parameter.name for parameter in given if parameter.name != "self"]

    @functools.wraps(make)
    def checked(self: Any, *args: Any, **kwargs: Any) -> None:
        for name in kwargs:
            if name == "seed" and name not in known:
                raise TypeError(
                    f"{kind.__name__} has no argument seed: "
                    "seed belongs to the pipeline that draws for it"
                )
            if name not in known:
                hint = suggestion(name, known) or f"; it has {', '.join(known)}"
                raise TypeError(f"{kind.__name__} has no argument {name}{hint}")
        make(self, *args, **kwargs)

    vars(checked)["__signature__"] = signature.replace(parameters=given)
    setattr(kind, "__init__", checked)  # noqa: B010 - mypy refuses the plain assignment
    return kind
