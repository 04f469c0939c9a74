"""One number in place of many: fields that the caller gave, and those that a knob sets."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, ClassVar


class Knobs:
    """A dataclass some of whose arguments set several fields, those that are not given.

    An argument of this kind is no field: it is used up, and what it made is written out.
    """

    # Names of the arguments; at most one of them is given.
    KNOBS: ClassVar[tuple[str, ...]] = ()

    def __new__(cls, *_: Any, **given: Any) -> Any:
        """Remember which arguments were given: a field's value does not say so."""
        made = super().__new__(cls)
        if given:
            # Not for what is copied: it has all that it needs.
            object.__setattr__(made, "_given", frozenset(given))
        return made

    def _turned(self, **knobs: Any) -> str | None:
        """Return which knob is given, if any.

        Raises
        ------
        TypeError
            If there are two.
        """
        turned = [name for name, value in knobs.items() if value is not None]
        if len(turned) > 1:
            raise TypeError(f"{turned[0]} and {turned[1]} set the same fields: give one of them")
        return turned[0] if turned else None

    def _set(self, knob: str | None, values: dict[str, Any], *instead: str) -> None:
        """Set the fields that the caller did not give; `instead` are fields that say the same.

        Raises
        ------
        TypeError
            If all of them are given, as `dataclasses.replace` does.
        """
        given: frozenset[str] = self.__dict__.pop("_given", frozenset())
        if knob is None:
            return
        own = {f.name for f in fields(self)}  # type: ignore[arg-type]
        if own <= given:
            raise TypeError(
                f"{knob} sets fields of a new effect: {type(self).__name__}({knob}=...); in a copy "
                "all of them are given"
            )
        for name in instead:
            if name in given:
                raise TypeError(f"{knob} and {name} say the same: give one of them")
        for name, value in values.items():
            if name not in given:
                object.__setattr__(self, name, value)
