"""`flurries corrupt`: a folder of pictures in weather."""

from __future__ import annotations

from typing import Any

import click

from flurries.augment import corrupt as sets
from flurries.cli.options import FILE, OVERWRITE, OneOf, command, dask, option, voice
from flurries.cli.words import Words, count, say

FAILED = 2


@command(
    "flurries corrupt photos photos-in-weather --weather snow,fog --severity 1-5",
    "flurries corrupt photos photos-in-rain --weather rain --severity 3 --workers 2",
)
@click.argument("source", metavar="IN_DIR", type=FILE)
@click.argument("target", metavar="OUT_DIR", type=FILE)
@option("--weather", default="snow", metavar="NAMES", example="snow,fog",
        help="snow, rain or fog, or several with commas")  # fmt: skip
@option("--severity", default="1-5", metavar="RANGE", help="how bad the weather is, from 1 to 5",
        example="2,4")  # fmt: skip
@option("--profile", type=OneOf(["natural", "hard"]), default="natural",
        help="weather as it is, or as hard as published corruptions", example="hard")  # fmt: skip
@option("--seed", type=int, default=0, metavar="N", example="7",
        help="which of all sets of this kind")  # fmt: skip
@option("--workers", type=int, metavar="N", unset="all cores", help="processes", example="4")
@dask("processes of this machine")
@OVERWRITE
@voice
def corrupt(words: Words, source: str, target: str, weather: str, **given: Any) -> int:
    """Write every picture of IN_DIR, and of folders in it, to OUT_DIR/WEATHER/SEVERITY/NAME.

    Prints the file that lists them. Run again, it makes only what is missing.
    """
    made = sets.corrupt(
        source, target, weather=weather.split(","), progress=words.progress("picture"), **given
    )
    kept = len(made.kept)
    there = f", {kept} {'was' if kept == 1 else 'were'} there already" if kept else ""
    words.say(f"{count(len(made.written), 'picture')} written{there}")
    for why, number in made.skipped.items():
        words.say(f"{count(number, 'file')} skipped: {why}")
    for name, why in made.failed.items():
        say(f"{name}: {why}")
    print(made.journal)
    return FAILED if made.failed else 0
