"""Falling snow, synthesized in the frequency domain, with particles on top."""

from flurries._core import InternalError
from flurries.threads import set_threads

__all__ = ["InternalError", "set_threads"]
