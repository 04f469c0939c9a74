"""Clusters that cannot work, and modes on one worker: each case named by its number in issue 16."""

import os
import shlex
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pytest
import yaml

import flurries as fl
from flurries._threads import scope
from flurries.io import read_picture
from flurries.output import crew
from flurries.output.journal import check
from flurries.scene.fingerprint import BITS
from test_nothing_wrong import SMALL, contents, python
from workers import group, workers


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
def client() -> Iterator[Any]:
    with workers(1) as client:
        yield client


def test_16_4_no_success_without_the_files(client: Any, tmp_path: Path, monkeypatch: Any):
    # A folder of that name is there for the worker too, but it is another one.
    for place in ("here", "there"):
        (tmp_path / place / "out").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "here")
    client.run(os.chdir, str(tmp_path / "there"))
    monkeypatch.setattr(crew, "_LATE", 0.3)
    with pytest.raises(OSError, match=r"\.png: a worker has written it, but here it is not"):
        SMALL.write("/proc/self/cwd/out/%d.png", "1-3", dask=client)
    assert len(contents(tmp_path / "there" / "out")) == 3


def test_33_a_worker_that_differs_refuses_before_its_first_frame(client: Any, tmp_path: Path):
    def change(by: int) -> None:
        from flurries.scene import fingerprint

        fingerprint.BITS += by

    client.run(change, 1)
    told = rf"a worker on .* has flurries \S+ \(bits {BITS + 1}\) and not \S+ \(bits {BITS}\), so"
    with pytest.raises(RuntimeError, match=told):
        SMALL.write(tmp_path / "%d.png", "1-3", dask=client)
    assert not list(tmp_path.iterdir())
    client.run(change, -1)
    assert SMALL.write(tmp_path / "%d.png", "1-3", dask=client).written == [1, 2, 3]


def test_33_the_arrays_of_the_page_run(tmp_path: Path):
    page = (Path(__file__).parents[1] / "docs" / "clusters.md").read_text()
    script, template = [b for b in page.split("```") if b[:4] in ("bash", "yaml") and "x4" in b]
    SMALL.save(tmp_path / "scene.toml")
    run = yaml.safe_load(template[4:])["steps"][0]["script"]["actions"]["onRun"]
    words = " ".join([run["command"], *run["args"]])
    words = words.replace("{{Task.Param.First}}", "$SLURM_ARRAY_TASK_ID")
    assert shlex.split(words) == shlex.split(script.splitlines()[-1])
    words = f"{sys.executable} -m {words}"
    for number in range(1, 5):
        own = {**os.environ, "SLURM_ARRAY_TASK_ID": str(number)}
        subprocess.run(words, shell=True, cwd=tmp_path, env=own, check=True, capture_output=True)
    assert sorted(contents(tmp_path / "frames")) == [f"{n:04}.png" for n in range(1, 13)]
    assert check(tmp_path / "frames") == (12, [])


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
