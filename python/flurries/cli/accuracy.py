"""`flurries accuracy`: error against time, measured on this machine."""

from __future__ import annotations

import click

from flurries._contract import choice
from flurries.accuracy import AXES, study, write
from flurries.cli.options import FILE, THREADS, command, offer, option, voice
from flurries.cli.words import Words


@command(
    "flurries accuracy --list",
    "flurries accuracy blend shutter --runs 40 -o measured",
    "flurries accuracy -o docs/images/accuracy --page docs/internals/accuracy.md",
)
@click.argument("axes", nargs=-1, metavar="[AXIS]...", shell_complete=offer(AXES))
@option("--list", "only_list", is_flag=True, help="say what can be measured, and measure nothing")
@option("-o", "--output", default="accuracy", metavar="FOLDER", type=FILE, example="measured",
        help="where accuracy.json and the plots go")  # fmt: skip
@option("--runs", type=int, default=20, metavar="N", help="runs of each way, 20 or more",
        example="40")  # fmt: skip
@option("--page", metavar="FILE", type=FILE, unset="none", help="also a page in Markdown",
        example="docs/internals/accuracy.md")  # fmt: skip
@THREADS
@voice
def accuracy(
    words: Words, axes: tuple[str, ...], only_list: bool, output: str, runs: int, page: str | None
) -> None:
    """Measure the error of each approximation against its time; all in about a minute.

    Prints the files: numbers, plots, and on request a page. Plots need flurries[plots].
    """
    if only_list:
        for axis in AXES.values():
            print(f"{axis.name:10} {axis.title}")
        return
    names = [choice("AXIS", name, tuple(AXES)) for name in axes] or None
    found = study(names, runs=runs, progress=words.progress("axis"))
    for file in write(found, output, page=page):
        print(file)
