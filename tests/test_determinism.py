"""One frame, one set of bits: threads, processes and order; and the hashes that must not change."""

import copy
import inspect
import json
import multiprocessing
import pickle
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.scene.fingerprint import BITS
from public import calls, listed
from public.scenes import write_files
from same_bits import SCENES, digest

HERE = Path(__file__).parent
TIMES = [0, 7.25, 3, 1000]
ORDERS = {"forward": [0, 1, 2, 3], "reverse": [3, 2, 1, 0], "shuffled": [2, 0, 3, 1]}
# Four of them: gusts are snow.
NAMES = ["snow", "rain", "mist", "cone"]


def hashes(threads: int) -> list[str]:
    """Hashes of all frames of all scenes, for each order of making them."""
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
    code = "import json; from same_bits import of_scenes; print(json.dumps(of_scenes()))"
    done = subprocess.run(
        [sys.executable, "-c", f"import flurries; flurries.settings(reproducible=True); {code}"],
        text=True, capture_output=True, cwd=HERE,
    )  # fmt: skip
    found = json.loads(done.stdout)
    assert set(found) == set(KEPT)
    for name, value in found.items():
        assert value == KEPT[name]["sha256"], f"frames of {name!r} have changed"


def test_a_change_of_frames_is_told():
    log = (HERE.parent / "CHANGELOG.md").read_text(encoding="utf-8")
    for name, entry in KEPT.items():
        for number in range(2, entry["number"] + 1):
            assert f"Frames of `{name}` change ({number})" in log


def test_16_2_a_change_of_frames_raises_the_number_of_their_bits():
    """Frames of other bits are told apart by it, see `flurries.scene.fingerprint.BITS`."""
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
