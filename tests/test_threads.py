"""The bits of every kernel that shares its work do not depend on the number of threads."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from every import every
from same_bits import KERNELS, digest


@every("name", KERNELS)
def test_bits_do_not_depend_on_the_number_of_threads(name: str, threads: Callable[[int], None]):
    made = set()
    for count in (1, 2, 3, 8):
        threads(count)
        array = np.asarray(KERNELS[name]())
        assert np.ptp(np.abs(array)) > 0.0, "nothing is drawn"
        made.add(digest(array))
    assert len(made) == 1
