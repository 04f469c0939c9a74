"""Hard cases of gas: billboard errors, footprints, near plane, occlusion, sums."""

from __future__ import annotations

from typing import Any

import numpy as np

import flurries as fl
from hard.case import Case

G = fl.gas
EYE = fl.Camera(300.0)


def drawn(depth: float, *, radius: float = 0.3, density: float = 0.5, wall: float | None = None,
          shape: tuple[int, int] = (33, 33), **options: Any) -> Any:  # fmt: skip
    """The opacity at the middle of a particle straight ahead."""

    def measure(dtype: Any) -> float:
        hidden = None if wall is None else np.full(shape, wall, dtype)
        got = G.alpha(shape, [[0.0, 0.0, depth]], radius, density, EYE, depth=hidden, dtype=dtype,
                      **options)  # fmt: skip
        return float(got[shape[0] // 2, shape[1] // 2])

    return measure


def equal_depths(dtype: Any) -> float:
    """Of two opaque particles at one depth the first is in front: the red of the middle."""
    got = G.splat((9, 9), [[0.0, 0.0, 3.0]] * 2, 3.0, 1.0, [[1.0, 0, 0], [0, 1.0, 0]],
                  fl.Camera(300.0, center=(4.5, 4.5)), dtype=dtype)  # fmt: skip
    return float(got[4, 4, 0])


CASES = [
    Case("a particle 2,450 px wide, at its middle",
         drawn(0.1, radius=0.9, near=1e-3, near_mode="cull"), 0.5, 1e-6,
         "the pixel's own middle is on the axis", "bounds are clamped before they are integers"),
    Case("opacity 1 hides all", drawn(3.0, radius=2.0, density=1.0), 1.0, (1e-6, 1e-9),
         "the pixel's own middle is on the axis", "no logarithm of 0"),
    Case("at the near plane a particle has faded", drawn(0.2, near=0.2), 0.0, 0.0, "exact",
         "smoothstep from the near plane on"),
    Case("a third of its radius behind it is whole", drawn(0.3000001, near=0.2), 0.5, 1e-6,
         "smoothstep ends", "smoothstep ends at near + r/3"),
    Case("behind the eye there is nothing", drawn(-1.0), 0.0, 0.0, "exact", "the near plane"),
    Case("a particle at the wall's depth, hard", drawn(3.0, wall=3.0, occlusion="hard"), 0.0, 0.0,
         "exact", "strictly in front"),
    Case("a particle at the wall's depth, soft: half", drawn(3.0, wall=3.0), 0.25, (1e-6, 1e-12),
         "Phi(0) is 1/2", "the normal law"),
    Case("a wall before the near plane hides all, line integral",
         drawn(0.5, near=0.2, wall=0.1, footprint="volume"), 0.0, 1e-12, "Phi of equal ends",
         "an empty interval is empty"),
    Case("at equal depths the first comes first", equal_depths, 1.0, (1e-6, 1e-9),
         "an opaque middle", "a stable order"),
]  # fmt: skip
