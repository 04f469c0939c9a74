"""``python -m flurries``: the command line."""

from flurries.cli.main import program

program()
