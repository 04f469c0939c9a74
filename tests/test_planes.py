"""Memory that a frame gives back is used again, and never while anybody looks at it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import flurries as fl
from flurries.frame import planes
from flurries.frame.planes import plane

SHAPE = (700, 701)


def place(array: np.ndarray) -> int:
    return array.__array_interface__["data"][0]


def test_memory_is_used_again_once_its_last_view_is_gone(monkeypatch: pytest.MonkeyPatch):
    first = plane(SHAPE)
    where, view = place(first), first[1:, ::2].T
    assert first.flags.c_contiguous and first.flags.writeable and first.dtype == np.float32
    del first
    assert place(plane(SHAPE)) != where
    del view
    assert place(plane((SHAPE[1], SHAPE[0]), np.int32)) == where
    # No more than the limit is kept.
    monkeypatch.setattr(planes, "MOST", 8 << 20)
    held = [plane((1 << 20,)) for _ in range(5)]
    held.clear()
    assert sum(one.nbytes for one in planes._free) <= 8 << 20


def test_threads_never_share():
    def work(number: int) -> bool:
        for _ in range(60):
            mine = [plane((512, 513)), plane((600, 601))]
            for one in mine:
                one.fill(number)
            if not all((one == number).all() for one in mine):
                return False
        return True

    with ThreadPoolExecutor(6) as pool:
        assert all(pool.map(work, range(6)))


def test_a_held_frame_stays_what_it_is():
    scene = fl.Scene("#304050", size=(640, 480), effects=[fl.Snow("heavy")])
    held = vars(scene.layers(1))
    kept = {name: value.copy() for name, value in held.items() if isinstance(value, np.ndarray)}
    for t in (2, 3):
        scene.layers(t)
    assert len(kept) >= 5
    for name, value in kept.items():
        np.testing.assert_array_equal(held[name], value, err_msg=name)
