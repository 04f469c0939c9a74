"""The reproducible mode: one set of bits whatever the processor has; and what it is not."""

import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
import textured
from flurries import _core
from flurries.cli import main
from same_bits import KERNELS, SCENES, WEATHERS, of_kernels, of_scenes

HERE = Path(__file__).parent
# An old processor for everything beside the kernels: the C library, NumPy and its linear algebra.
OLD = {
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F,-AVX512VL",
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL",
    "OPENBLAS_CORETYPE": "Prescott",
}
# RustFFT takes its factors from the C library; in float64 their last bits show.
FROM_THE_C_LIBRARY = {"field, large tile, float64", "inverse_transform, float64"}


@cache
def hashes(**environment: str) -> dict[str, dict[str, str]]:
    """Hashes of the kernels and of the scenes in a process of its own; each is run once."""
    done = subprocess.run(
        [sys.executable, str(HERE / "same_bits.py")], text=True, capture_output=True,
        env={**os.environ, **environment}, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found: dict[str, dict[str, str]] = json.loads(done.stdout)
    return found


def has_fma() -> bool:
    info = Path("/proc/cpuinfo")
    return platform.machine() == "x86_64" and info.exists() and " fma " in info.read_text()


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    before = fl.settings().reproducible
    yield
    fl.settings(reproducible=before)


ON = {"FLURRIES_REPRODUCIBLE": "1"}


def test_every_level_gives_the_same_bits(record_property: Callable[[str, object], None]):
    found = hashes(**ON)
    for what, names in (("kernels", KERNELS), ("scenes", [*SCENES, *WEATHERS])):
        want = found[what]
        assert set(want) == set(names) and len(set(want.values())) >= len(names) - 1
        record_property("figure", f"{len(want)} {what}: 0 of 4 runs differ")
    for environment in (
        {"FLURRIES_SIMD": "avx2"},
        {"FLURRIES_SIMD": "portable"},
        {"FLURRIES_NUM_THREADS": "5"},
    ):
        assert hashes(**ON, **environment) == found, environment


def test_without_the_mode_vectors_and_threads_agree_and_the_portable_level_differs():
    """Of the last the control: fused products round once."""
    fused, apart = hashes(FLURRIES_REPRODUCIBLE="0"), hashes(FLURRIES_SIMD="portable")
    assert hashes(FLURRIES_SIMD="avx2", FLURRIES_NUM_THREADS="3") == fused
    if not has_fma():
        pytest.skip("this processor has no fused product")
    for what in ("kernels", "scenes"):
        assert sum(fused[what][name] != apart[what][name] for name in fused[what]) >= 5


def test_an_old_processor_gives_the_same_bits(record_property: Callable[[str, object], None]):
    want, got = hashes(**ON), hashes(**ON, FLURRIES_SIMD="portable", **OLD)
    for what in ("kernels", "scenes"):
        different = {name for name in want[what] if got[what][name] != want[what][name]}
        assert different <= FROM_THE_C_LIBRARY
        same = len(want[what]) - len(different)
        record_property("figure", f"{same} of {len(want[what])} {what} the same")


def test_switching_is_as_starting_so():
    """Nothing that one mode keeps is used by the other."""
    for mode in ("0", "1", "0", "1"):
        fl.settings(reproducible=mode == "1")
        assert fl.settings().reproducible is (mode == "1")
        want = hashes(FLURRIES_REPRODUCIBLE=mode)
        assert {"kernels": of_kernels(), "scenes": of_scenes()} == want


def test_it_is_as_right():
    shape = (130, 140)
    moving: dict[str, Any] = {"drift": (3.0, -9.0), "seed": 5, "tile": 64}
    exact = textured.field(shape, dtype=np.float64, **moving)
    errors = []
    for mode in (False, True):
        fl.settings(reproducible=mode)
        errors.append(np.abs(textured.field(shape, **moving) - exact).max())
    assert errors[1] < 5e-6 and errors[1] < 3 * errors[0]


@pytest.mark.parametrize("bad", [1, 0, "yes", np.ones(2)])
def test_it_is_on_or_off(bad: Any):
    with pytest.raises(TypeError, match="reproducible"):
        fl.settings(reproducible=bad)


@pytest.mark.parametrize("value, on", [("1", True), ("0", False), ("", False), ("yes", False)])
def test_the_environment_turns_it_on(value: str, on: bool):
    code = "import flurries as fl; print(fl.settings().reproducible)"
    done = subprocess.run(
        [sys.executable, "-c", code], text=True, capture_output=True,
        env={**os.environ, "FLURRIES_REPRODUCIBLE": value},
    )  # fmt: skip
    assert done.stdout.split() == [str(on)]


def test_the_command_line_turns_it_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("FLURRIES_REPRODUCIBLE", "0")
    words = ["render", "#304050", "--snow", "heavy", "--size", "64x48", "--quiet", "--frames", "1"]
    assert main([*words, "--reproducible", "-o", str(tmp_path / "%d.png")]) == 0
    # Its workers, too.
    assert _core.reproducible() and os.environ["FLURRIES_REPRODUCIBLE"] == "1"
