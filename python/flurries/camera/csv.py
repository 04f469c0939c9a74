"""Camera paths from CSV files, as trackers and modelling programs export them."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from flurries._contract import real
from flurries.io.files import read_text
from flurries.motion.keys import Keys

_PLACE = ("x", "y", "z")
_VECTOR = ("rx", "ry", "rz")
_QUATERNION = ("qw", "qx", "qy", "qz")
_KNOWN = ("frame", *_PLACE, *_VECTOR, *_QUATERNION, "focal")
_MOST_BYTES = 1 << 25


def read_path(path: str | os.PathLike[str], scale: float = 1.0) -> dict[str, Any]:
    """Return the `position`, `orientation` and `focal` that a CSV file has, for a `CameraPath`."""
    file, text = os.fspath(path), read_text(path, _MOST_BYTES, "camera path")
    try:
        rows = [row for row in csv.reader(text.splitlines()) if any(map(str.strip, row))]
    except csv.Error as error:
        raise ValueError(f"{file}: not a CSV file: {error}") from None
    if len(rows) < 2:
        raise ValueError(f"{file}: a camera path needs a header and at least one row")
    names = [name.strip().lower() for name in rows[0]]
    for name in names:
        if name not in _KNOWN or names.count(name) > 1:
            known = ", ".join(_KNOWN)
            raise ValueError(f"{file}, line 1: columns are {known}, each once; got {name!r}")
    for line, row in enumerate(rows[1:], 2):
        if len(row) != len(names):
            raise ValueError(
                f"{file}, line {line}: {len(names)} entries are wanted, got {len(row)}"
            )
    table = np.array([floats(file, line, row) for line, row in enumerate(rows[1:], 2)])
    columns = dict(zip(names, table.T, strict=True))
    found: dict[str, Any] = {}
    for key, groups in (("position", (_PLACE,)), ("orientation", (_VECTOR, _QUATERNION))):
        given = [group for group in groups if any(name in columns for name in group)]
        if len(given) > 1:
            raise ValueError(f"{file}, line 1: give rx, ry, rz or qw, qx, qy, qz, not both")
        for group in given:
            missing = [name for name in group if name not in columns]
            if missing:
                raise ValueError(f"{file}, line 1: column {missing[0]!r} is missing")
            found[key] = np.stack([columns[name] for name in group], axis=1)
    if "position" in found:
        found["position"] *= real("scale", scale, above=0.0)
    if "focal" in columns:
        found["focal"] = columns["focal"]
    if not found:
        raise ValueError(f"{file}, line 1: neither x, y, z nor an orientation")
    if "frame" in columns:
        try:
            found = {
                key: Keys(list(zip(columns["frame"].tolist(), values.tolist(), strict=True)))
                for key, values in found.items()
            }
        except ValueError as error:
            raise ValueError(f"{file}: {error}") from None
    return found


def floats(file: object, number: int, parts: Sequence[str]) -> list[float]:
    """Return the numbers of a line, each finite."""
    found = []
    for part in parts:
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"{file}, line {number}: not a finite number: {part.strip()[:40]!r}")
        found.append(value)
    return found
