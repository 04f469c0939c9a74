"""One frame, one set of bits: threads, processes, order and, on request, whatever the processor."""

import copy
import inspect
import json
import multiprocessing
import os
import pickle
import platform
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
import textured
from flurries import _core
from flurries.cli import main
from flurries.scene.fingerprint import BITS
from public import calls, listed
from public.scenes import write_files
from same_bits import KERNELS, SCENES, WEATHERS, digest, of_kernels, of_scenes

HERE = Path(__file__).parent
TIMES = [0, 7.25, 3, 1000]
ORDERS = {"forward": [0, 1, 2, 3], "reverse": [3, 2, 1, 0], "shuffled": [2, 0, 3, 1]}
NAMES = ["snow", "rain", "mist", "cone"]  # Four of them: gusts are snow.


def hashes(threads: int) -> list[str]:
    fl.set_threads(threads)
    found = []
    for order in ORDERS.values():
        made = {(name, i): digest(SCENES[name].render(TIMES[i])) for name in NAMES for i in order}
        found.append(json.dumps([made[name, i] for name in NAMES for i in range(4)]))
    return found


@pytest.fixture(scope="module")
def want() -> str:
    first = hashes(1)
    fl.set_threads(2)
    assert len(set(first)) == 1 and len(set(json.loads(first[0]))) == 16
    return first[0]


@pytest.mark.parametrize("kind, count", [
    ("thread", 1), ("thread", 3), ("thread", 8), ("fork", 2), ("spawn", 3), ("forkserver", 1),
])  # fmt: skip
def test_threads_processes_and_orders(
    kind: str, count: int, want: str, threads: Callable[[int], None]
):
    if kind == "thread":
        got: list[str] = []
        worker = threading.Thread(target=lambda: got.extend(hashes(count)))
        worker.start()
        worker.join(120)
    else:
        with warnings.catch_warnings():
            # From 3.12 on Python warns of any fork beside threads; the test is that it works.
            warnings.simplefilter("ignore", DeprecationWarning)
            context = multiprocessing.get_context(kind)
            with ProcessPoolExecutor(1, mp_context=context) as pool:
                got = pool.submit(hashes, count).result(120)
    assert got == [want] * 3


KEPT = json.loads((HERE / "frames" / "hashes.json").read_text(encoding="utf-8"))


def test_kept_hashes():
    """In the reproducible mode; `make hashes` takes others, with a line in the changelog."""
    found = of_process(**ON)["scenes"]
    assert set(found) == set(KEPT)
    for name, value in found.items():
        assert value == KEPT[name]["sha256"], f"frames of {name!r} have changed"


def test_a_change_of_frames_is_told():
    log = (HERE.parent / "CHANGELOG.md").read_text(encoding="utf-8")
    for name, entry in KEPT.items():
        for number in range(2, entry["number"] + 1):
            assert f"Frames of `{name}` change ({number})" in log


def test_16_2_a_change_of_frames_raises_the_number_of_their_bits():
    assert 1 + sum(entry["number"] - 1 for entry in KEPT.values()) == BITS


PATH = fl.CameraPath(
    fl.Camera(80.0), velocity=fl.Keys([(0, (0.0, 0.0, 1.0)), (9, (0.1, 0.0, 2.0))])
)
LIT = fl.Scene(
    "#304050", size=(96, 64), camera=PATH, seed=3, sun=fl.scene.Sun((0.1, 1.0, 0.2)),
    lights=[fl.scene.Lamp((1.0, -1.0, 5.0), power=fl.Keys([(0, 9.0), (9, 30.0)]))],
    lens=fl.camera.Lens(focus=2.0, f_stop=1.4, blades=5),
    effects=[
        fl.effects.TentSnow(flakes=50, wind=fl.Wind((1.0, 0.0, 0.3), gusts=0.6)),
        fl.effects.TentSnow(amount=fl.Keys([(0, 1.0), (9, 0.0)])), fl.effects.TentRain(drops=50),
        fl.Mist(count=40), fl.effects.ConeSnow(tile=64), fl.effects.ConeRain(tile=64),
        fl.Snow(density=60.0, far=20.0), fl.Rain(density=60.0, far=10.0),
    ],
)  # fmt: skip
COPIES: dict[str, Callable[[Any], Any]] = {
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}


