"""Falling snow, synthesized in the frequency domain, with particles on top."""

from flurries import camera, composite, spectral
from flurries._core import InternalError
from flurries.threads import set_threads, threads

__all__ = ["InternalError", "camera", "composite", "set_threads", "spectral", "threads"]
