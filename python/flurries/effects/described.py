"""What `dir` and `help` show of an effect."""

from __future__ import annotations

from collections.abc import Iterable

# What frames ask of an effect, and users do not.
INNER = {"KNOBS", "NAME", "of_preset", "parts"}


class Described(type):
    """The class of effects: its `dir` has their fields and what users call."""

    def __dir__(cls) -> Iterable[str]:
        return [
            name for name in super().__dir__() if not name.startswith("_") and name not in INNER
        ]
