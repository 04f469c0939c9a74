"""Flakes and drops: where they are, and their picture."""

from flurries.particles.points import edge_fade, ids, positions, splat, sway_offsets

__all__ = ["edge_fade", "ids", "positions", "splat", "sway_offsets"]
