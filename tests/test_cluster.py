"""Scenes on Dask: the same bits, nothing lost with a worker; and clusters that cannot work."""

import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dask
import distributed
import numpy as np
import pytest

import flurries as fl
from flurries._threads import scope
from flurries.io import read_picture
from flurries.output import crew
from flurries.output.journal import check
from flurries.scene.fingerprint import BITS
from test_nothing_wrong import SMALL, contents, python
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


def test_16_3_tasks_on_one_worker_keep_their_modes(tmp_path: Path, monkeypatch: Any):
    group(2, monkeypatch)
    # float32 light shows the last bit in some of many pixels.
    light = np.random.default_rng(0).random((64, 96, 3), np.float32)
    scene = fl.Scene(light, effects=[fl.effects.ConeSnow(tile=64), fl.effects.TentSnow(flakes=100)])

    def frames(where: Any, plain: bool) -> None:
        out = tmp_path / f"{'here' if where is None else 'there'} {plain}" / "%d.exr"
        with scope(threads=None, reproducible=plain):
            scene.write(out, "1-40", bits="float", dask=where)

    for plain in (True, False):
        frames(None, plain)
    with workers(1, 4) as client:
        both = [threading.Thread(target=frames, args=(client, plain)) for plain in (True, False)]
        for thread in both:
            thread.start()
        for thread in both:
            thread.join(300)
    for plain in (True, False):
        here, there = (contents(tmp_path / f"{name} {plain}") for name in ("here", "there"))
        assert here == there and len(there) == 40, "frames have the other mode's bits"
    if "fma" in Path("/proc/cpuinfo").read_text():
        files = (tmp_path / f"here {plain}" / "7.exr" for plain in (True, False))
        modes = [read_picture(file).pixels for file in files]
        assert not np.array_equal(*modes), "the modes do differ"


def test_16_3_a_scope_is_its_threads_alone():
    with scope(threads=1, reproducible=True):
        assert (fl.settings().threads, fl.settings().reproducible) == (1, True)
        seen: list[Any] = []
        now = fl.settings()  # Its properties say what holds where they are read.
        thread = threading.Thread(target=lambda: seen.append((now.threads, now.reproducible)))
        thread.start()
        thread.join()
    assert seen == [(fl.settings().threads, False)] and not fl.settings().reproducible


@pytest.fixture
def alone() -> Iterator[Any]:
    with workers(1) as client:
        yield client


def test_16_4_no_success_without_the_files(alone: Any, tmp_path: Path, monkeypatch: Any):
    # A folder of that name is there for the worker too, but it is another one.
    for place in ("here", "there"):
        (tmp_path / place / "out").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "here")
    alone.run(os.chdir, str(tmp_path / "there"))
    monkeypatch.setattr(crew, "_LATE", 0.3)
    with pytest.raises(OSError, match=r"\.png: a worker has written it, but here it is not"):
        SMALL.write("/proc/self/cwd/out/%d.png", "1-3", dask=alone)
    assert len(contents(tmp_path / "there" / "out")) == 3


def test_33_a_worker_that_differs_refuses_before_its_first_frame(alone: Any, tmp_path: Path):
    def change(by: int) -> None:
        from flurries.scene import fingerprint

        fingerprint.BITS += by

    alone.run(change, 1)
    told = rf"a worker on .* has flurries \S+ \(bits {BITS + 1}\) and not \S+ \(bits {BITS}\), so"
    with pytest.raises(RuntimeError, match=told):
        SMALL.write(tmp_path / "%d.png", "1-3", dask=alone)
    assert not list(tmp_path.iterdir())
    alone.run(change, -1)
    assert SMALL.write(tmp_path / "%d.png", "1-3", dask=alone).written == [1, 2, 3]


def test_16_9_without_workers_it_says_so_and_stops(tmp_path: Path):
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=":0", silence_logs=50) as local,
        pytest.warns(UserWarning, match=r"waiting for a worker at tcp://.*, 1 s at most"),
        pytest.raises(TimeoutError, match=r"no worker at tcp://.* for 1 s"),
    ):
        SMALL.write(tmp_path / "%d.png", "1-2", dask=local.scheduler_address, dask_patience=1.0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("count", [1, 2])
def test_33_a_stopped_worker_is_named(count: int, tmp_path: Path, monkeypatch: Any):
    group(1, monkeypatch)
    SMALL.write(tmp_path / "here" / "%d.png", "1-30")

    def progress(numbers: Any) -> Iterator[int]:
        for number in numbers:
            if number == 3:
                os.kill(stopped, signal.SIGSTOP)
            yield number

    with workers(count) as client:
        address, stopped = client.run(os.getpid).popitem()
        try:
            end = pytest.raises(TimeoutError, match="no worker") if count == 1 else nullcontext()
            with end, warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                SMALL.write(
                    tmp_path / "there" / "%d.png", "1-30", dask=client, progress=progress,
                    dask_patience=3.0 if count == 1 else 15.0,
                )  # fmt: skip
        finally:
            os.kill(stopped, signal.SIGCONT)
    assert any(f"the worker at {address} is silent" in str(one.message) for one in said)
    if count > 1:
        assert contents(tmp_path / "there") == contents(tmp_path / "here")


SCHEDULER = """
import asyncio, sys
from distributed import Nanny, Scheduler, Worker
async def serve():
    async with Scheduler(port=0, dashboard_address=None, host="127.0.0.1") as scheduler:
        async with Worker(scheduler.address, nthreads=1):
            print(scheduler.address, flush=True)
            await asyncio.sleep(300)
asyncio.run(serve())
"""


# The command line, which waits a second for a scheduler.
IMPATIENT = """
import sys
from flurries.cli import main
from flurries.output import cluster
cluster._GREETING = 1.0
sys.exit(main(sys.argv[1:]))
"""


def test_16_9_a_scheduler_that_dies_is_one_sentence(tmp_path: Path):
    server = subprocess.Popen(
        [sys.executable, "-c", SCHEDULER], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        text=True,
    )  # fmt: skip
    assert server.stdout is not None
    words = ["#304050", "--snow", "heavy", "--size", "320x240", "--frames", "1-4000", "--quiet"]
    command = [sys.executable, "-c", IMPATIENT, "render", *words, "-o", "out/%d.png"]
    run = subprocess.Popen(
        [*command, "--dask", server.stdout.readline().strip()], cwd=tmp_path, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    end = time.monotonic() + 60
    while len(list(tmp_path.glob("out/[0-9]*.png"))) < 2 and time.monotonic() < end:
        time.sleep(0.02)
    server.kill()
    server.communicate()
    out, err = run.communicate(timeout=90)
    assert run.returncode == 2 and out == ""
    # On a busy machine the worker is missed before the scheduler is.
    assert [line for line in err.splitlines() if line and "is silent" not in line] == [
        "flurries: dask: the scheduler is gone; finished files stay, run again to go on"
    ]
    # A line without its file is a frame that is not made yet.
    if list(tmp_path.glob("out/[0-9]*.png")):
        assert all(sentence.endswith("is missing") for sentence in check(tmp_path / "out")[1])


@pytest.mark.parametrize("where", ["tcp://127.0.0.1:9", "tcp://[::"])
def test_16_9_an_address_that_is_none_is_one_sentence(where: str, tmp_path: Path):
    words = ["render", "#304050", "--snow", "heavy", "--frames", "1", "-o", tmp_path / "%d.png"]
    done = python(IMPATIENT, *words, f"--dask={where}")
    assert done.returncode == 2 and done.stdout == ""
    assert len(done.stderr.splitlines()) == 1 and where in done.stderr, done.stderr
