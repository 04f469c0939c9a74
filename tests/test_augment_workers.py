"""Weather in other processes: forked, spawned, and by joblib; one set, and no hangs."""

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import pytest

import flurries as fl

# From 3.12 on Python warns of any fork beside threads; the test is that it works.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

PICTURE = np.random.default_rng(0).integers(0, 256, (120, 160, 3), dtype=np.uint8)
KINDS = (fl.augment.Snowfall, fl.augment.Rainfall, fl.augment.Fog)
JOBS = [(kind(severity=(2, 4), seed=7), index) for kind in KINDS for index in range(12)]


def made(job: tuple[Any, int]) -> bytes:
    weather, index = job
    result: np.ndarray = weather(PICTURE, index=index)
    return result.tobytes()


@pytest.fixture(scope="module")
def want() -> list[bytes]:
    # The parent has used its threads before anybody forks.
    return [made(job) for job in JOBS]


def by_processes(method: str, workers: int) -> list[bytes]:
    context = multiprocessing.get_context(method)
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        futures = [pool.submit(made, job) for job in reversed(JOBS)]
        return [future.result(timeout=120) for future in futures][::-1]


def by_threads() -> list[bytes]:
    with ThreadPoolExecutor(8) as pool:
        return list(pool.map(made, JOBS))


def by_joblib() -> list[bytes]:
    import joblib

    many = joblib.Parallel(n_jobs=2, backend="loky", timeout=120)
    return list(many(joblib.delayed(made)(job) for job in JOBS))


@pytest.mark.parametrize("way", [
    partial(by_processes, "fork", 3), partial(by_processes, "spawn", 2),
    partial(by_processes, "forkserver", 1), by_threads, by_joblib,
])  # fmt: skip
def test_whoever_makes_them_pictures_are_the_same(way: Callable[[], Any], want: list[bytes]):
    assert way() == want and len(set(want)) == len(JOBS)


def test_without_a_seed_forked_workers_never_share_a_draw():
    with multiprocessing.get_context("fork").Pool(3) as pool:
        seeds = pool.map_async(drawn, [fl.augment.Snowfall()] * 60, chunksize=1).get(120)
    assert len(set(seeds)) == 60


def drawn(weather: Any) -> int:
    number: int = weather.apply(PICTURE[:8, :8]).record["weather_seed"]
    return number
