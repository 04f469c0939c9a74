"""Falling snow, synthesized in the frequency domain, with particles on top."""

from flurries import particles
from flurries._core import InternalError
from flurries.threads import set_threads

__all__ = ["InternalError", "particles", "set_threads"]
