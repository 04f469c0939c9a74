"""Damaged files, thousands of them: errors that name them, no hangs, memory within 2 GiB."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from length import times

import test_arguments
from public_calls import CALLS, NUMBERS

Record = Callable[[str, object], None]
HERE = Path(__file__).parent
FORMATS = {
    "EXR": ["zip.exr", "none.exr", "piz.exr"],
    "PNG": ["ours.png", "others.png"],
    "JPEG": ["ours.jpg", "progressive.jpg"],
    "TIFF": ["ours.tif", "lzw.tif", "first.tif"],
}


def fuzz(what: str, *words: str | int) -> dict[str, float]:
    done = subprocess.run(
        [sys.executable, str(HERE / "fuzz.py"), what, *map(str, words)], text=True,
        capture_output=True, timeout=3000, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    # A crash, and a hang that its alarm ended, have other codes.
    assert done.returncode == 0, (done.returncode, done.stdout[-500:], done.stderr[-1500:])
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.parametrize("name", FORMATS)
def test_damaged_pictures(name: str, tmp_path: Path, record_property: Record):
    from test_io_pictures import specimens

    specimens(tmp_path)
    count = times(8000, 40)
    found = fuzz("pictures", str(tmp_path), count, *FORMATS[name])
    record_property(
        "figure", f"{name}: {found['errors']:.0f} of {found['tried']:.0f} refused by name, "
        f"the rest whole pictures; slowest {found['slowest']:.2f} s, "
        f"{found['growth']:.0f} MiB more memory"
    )  # fmt: skip
    assert found["tried"] == count and found["complaints"] == 0
    # Some do damage, and memory is bounded.
    assert 0.1 * count < found["errors"] and found["growth"] <= 256


def test_fuzzed_scene_files(tmp_path: Path, record_property: Record):
    count = times(10_000, 100)
    found = fuzz("scenes", str(tmp_path), count)
    record_property(
        "figure", f"{found['errors']:.0f} of {found['tried']:.0f} refused, the rest loaded; "
        f"slowest {found['slowest']:.2f} s, {found['growth']:.0f} MiB more memory"
    )  # fmt: skip
    assert found["tried"] == count and found["complaints"] == 0
    assert 0.1 * count < found["errors"] < count and found["growth"] <= 128


def test_damaged_files_of_every_kind(tmp_path: Path, record_property: Record):
    count = times(10_000, 100)
    found = fuzz("all", str(tmp_path), count)
    record_property(
        "figure", f"{found['errors']:.0f} of {found['tried']:.0f} refused, the rest read within "
        f"2 GiB; slowest {found['slowest']:.2f} s, {found['growth']:.0f} MiB more memory"
    )  # fmt: skip
    assert found["tried"] == count and found["complaints"] == 0
    assert 0.1 * count < found["errors"] < count


def test_random_arguments(record_property: Record):
    rounds, tried = times(20, 3), 0
    for seed, name in enumerate(sorted(CALLS | NUMBERS)):
        found = test_arguments.answered(name, rounds, seed)
        tried += found["tried"]
        assert found["complaints"] == [], name
    record_property("figure", f"{tried} random values: 0 wrong exceptions")
