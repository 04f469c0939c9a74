"""Fields whose arguments stand in one row, as the twin takes them."""

from dataclasses import fields
from typing import Any

from flurries import spectral

NAMES = {field.name for field in fields(spectral.Texture)}


def _parted(given: dict[str, Any]) -> dict[str, Any]:
    rest = {name: value for name, value in given.items() if name not in NAMES}
    return {**rest, "texture": spectral.Texture(**{n: given[n] for n in given.keys() - rest})}


def field(shape: Any, **given: Any) -> Any:
    return spectral.field(shape, **_parted(given))


def alpha(shape: Any, **given: Any) -> Any:
    return spectral.alpha(shape, **_parted(given))
