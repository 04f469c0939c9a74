"""The command line."""

from flurries.cli.main import main, program

__all__ = ["main", "program"]
