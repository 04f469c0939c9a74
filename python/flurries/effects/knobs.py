"""One number in place of many: looks by name, and arguments that set several fields."""

import functools
from collections.abc import Callable, Iterable
from dataclasses import fields
from typing import Any, TypeVar

from flurries._contract import choice, suggesting

_Kind = TypeVar("_Kind")

# Effects of other fields that a `method` of snow and rain chooses; `kinds` names them.
METHODS: dict[type, dict[str, type]] = {}

# What frames ask of an effect, and users do not.
INNER = {"CHECKS", "KNOBS", "MATTER", "NAME", "NATURAL", "OPTICS", "SIZES", "of_preset", "parts"}


class Described(type):
    """The class of effects: its `dir` has their fields and what users call."""

    def __dir__(cls) -> Iterable[str]:
        return [
            name for name in super().__dir__() if not name.startswith("_") and name not in INNER
        ]

    def of_preset(cls, name: str, changes: dict[str, Any]) -> dict[str, Any]:
        """Return the fields of a preset with changes."""
        presets, knobs = cls.PRESETS, cls.KNOBS  # type: ignore[attr-defined]
        values = presets[choice("preset", name, tuple(presets))]
        if given := [knob for knob in knobs if changes.get(knob) is not None]:
            raise TypeError(f"{given[0]} and a preset set the same fields: give one of them")
        return {**values, **changes}


def effect(
    *knobs: str, law: Callable[[Any, dict[str, Any], dict[str, Any]], dict[str, Any]] | None = None
) -> Callable[[type[_Kind]], type[_Kind]]:
    """Let a dataclass take the name of one of its ``PRESETS``, and knobs: they set fields."""
    # The law goes from the class, the knobs and the other arguments to those fields.

    def made(kind: Any) -> Any:
        plain, described = suggesting(kind).__init__, kind.__repr__

        @functools.wraps(plain)
        def init(self: Any, *others: Any, preset: str | None = None, **given: Any) -> None:
            if len(others) > 1 or (others and preset is not None):
                raise TypeError(f"{kind.__name__} takes one preset and its fields by name")
            for name in {*others, preset} - {None}:
                given = kind.of_preset(name, given)
            asked = {name: given.pop(name, None) for name in knobs}
            turned = {name: value for name, value in asked.items() if value is not None}
            if turned and {f.name for f in fields(kind)} <= set(given):
                raise TypeError(
                    f"{next(iter(turned))} sets fields of a new effect, {kind.__name__}(...); in a "
                    "copy all of them are given"
                )
            plain(self, **{**given, **(law(kind, turned, given) if law and turned else {})})

        @functools.wraps(plain)
        def new(cls: Any, *others: Any, method: Any = None, **given: Any) -> Any:
            # Of what another class makes Python calls no `__init__` of this one.
            other = METHODS.get(cls, {}).get(method) if isinstance(method, str) else None
            return other(*others, **given) if other else object.__new__(cls)

        def shown(self: Any) -> str:
            strength = f"  # {self.strength()}" if hasattr(self, "strength") else ""
            return f"{described(self)}{strength}"

        kind.__init__, kind.__new__, kind.__repr__, kind.KNOBS = init, new, shown, knobs
        return kind

    return made
