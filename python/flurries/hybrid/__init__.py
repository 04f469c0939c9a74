"""Particles and texture that look like fully simulated snow.

A :class:`Population` says what snow is in space. :func:`simulate` draws every flake of it,
:func:`statistics` says what that looks like on average, :func:`match` chooses the texture that
stands for the flakes too small to be seen one by one, and :func:`render` draws the hybrid.
"""

from __future__ import annotations

from flurries.hybrid.matching import Match, match
from flurries.hybrid.picture import render, simulate
from flurries.hybrid.population import Population
from flurries.hybrid.statistics import Octaves, statistics

__all__ = ["Match", "Octaves", "Population", "match", "render", "simulate", "statistics"]