@pytest.mark.parametrize("how", COPIES)
def test_copies_give_the_same_frame(how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Every class that somebody makes, and a scene of them; without pictures they are small."""
    assert np.array_equal(COPIES[how](LIT).render(7), LIT.render(7))
    monkeypatch.chdir(tmp_path)
    write_files()
    classes = {name for name, made in listed().items() if inspect.isclass(made)}
    classes -= {name for name in classes if name.startswith(("io.", "augment.", "viewer."))}
    table = {name: call for name, call in calls().items() if name in classes}
    assert {"Scene", "Keys", "cone.Texture", "scene.Foreground", "Snow"} <= set(table)
    for name, call in table.items():
        assert call.of is not None
        value = call.of(**call.given)
        copied = COPIES[how](value)
        assert repr(copied) == repr(value) or " at 0x" in repr(value), name
        assert call.arrays or len(pickle.dumps(value)) <= 4096, name
    axis, path = (0.0, 1.0, 0.0), fl.cone.path([0.0, 1.0], (0.0, 8.0, 0.0))
    assert COPIES[how](path).at(0.5) == path.at(0.5)
    tile = fl.cone.Texture(fl.cone.snow_tile(16, seed=1))
    want, got = (
        fl.cone.layers((9, 8), fl.Camera(8.0), part, axis=axis, phase=0.2)
        for part in (tile, COPIES[how](tile))
    )
    assert np.array_equal(got, want)


# An old processor for everything beside the kernels: the C library, NumPy and its linear algebra.
OLD = {
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F,-AVX512VL",
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL",
    "OPENBLAS_CORETYPE": "Prescott",
}
# RustFFT takes its factors from the C library; in float64 their last bits show.
FROM_THE_C_LIBRARY = {"field, large tile, float64", "inverse_transform, float64"}


@cache
def of_process(**environment: str) -> dict[str, dict[str, str]]:
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


def test_every_level_gives_the_same_bits():
    found = of_process(**ON)
    for what, names in (("kernels", KERNELS), ("scenes", [*SCENES, *WEATHERS])):
        want = found[what]
        assert set(want) == set(names) and len(set(want.values())) >= len(names) - 1
    for level, count in (("avx2", "5"), ("portable", "2")):
        assert of_process(**ON, FLURRIES_SIMD=level, FLURRIES_NUM_THREADS=count) == found, level


def test_without_the_mode_vectors_and_threads_agree_and_the_portable_level_differs():
    """Of the last the control: fused products round once."""
    fused, apart = of_process(FLURRIES_REPRODUCIBLE="0"), of_process(FLURRIES_SIMD="portable")
    assert of_process(FLURRIES_SIMD="avx2", FLURRIES_NUM_THREADS="3") == fused
    if not has_fma():
        pytest.skip("this processor has no fused product")
    for what in ("kernels", "scenes"):
        assert sum(fused[what][name] != apart[what][name] for name in fused[what]) >= 5


def test_an_old_processor_gives_the_same_bits():
    want, got = of_process(**ON), of_process(**ON, FLURRIES_SIMD="portable", **OLD)
    for what in ("kernels", "scenes"):
        different = {name for name in want[what] if got[what][name] != want[what][name]}
        assert different <= FROM_THE_C_LIBRARY


def test_switching_is_as_starting_so():
    """Nothing that one mode keeps is used by the other."""
    for mode in ("0", "1", "0", "1"):
        fl.settings(reproducible=mode == "1")
        assert fl.settings().reproducible is (mode == "1")
        want = of_process(FLURRIES_REPRODUCIBLE=mode)
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
