"""Hostile values for every argument of every public function: refused by name, soon and cheaply."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hostile import complaints
from public_calls import CALLS, NUMBERS, Call

PROGRAM = Path(__file__).parent / "hostile.py"


def answered(name: str, *numbers: int) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, str(PROGRAM), name, *map(str, numbers)], text=True, capture_output=True,
        timeout=500, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    assert done.returncode == 0, f"{name}: {done.stderr[-2000:]}"
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("name", sorted(CALLS | NUMBERS))
def test_hostile_arguments(name: str, record_property: Callable[[str, object], None]):
    found = answered(name)
    record_property("count", found["tried"])
    assert found["complaints"] == []


def test_what_is_wrong_is_told():
    """The control: a function that gives other exceptions, names nothing, and works before."""

    def careless(size: Any) -> Any:
        if size == 0:
            return 1 / size
        if size == -1:
            raise ValueError("bad")
        if size == "":
            sum(range(2_000_000))
            raise ValueError("size is empty")
        return 3.0

    import tracemalloc

    tracemalloc.start()
    try:
        found = list(complaints(Call(careless, {}, {"size": 3}), lambda: [0, -1, "", 5]))
    finally:
        tracemalloc.stop()
    assert "ZeroDivisionError" in found[0] and "not named" in found[1] and " ms" in found[2]
    assert len(found) == 3
