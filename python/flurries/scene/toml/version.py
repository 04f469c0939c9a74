"""Scene files of version 0.1, which say no format: their kinds and keys by today's names."""

from __future__ import annotations

from typing import Any

FORMAT = 2

# The kinds of version 0.1 that have other names now.
KINDS = {"snow": "tent_snow", "rain": "tent_rain"}


def upgrade(values: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a file as format 2 has them.

    Raises
    ------
    ValueError
        If `format` is neither 1 nor 2.
    """
    values = dict(values)
    version = values.pop("format", 1)
    if isinstance(version, bool) or version not in (1, FORMAT):
        raise ValueError(f"format must be 1 or {FORMAT}, got {version!r}")
    if version == FORMAT:
        return values
    if isinstance(values.get("sun"), dict):
        values["sun"] = _spell(values["sun"])
    if isinstance(values.get("effects"), list):
        values["effects"] = [_effect(table) for table in values["effects"]]
    return values


def _effect(table: Any) -> Any:
    if not isinstance(table, dict):
        return table
    kind = table.get("kind")
    renamed = KINDS.get(kind, kind) if isinstance(kind, str) else kind
    return {**_spell(table), "kind": renamed} if "kind" in table else _spell(table)


def _spell(table: dict[str, Any]) -> dict[str, Any]:
    return {"color" if key == "colour" else key: value for key, value in table.items()}
