"""Damaged files, thousands of them: errors that name them, no hangs, memory within 2 GiB."""

import json
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from length import times

from public import Call
from public.complaints import of_arguments
from test_public import TABLE

HERE = Path(__file__).parent


def test_damaged_files_of_every_kind(tmp_path: Path):
    count = times(40_000, 100)
    done = subprocess.run(
        [sys.executable, str(HERE / "fuzz.py"), str(tmp_path), str(count)], text=True,
        capture_output=True, timeout=3000, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    # A crash, and a hang that its alarm ended, have other codes.
    assert done.returncode == 0, (done.returncode, done.stdout[-500:], done.stderr[-1500:])
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["tried"] == count and found["complaints"] == 0, done.stdout
    assert 0.1 * count < found["errors"] < count


def random_value(random: Any) -> Any:
    kind = int(random.integers(6))
    if kind == 0:
        return float(random.standard_normal() * 10.0 ** random.integers(-320, 308))
    if kind == 1:
        return int(random.integers(-(2**62), 2**62)) >> int(random.integers(0, 62))
    if kind == 2:
        return "".join(map(chr, random.integers(1, 0xD7FF, int(random.integers(0, 40)))))
    if kind == 3:
        return float(np.frombuffer(random.bytes(8), "f8")[0])
    if kind == 4:
        return random.bytes(int(random.integers(0, 20)))
    return tuple(random_value(random) for _ in range(int(random.integers(0, 4))))


def test_random_arguments():
    rounds, tried = times(20, 3), 0
    random = np.random.default_rng(0)

    def values(call: Call, argument: str) -> Iterator[tuple[Any, bool]]:
        nonlocal tried
        for _ in range(rounds * (argument not in call.heavy)):
            tried += 1
            yield random_value(random), False

    with warnings.catch_warnings():
        # They are for the user; here they are neither good nor bad.
        warnings.simplefilter("ignore")
        for name, call in TABLE.items():
            if call.strict:
                assert list(of_arguments(call, values)) == [], name
