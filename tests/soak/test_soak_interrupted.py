"""Runs and workers that are killed at random times: the same bits, nothing left."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import dask
import numpy as np
import pytest
from length import times

from flurries.output.store import check
from workers import group, workers


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("locks", ["locks", "lockless"])
def test_16_hundred_rounds_of_four_processes(locks: str, tmp_path: Path):
    from test_nothing_wrong import killed

    killed(locks, times(100), tmp_path)


# A Dask worker ------------------------------------------------------------------------------------


def test_dask_workers_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from test_cluster import SLOW  # its effect takes a while, so that kills come in between

    count, random = times(50), np.random.default_rng(2)
    group(4, monkeypatch)
    SLOW.write(tmp_path / "whole" / "%04d.png", "1-32")
    want, during = contents(tmp_path / "whole"), 0
    for number in range(count):
        # A cluster for each: one that has lost many workers is slow to replace them.
        with dask.config.set({"distributed.scheduler.allowed-failures": 5}), workers(2) as client:
            client.wait_for_workers(2, timeout=120)
            client.run(sys.path.insert, 0, str(Path(__file__).parents[1]))
            pids = list(client.run(os.getpid).values())
            out, result = tmp_path / str(number), []

            def work(out: Path = out, result: list[Any] = result, client: Any = client) -> None:
                result.append(SLOW.write(out / "%04d.png", "1-32", dask=client))

            thread = threading.Thread(target=work)
            thread.start()
            time.sleep(random.uniform(0.05, 1.0))
            during += thread.is_alive()
            os.kill(pids[int(random.integers(len(pids)))], signal.SIGKILL)
            thread.join(120)
            assert result and sorted(result[0].written + result[0].kept) == list(range(1, 33))
            assert contents(out) == want and check(out)[1] == []
    assert during > 0
