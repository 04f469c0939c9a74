"""Weather in other processes: forked, spawned, and by joblib; one set, and no hangs."""

import multiprocessing
import warnings
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import flurries as fl

PICTURE = np.random.default_rng(0).integers(0, 256, (120, 160, 3), dtype=np.uint8)
WEATHERS = [
    fl.augment.Snowfall(severity=(2, 4), seed=7),
    fl.augment.Rainfall(severity=(2, 4), seed=7),
    fl.augment.Fog(severity=(2, 4), seed=7),
]
COUNT = 12


def made(job: tuple[Any, int]) -> bytes:
    weather, index = job
    result: np.ndarray = weather(PICTURE, index=index)
    return result.tobytes()


JOBS = [(weather, index) for weather in WEATHERS for index in range(COUNT)]


@pytest.fixture(scope="module")
def want() -> list[bytes]:
    # The parent has used its threads before anybody forks.
    return [made(job) for job in JOBS]


def test_no_two_are_alike(want: list[bytes]):
    assert len(set(want)) == len(JOBS)


@pytest.mark.parametrize("method, workers", [("fork", 3), ("spawn", 2), ("forkserver", 1)])
def test_processes(method: str, workers: int, want: list[bytes]):
    context = multiprocessing.get_context(method)
    with warnings.catch_warnings():
        # From 3.12 on Python warns of any fork beside threads; the test is that it works.
        warnings.simplefilter("ignore", DeprecationWarning)
        with ProcessPoolExecutor(workers, mp_context=context) as pool:
            futures = [pool.submit(made, job) for job in reversed(JOBS)]
            got = [future.result(timeout=120) for future in futures]
    assert got[::-1] == want


def test_threads(want: list[bytes]):
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(made, JOBS)) == want


def test_joblib(want: list[bytes]):
    import joblib

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        got = joblib.Parallel(n_jobs=2, backend="loky", timeout=120)(
            joblib.delayed(made)(job) for job in JOBS
        )
    assert got == want


def test_without_a_seed_forked_workers_never_share_a_draw():
    free = fl.augment.Snowfall()
    context = multiprocessing.get_context("fork")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        with context.Pool(3) as pool:
            seeds = pool.map_async(drawn, [free] * 60, chunksize=1).get(120)
    assert len(set(seeds)) == 60


def drawn(weather: Any) -> int:
    number: int = weather.apply(PICTURE[:8, :8]).record["weather_seed"]
    return number
