"""How a lens blurs the layers of the texture: each by its own circle of confusion."""

from __future__ import annotations

from flurries.camera.optics import Blur

# Circles are told apart in steps of this, px: sheets are kept for each.
STEP = 0.125

# Narrower circles than this, px, blur nothing.
LEAST = 0.25


def circles_of(blur: Blur | None, depths: list[float]) -> tuple[float, ...]:
    """Return the circles of confusion at depths, px, in steps; () where all is sharp."""
    if blur is None:
        return ()
    found = [STEP * round(blur.circle(depth) / STEP) for depth in depths]
    sharp = all(circle < LEAST for circle in found)
    return () if sharp else tuple(found)
