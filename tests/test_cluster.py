"""Scenes on Dask: the same bits, nothing lost with a worker, few tasks."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dask
import numpy as np
import pytest

import flurries as fl
from flurries.output.journal import check
from test_nothing_wrong import contents
from workers import group, workers

SCENE = fl.Scene("#304050", size=(96, 64), effects=fl.effects.TentSnow("heavy", flakes=100))


@dataclass(frozen=True)
class Slow:
    """No weather at all, after a while: so that a test can come in between."""

    seconds: float = 0.05
    ends: bool = False
    seed: int | None = None

    def render(self, frame: fl.effects.Frame) -> fl.effects.Layer:
        time.sleep(self.seconds)
        if self.ends:
            os._exit(3)
        return fl.effects.Layer("slow", np.zeros((64, 96), np.float32))


SLOW = SCENE.replace(effects=[fl.effects.TentSnow("heavy", flakes=100), Slow()])


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    # Groups of a few frames, so that there is something to lose.
    with dask.config.set({"distributed.scheduler.allowed-failures": 2}), workers(2) as client:
        client.run(sys.path.insert, 0, str(Path(__file__).parent))
        yield client


@pytest.fixture
def small_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    group(4, monkeypatch)


def test_an_array_has_the_frames(client: Any):
    film = SCENE.to_dask("3-20x3", group=2)
    assert (film.shape, film.dtype, film.chunks[0]) == ((6, 64, 96, 3), np.uint8, (2, 2, 2))
    want = np.stack([SCENE.render(t) for t in range(3, 21, 3)])
    assert np.array_equal(film.compute(scheduler="threads"), want)
    assert np.array_equal(client.compute(film[2:5, ::2]).result(), want[2:5, ::2])
    assert np.array_equal(client.compute(film.max(axis=0)).result(), want.max(axis=0))
    light = fl.Scene(np.full((20, 30, 3), 0.3, np.float32)).to_dask([4])
    assert light.dtype == np.float32 and light.shape == (1, 20, 30, 3)


class Never(Slow):
    def render(self, frame: fl.effects.Frame) -> fl.effects.Layer:
        raise AssertionError("rendered before anybody asked")


def test_an_array_is_lazy():
    film = SCENE.replace(effects=[Never()]).to_dask(range(100_000))
    assert len(film) == 100_000
    # The scene is one node of the graph, each chunk another, whatever a picture weighs.
    assert len(film.__dask_graph__()) <= 3 * len(film.chunks[0]) + 10


def test_a_sequence_has_the_same_bytes(client: Any, small_groups: None, tmp_path: Path):
    SCENE.write(tmp_path / "here" / "%04d.png", "1-30")
    seen: list[int] = []

    def progress(frames: Any) -> Any:
        assert len(frames) == 30
        for frame in frames:
            seen.append(frame)
            yield frame

    done = SCENE.write(tmp_path / "there" / "%04d.png", "1-30", dask=client, progress=progress)
    assert done.written == sorted(seen) == list(range(1, 31)) and done.kept == []
    assert contents(tmp_path / "there") == contents(tmp_path / "here")


def test_a_worker_that_is_killed_loses_nothing(client: Any, small_groups: None, tmp_path: Path):
    SLOW.write(tmp_path / "here" / "%04d.png", "1-24")
    out = tmp_path / "there"
    with ThreadPoolExecutor(1) as aside:
        writing = aside.submit(SLOW.write, out / "%04d.png", "1-24", dask=client)
        end = time.monotonic() + 60
        while len(list(out.glob("*.png"))) < 5 and time.monotonic() < end:
            time.sleep(0.005)
        os.kill(next(iter(client.run(os.getpid).values())), signal.SIGKILL)
        result = writing.result(100)
    assert sorted(result.written + result.kept) == list(range(1, 25))
    assert contents(out) == contents(tmp_path / "here"), "same bits, nothing left over"
    assert check(out)[1] == []
    client.wait_for_workers(2, timeout=180)


def test_frames_that_kill_every_worker_are_named(client: Any, small_groups: None, tmp_path: Path):
    client.wait_for_workers(2, timeout=180)
    deadly = SCENE.replace(effects=[Slow(0.0, ends=True)])
    with pytest.raises(RuntimeError, match="frames 1 to 4"):
        deadly.write(tmp_path / "%d.png", "1-4", dask=client)
    client.wait_for_workers(2, timeout=180)
    assert SCENE.write(tmp_path / "%d.png", "1-2", dask=client).written == [1, 2]
    assert not list(tmp_path.glob(".*"))


def test_a_film_has_the_same_bytes(client: Any, small_groups: None, tmp_path: Path):
    for name, where in (("here", None), ("there", client)):
        SCENE.write(tmp_path / f"{name}.mkv", "1-21", dask=where)
    assert (tmp_path / "here.mkv").read_bytes() == (tmp_path / "there.mkv").read_bytes()


def test_no_cluster_there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    with pytest.raises(TypeError, match="dask"):
        SCENE.write(tmp_path / "%d.png", "1", dask=7)
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.setitem(sys.modules, "dask", None)
    for call in (SCENE.to_dask, lambda n: SCENE.write(tmp_path / "%d.png", n, dask=True)):
        with pytest.raises(ImportError, match=r"flurries\[dask\]"):
            call("1")
    assert not list(tmp_path.iterdir())


OWN = """
import os, psutil
from flurries.output.cluster import cluster
if __name__ == "__main__":
    with cluster(None, True, count=1) as crew:
        crew.threads()
        of_all = psutil.Process().children(recursive=True) + [psutil.Process()]
        print(*{c.laddr.ip for p in of_all for c in p.net_connections() if c.status == "LISTEN"})
"""


def test_a_cluster_of_its_own_listens_on_this_machine_alone(tmp_path: Path):
    (tmp_path / "own.py").write_text(OWN)
    done = subprocess.run(
        [sys.executable, str(tmp_path / "own.py")], capture_output=True, text=True, timeout=120
    )
    assert done.stdout.split() == ["127.0.0.1"], done.stderr
