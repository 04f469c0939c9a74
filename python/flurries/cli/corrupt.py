"""`flurries corrupt` and `flurries benchmark`: data sets in weather, and scores of a model."""

from typing import Any

import click

from flurries.augment import benchmark as benchmarks
from flurries.augment import corrupt as sets
from flurries.augment.layouts import LAYOUTS
from flurries.augment.sets import TRUTH
from flurries.cli.options import FILE, OVERWRITE, command, dask, option, switch, voice
from flurries.cli.render import DIFFERENT
from flurries.cli.words import Words, count, say

FAILED = 2

LAYOUT = option("--layout", tuple(sorted(LAYOUTS)), None, "kitti", "told by its folders",
                "where the set has its pictures, films and pairs")  # fmt: skip
WORKERS = option("--workers", int, "N", "4", "all cores", "processes")


@command(
    "flurries corrupt photos photos-in-weather --weather snow,fog --severity 1-5",
    "flurries corrupt photos photos-in-rain --weather rain --exclude 'raw/*' --dry-run",
)
@click.argument("source", metavar="IN_DIR", type=FILE)
@click.argument("target", metavar="OUT_DIR", type=FILE)
@option("--weather", str, "NAMES", "snow,fog", None,
        "snow, rain or fog, or several with commas", default="snow")  # fmt: skip
@option("--severity", str, "RANGE", "2,4", None, "how bad the weather is, from 1 to 5",
        default="1-5")  # fmt: skip
@option("--profile", ("natural", "hard"), None, "hard", None,
        "weather as it is, or harder, for benchmarks", default="natural")  # fmt: skip
@option("--seed", int, "N", "7", "0", "which of all sets of this kind", default=0)
@LAYOUT
@option("--include", str, "GLOB", "val/*", "all",
        "take these files alone; a * stands for slashes, too", multiple=True)  # fmt: skip
@option("--exclude", str, "GLOB", "velodyne/*", "none", "leave these files out", multiple=True)
@option("--films/--no-films", bool, None, None, "as the layout says",
        "pictures with running numbers are frames of films", default=None)  # fmt: skip
@option("--pairs/--no-pairs", bool, None, None, "as the layout says",
        "left and right are a stereo pair", default=None)  # fmt: skip
@option("--fps", float, "X", "24", "the layout's", "frames per second of films")
@option("--focal", float, "X", "1.1", "the layout's", "focal length in widths of the picture")
@option("--distance", float, "M", "0.2", "the layout's", "metres between the two cameras")
@option("--depths", str, "TEXT:TEXT", "rgb:depth", "none",
        "a text in a picture's path, and what stands there in that of its depth")  # fmt: skip
@option("--depth-unit", float, "M", "0.001", None, "metres of one step of the depths", default=1.0)
@option("--labels", str, "KIND=TEXT:TEXT", "flow=rgb:flow", "the layout's",
        "the same for boxes, masks, flow, and masks of wet ground", multiple=True)  # fmt: skip
@option("--truth", str, "NAMES", "alpha,depth", "none", f"to write, too: {', '.join(TRUTH)}")
@option("--shards", int, "N", "1000", "none", "samples of each tar for webdataset", default=0)
@option("--shade", float, "M", "500", None, "metres of the weather overhead, which dim the light",
        default=0.0)  # fmt: skip
@option("--drops", float, "N", "30", None, "drops on the lens", default=0.0)
@switch("--dry-run", "say what would be made, and make nothing")
@WORKERS
@dask("processes of this machine")
@OVERWRITE
@voice
def corrupt(
    words: Words, source: str, target: str, weather: str, truth: str | None, depths: str | None,
    labels: tuple[str, ...], dry_run: bool, **how: Any,
) -> int:  # fmt: skip
    """Write the data set IN_DIR in weather: its pictures changed, other files copied.

    Writes to OUT_DIR/WEATHER/SEVERITY and prints the file that lists all. Run again, it makes only
    what is missing.
    """
    pair: Any = None if depths is None else tuple(depths.split(":"))
    told: Any = {
        kind: tuple(text.split(":")) for kind, _, text in (o.partition("=") for o in labels)
    }
    made = sets.corrupt(
        source, target, weather=weather.split(","), truth=truth.split(",") if truth else (),
        depths=pair, labels=told, dry_run=dry_run, progress=words.progress("file"), **how,
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


@command(
    "flurries benchmark photos-bench --of photos",
    "flurries benchmark photos-bench --of photos --like photos-bench/benchmark.json",
)
@click.argument("folder", metavar="SET", type=FILE)
@option("--of", FILE, "IN_DIR", "photos", "the set is there", "data set to write in weather")
@option("--like", FILE, "FILE", "theirs/benchmark.json", "the set's own",
        "hashes to compare with")  # fmt: skip
@LAYOUT
@WORKERS
@option("--predictions", FILE, "DIR", "mine", "no scores",
        "predictions to score: DIR/hard/snow/3.csv and so on")  # fmt: skip
@option("--truth", str, "TEXT", "image_2:flow_occ", "told by the set",
        "file of classes or boxes, or what in a picture's path leads to its flow")  # fmt: skip
@option("--plot", FILE, "FILE", "curves.png", "none", "picture of the scores")
@voice
def benchmark(
    words: Words, folder: str, of: str | None, like: str | None, predictions: str | None,
    truth: str | None, plot: str | None, **how: Any,
) -> int:  # fmt: skip
    """Write a data set in every weather, severity and profile, or score predictions of it.

    Prints the scores. Says whether the pixels are those of another's set.
    """
    code = 0
    if of is not None:
        bar = words.progress("file")
        differs, failed = benchmarks.make(of, folder, like=like, progress=bar, **how)
        for name, why in failed.items():
            say(f"{name}: {why}")
        words.say(f"{folder}: {'differs in ' + ', '.join(differs) if differs else 'OK'}")
        code = FAILED if failed else DIFFERENT if differs else 0
    elif predictions is None:
        raise click.UsageError("give --of to write the set, or --predictions to score some")
    if predictions is not None:
        scores = benchmarks.score(folder, predictions, truth=truth)
        print(scores)
        if plot is not None:
            scores.plot(plot)
    return code
