"""``python -m flurries``: the command line."""

from flurries.cli import program

program()
