"""Numbers from the text files that cameras come in."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flurries._contract import Float64
from flurries.io.files import plain_file, read_text

_MOST_BYTES = 1 << 25


def read_numbers(path: str | os.PathLike[str], widths: tuple[int, ...]) -> tuple[Path, Float64]:
    """Return a file of numbers as rows, comments and empty lines left out."""
    file = plain_file(path)
    rows: list[list[float]] = []
    for number, line in lines_of(file):
        parts = line.partition("#")[0].split()
        if not parts:
            continue
        if len(parts) not in widths or (rows and len(parts) != len(rows[0])):
            wanted = " or ".join(map(str, widths))
            raise ValueError(
                f"{file}, line {number}: {wanted} numbers are wanted, got {len(parts)}"
            )
        rows.append(floats(file, number, parts))
    if not rows:
        raise ValueError(f"{file}: no camera is there")
    return file, np.array(rows)


def lines_of(file: Path) -> list[tuple[int, str]]:
    """Return the lines of a text file with their numbers."""
    return list(enumerate(read_text(file, _MOST_BYTES, "camera file").splitlines(), 1))


def floats(file: Path, number: int, parts: Sequence[str]) -> list[float]:
    """Return the numbers of a line, each finite."""
    found = []
    for part in parts:
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"{file}, line {number}: not a finite number: {part[:40]!r}")
        found.append(value)
    return found
