"""Dask workers of a test's own, and frames in groups of a few for them."""

from collections.abc import Iterator
from contextlib import contextmanager

import distributed
import pytest

from flurries.output import cluster, write


@contextmanager
def workers(count: int, threads: int = 1) -> Iterator[distributed.Client]:
    """Start workers in processes of their own; they end with the block."""
    with (
        distributed.LocalCluster(n_workers=count, threads_per_worker=threads,
                                 dashboard_address=":0", silence_logs=50) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):  # fmt: skip
        yield client


def group(size: int, patch: pytest.MonkeyPatch) -> None:
    """Share frames out in groups of so many, so that several tasks have some."""
    for module in (write, cluster):
        patch.setattr(module, "grouped", lambda scene, frames: [
            frames[i : i + size] for i in range(0, len(frames), size)
        ])  # fmt: skip
