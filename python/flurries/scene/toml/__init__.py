"""Scenes as TOML files: strict to read, every value that differs from the default to write."""

from flurries.scene.toml.reader import load
from flurries.scene.toml.writer import save

__all__ = ["load", "save"]
