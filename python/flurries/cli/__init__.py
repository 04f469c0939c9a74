"""The command line."""

from flurries.cli.main import main

__all__ = ["main"]
