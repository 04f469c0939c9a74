"""One number in place of many: looks by name, and arguments that set several fields."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, TypeVar

from flurries._contract import choice, suggesting

_Kind = TypeVar("_Kind")

# Effects of other fields that a `method` of snow and rain chooses; `kinds` names them.
METHODS: dict[type, dict[str, type]] = {}

# From the arguments that were given to the fields that a knob sets.
Law = Callable[[Any, Mapping[str, Any]], dict[str, Any]]


def knobs(**laws: Law) -> Callable[[type[_Kind]], type[_Kind]]:
    """Give a dataclass arguments that set several of its fields, those that are not given."""

    def turnable(kind: type[_Kind]) -> type[_Kind]:
        plain = kind.__init__

        @functools.wraps(plain)
        def init(self: Any, *others: Any, **given: Any) -> None:
            turned = [name for name in laws if given.get(name) is not None]
            if turned:
                given = _with_look(kind, turned, laws, given)
            plain(self, *others, **given)

        kind.__init__ = init  # type: ignore[method-assign]
        kind.KNOBS = tuple(laws)  # type: ignore[attr-defined]
        return suggesting(kind)

    return turnable


def _with_look(
    kind: type[Any], turned: list[str], laws: Mapping[str, Law], given: dict[str, Any]
) -> dict[str, Any]:
    """Return the arguments with what a knob makes of them."""
    if len(turned) > 1:
        raise TypeError(f"{turned[0]} and {turned[1]} set the same fields: give one of them")
    knob = turned[0]
    own = {name: value for name, value in given.items() if name not in laws}
    if {f.name for f in fields(kind)} <= set(own):
        raise TypeError(
            f"{knob} sets fields of a new effect: {kind.__name__}({knob}=...); in a copy all of "
            "them are given"
        )
    look = laws[knob](given[knob], own)
    for name, value in look.items():
        if value is None and name in own:
            raise TypeError(f"{knob} and {name} say the same: give one of them")
    return {**{name: value for name, value in look.items() if value is not None}, **own}


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
