"""`flurries corrupt`: a folder of pictures in weather."""

from __future__ import annotations

from typing import Any

import click

from flurries.augment import corrupt as sets
from flurries.augment.layouts import LAYOUTS
from flurries.cli.options import FILE, OVERWRITE, OneOf, command, dask, option, voice
from flurries.cli.words import Words, count, say

FAILED = 2


@command(
    "flurries corrupt photos photos-in-weather --weather snow,fog --severity 1-5",
    "flurries corrupt photos photos-in-rain --weather rain --exclude 'raw/*' --dry-run",
)
@click.argument("source", metavar="IN_DIR", type=FILE)
@click.argument("target", metavar="OUT_DIR", type=FILE)
@option("--weather", default="snow", metavar="NAMES", example="snow,fog",
        help="snow, rain or fog, or several with commas")  # fmt: skip
@option("--severity", default="1-5", metavar="RANGE", help="how bad the weather is, from 1 to 5",
        example="2,4")  # fmt: skip
@option("--profile", type=OneOf(["natural", "hard"]), default="natural",
        help="weather as it is, or harder, for benchmarks", example="hard")  # fmt: skip
@option("--seed", type=int, default=0, metavar="N", example="7",
        help="which of all sets of this kind")  # fmt: skip
@option("--layout", type=OneOf(sorted(LAYOUTS)), unset="told by its folders",
        help="where the set has its pictures, films and pairs", example="kitti")  # fmt: skip
@option("--include", multiple=True, metavar="GLOB", unset="all", example="val/*",
        help="take these files alone; a * stands for slashes, too")  # fmt: skip
@option("--exclude", multiple=True, metavar="GLOB", unset="none", example="velodyne/*",
        help="leave these files out")  # fmt: skip
@option("--films/--no-films", default=None, unset="as the layout says",
        help="pictures with running numbers are frames of films")  # fmt: skip
@option("--pairs/--no-pairs", default=None, unset="as the layout says",
        help="left and right are a stereo pair")  # fmt: skip
@option("--fps", type=float, metavar="X", unset="the layout's", help="frames per second of films",
        example="24")  # fmt: skip
@option("--focal", type=float, metavar="X", unset="the layout's",
        help="focal length in widths of the picture", example="1.1")  # fmt: skip
@option("--distance", type=float, metavar="M", unset="the layout's",
        help="metres between the two cameras", example="0.2")  # fmt: skip
@option("--depths", metavar="TEXT:TEXT", unset="none", example="rgb:depth",
        help="a text in a picture's path, and what stands there in that of its depth")  # fmt: skip
@option("--depth-unit", type=float, default=1.0, metavar="M", example="0.001",
        help="metres of one step of the depths")  # fmt: skip
@option("--truth", metavar="NAMES", unset="none", example="alpha,depth",
        help="planes to write, too: alpha, depth, disparity, motion")  # fmt: skip
@option("--dry-run", is_flag=True, help="say what would be made, and make nothing")
@option("--workers", type=int, metavar="N", unset="all cores", help="processes", example="4")
@dask("processes of this machine")
@OVERWRITE
@voice
def corrupt(
    words: Words, source: str, target: str, weather: str, truth: str | None, depths: str | None,
    include: tuple[str, ...], exclude: tuple[str, ...], dry_run: bool, **how: Any,
) -> int:  # fmt: skip
    """Write the data set IN_DIR in weather: its pictures changed, other files copied.

    Writes to OUT_DIR/WEATHER/SEVERITY and prints the file that lists all. Run again, it makes only
    what is missing.
    """
    made = sets.corrupt(
        source, target, weather=weather.split(","), truth=truth.split(",") if truth else (),
        depths=None if depths is None else tuple(depths.split(":")),  # type: ignore[arg-type]
        include=include, exclude=exclude, dry_run=dry_run, progress=words.progress("file"), **how,
    )  # fmt: skip
    words.say(f"{source}: layout {made.layout}")
    for why, number in {**made.found, **made.skipped}.items():
        words.say(f"{count(number, 'file')}: {why}")
    for name, strength in made.strengths.items():
        words.say(f"{name}: {strength}")
    if dry_run:
        return 0
    kept = len(made.kept)
    there = f", {kept} {'was' if kept == 1 else 'were'} there already" if kept else ""
    words.say(f"{count(len(made.written), 'picture')} written{there}")
    for name, why in made.failed.items():
        say(f"{name}: {why}")
    print(made.journal)
    return FAILED if made.failed else 0
