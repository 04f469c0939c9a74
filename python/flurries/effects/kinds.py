"""The kinds of effects by the names that scene files have for them: ours, and anybody's."""

from __future__ import annotations

from dataclasses import is_dataclass
from typing import Any

from flurries._contract import _came, choice
from flurries.effects.checks import METHODS
from flurries.effects.cone import ConeRain, ConeSnow
from flurries.effects.falling import Rain, Snow
from flurries.effects.mist import Mist
from flurries.effects.tent import TentRain, TentSnow

# Packages name their effects here: ``[project.entry-points."flurries.effects"]``.
GROUP = "flurries.effects"

LONGEST_KIND = 64

OURS: dict[str, type[Any]] = {
    "snow": Snow, "rain": Rain, "tent_snow": TentSnow, "tent_rain": TentRain, "mist": Mist,
    "cone_snow": ConeSnow, "cone_rain": ConeRain,
}  # fmt: skip

METHODS[Snow] = {"tent": TentSnow, "cone": ConeSnow}
METHODS[Rain] = {"tent": TentRain, "cone": ConeRain}

_registered: dict[str, type[Any]] = {}


def register(kind: str, effect: type[Any]) -> None:
    """Give an effect of your own a name in scene files.

    A package does not need the call: it names its effects as entry points of the group
    "flurries.effects", ``ash = "my_package:Ash"``.

    Parameters
    ----------
    kind : str
        Value of ``kind`` in a scene's TOML file: at most 64 lower case letters, digits and "_". One
        that was registered before is replaced.
    effect : class
        A dataclass with ``parts``, or with a method ``render(frame)`` that returns a
        :class:`Layer`; ``docs/your-own-effect.md`` has one in 25 lines.
    """
    named = isinstance(kind, str) and kind.isidentifier() and kind == kind.lower()
    if not named or len(kind) > LONGEST_KIND:
        raise ValueError(
            f"kind must be a name of at most {LONGEST_KIND} lower case letters, digits and _, "
            f"got {_came(kind)}"
        )
    if kind in OURS:
        raise ValueError(f"kind must not be one of flurries' own, got {_came(kind)}")
    shows = is_dataclass(effect) and (hasattr(effect, "render") or hasattr(effect, "parts"))
    if not (isinstance(effect, type) and shows):
        raise TypeError(f"effect must be a dataclass with parts or a method render, got {effect!r}")
    _registered[kind] = effect


def class_of(kind: object) -> type[Any]:
    """Return the effect of a kind, or refuse what is none."""
    known = {**OURS, **_registered}
    if isinstance(kind, str) and kind in known:
        return known[kind]
    from importlib.metadata import entry_points

    others = {point.name: point for point in entry_points(group=GROUP)}
    if isinstance(kind, str) and kind in others:
        found: type[Any] = others[kind].load()
        register(kind, found)
        return found
    return known[choice("kind", kind, tuple(dict.fromkeys((*known, *others))))]


def kind_of(effect: object) -> str | None:
    """Return the kind of an effect; None for one that no scene file can hold."""
    own = type(effect)
    for kind, known in (*OURS.items(), *_registered.items()):
        if known is own:
            return kind
    from importlib.metadata import entry_points

    here = f"{own.__module__}:{own.__qualname__}"
    return next((point.name for point in entry_points(group=GROUP) if point.value == here), None)
