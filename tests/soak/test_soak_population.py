"""Rates, densities and extinctions of snow and rain, measured from the opacity of rendered frames.

Opacities are those of drawn flakes and of the texture, before walls. The judge is a sum over
diameters in NumPy with the laws of the docs, and the law of Beer and Lambert.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from length import times

import flurries as fl
from measure import cover

NEAR = 2.0


def diameters(sizes: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return diameters in metres, and their shares by exp(-slope D) with the mean that is asked."""
    low, mean, high = sizes
    edges = np.linspace(low, high, 20_001)
    at = 0.5 * (edges[1:] + edges[:-1])

    def shares(slope: float) -> np.ndarray:
        weight = np.exp(-slope * (at - low))
        return weight / weight.sum()

    below, above = -1e5, 1e5
    for _ in range(200):
        slope = 0.5 * (below + above)
        below, above = (slope, above) if shares(slope) @ at > mean else (below, slope)
    return at, shares(slope)


def carried(effect: fl.Snow | fl.Rain) -> tuple[float, float]:
    """Return mm/h of water, and 1/m of extinction, of the flakes or drops per m3."""
    if isinstance(effect, fl.Snow):
        at, share = diameters(effect.flake_size)
        mass = 1e-6 * 0.178 * math.pi / 6.0 * (1e3 * at) ** 2.078
        speed = 0.8 * (1e3 * at) ** 0.16
    else:
        at, share = diameters(effect.drop_size)
        mass = 1000.0 * math.pi / 6.0 * at**3
        speed = 9.65 - 10.3 * np.exp(-600.0 * at)
    area = effect.opacity * 0.25 * math.pi * at**2
    return 3600.0 * effect.density * float(share @ (mass * speed)), effect.density * float(
        share @ area
    )


@pytest.mark.parametrize("wall", [20.0, 60.0, 200.0])
@pytest.mark.parametrize("rate", [0.5, 1.0, 2.5, 5.0, 10.0])
@pytest.mark.parametrize("kind", [fl.Snow, fl.Rain])
def test_rates_and_extinctions_are_shown_as_asked(kind: type, rate: float, wall: float):
    effect = kind(rate=rate, near=NEAR)
    water, extinction = carried(effect)
    assert water == pytest.approx(rate, rel=0.02)
    frames = times(24, least=12)
    seen = []
    for seed in range(frames // 4):
        scene = fl.Scene("#000000", size=(400, 300), effects=[effect], depth=wall, seed=seed)
        seen += [1.0 - cover(scene, 400.0 * n).mean(dtype=float) for n in range(4)]
    # From the middle of the fade before the lens on. What is not hidden is a mean of independent
    # flakes, so that this is exact; the noise of the mean is allowed twice.
    wanted = math.exp(-extinction * (wall - 1.125 * NEAR))
    noise = np.std(seen, ddof=1) / math.sqrt(frames)
    measured = -math.log(np.mean(seen)) / (wall - 1.125 * NEAR)
    print(f"{kind.__name__} {rate} mm/h, {wall} m: {measured / extinction:.4f}")
    assert np.mean(seen) == pytest.approx(
        wanted, abs=0.02 * -wanted * math.log(wanted) + 2.0 * noise
    )
