"""Flakes and drops: where they are, and their picture."""

from flurries.particles.places import edge_fade, positions, sway_offsets
from flurries.particles.splatting import ids, splat

__all__ = ["edge_fade", "ids", "positions", "splat", "sway_offsets"]
