"""Memory that a frame gives back is used again, and never while anybody looks at it."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

import flurries as fl
from flurries.frame.planes import plane


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
