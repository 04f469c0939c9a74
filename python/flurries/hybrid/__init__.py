"""Flakes that fill space, drawn one by one, and their statistics in closed form.

A :class:`Population` describes snow in space. :func:`simulate` draws all of its flakes, and
:func:`statistics` returns the mean statistics of such a picture. The snow of scenes, near flakes
drawn and far ones synthesized, is :class:`flurries.Snow`.
"""

from __future__ import annotations

from flurries.hybrid.picture import simulate
from flurries.hybrid.population import Population
from flurries.hybrid.statistics import Octaves, statistics

__all__ = ["Octaves", "Population", "simulate", "statistics"]
