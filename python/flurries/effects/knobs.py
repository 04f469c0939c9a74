"""One number in place of many: looks by name, and arguments that set several fields."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from typing import Any, TypeVar

from flurries._contract import choice, suggesting

_Kind = TypeVar("_Kind")

# Effects of other fields that a `method` of snow and rain chooses; `kinds` names them.
METHODS: dict[type, dict[str, type]] = {}

# What frames ask of an effect, and users do not.
INNER = {"KNOBS", "MATTER", "NAME", "NATURAL", "OPTICS", "SIZES", "of_preset", "parts"}


class Described(type):
    """The class of effects: its `dir` has their fields and what users call."""

    def __dir__(cls) -> Iterable[str]:
        return [
            name for name in super().__dir__() if not name.startswith("_") and name not in INNER
        ]


# From the knobs and the arguments that were given to fields that follow from them.
Law = Callable[[Mapping[str, Any], Mapping[str, Any]], dict[str, Any]]


def knobs(*names: str, law: Law) -> Callable[[type[_Kind]], type[_Kind]]:
    """Give a dataclass arguments that set fields of it."""

    def turnable(kind: type[_Kind]) -> type[_Kind]:
        plain = kind.__init__

        @functools.wraps(plain)
        def init(self: Any, *others: Any, **given: Any) -> None:
            turned = {name: given.pop(name, None) for name in names}
            turned = {name: value for name, value in turned.items() if value is not None}
            if turned and {f.name for f in fields(self)} <= set(given):
                raise TypeError(
                    f"{next(iter(turned))} sets fields of a new effect, {kind.__name__}(...); in a "
                    "copy all of them are given"
                )
            given |= law(turned, given) if turned else {}
            plain(self, *others, **given)

        kind.__init__ = init  # type: ignore[method-assign]
        kind.KNOBS = names  # type: ignore[attr-defined]
        return suggesting(kind)

    return turnable


def looks(kind: type[_Kind]) -> type[_Kind]:
    """Let a class with ``PRESETS`` take the name of one, first or as `preset`."""
    plain = kind.__init__

    @functools.wraps(plain)
    def init(self: Any, *others: Any, preset: str | None = None, **given: Any) -> None:
        if len(others) > 1 or (others and preset is not None):
            raise TypeError(f"{kind.__name__} takes one preset and its fields by name")
        for name in others or ([] if preset is None else [preset]):
            given = kind.of_preset(name, given)  # type: ignore[attr-defined]
        plain(self, **given)

    @functools.wraps(plain)
    def new(cls: Any, *others: Any, method: Any = None, **given: Any) -> Any:
        # Of what another class makes Python calls no `__init__` of this one.
        other = METHODS.get(cls, {}).get(method) if isinstance(method, str) else None
        return other(*others, **given) if other else object.__new__(cls)

    described = kind.__repr__

    def shown(self: Any) -> str:
        strength = getattr(self, "strength", None)
        return described(self) + (f"  # {strength()}" if strength else "")

    kind.__repr__ = shown  # type: ignore[method-assign]
    kind.__init__ = init  # type: ignore[method-assign]
    kind.__new__ = new  # type: ignore[method-assign]
    if not hasattr(kind, "of_preset"):
        kind.of_preset = classmethod(_of_preset)  # type: ignore[attr-defined]
    return kind


def _of_preset(kind: Any, name: str, changes: dict[str, Any]) -> dict[str, Any]:
    values = kind.PRESETS[choice("preset", name, tuple(kind.PRESETS))]
    for knob in getattr(kind, "KNOBS", ()):
        if changes.get(knob) is not None:
            raise TypeError(f"{knob} and a preset set the same fields: give one of them")
    return {**values, **changes}
