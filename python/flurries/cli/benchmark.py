"""`flurries benchmark`: a data set in a fixed table of weathers, and scores of a model on it."""

from typing import Any

import click

from flurries.augment import benchmark as sets
from flurries.augment.layouts import LAYOUTS
from flurries.cli.check import DIFFERENT
from flurries.cli.corrupt import FAILED
from flurries.cli.options import FILE, command, option, voice
from flurries.cli.words import Words, say


@command(
    "flurries benchmark photos-bench --of photos",
    "flurries benchmark photos-bench --of photos --like photos-bench/benchmark.json",
)
@click.argument("folder", metavar="SET", type=FILE)
@option("--of", FILE, "IN_DIR", "photos", "the set is there", "data set to write in weather")
@option("--like", FILE, "FILE", "theirs/benchmark.json", "the set's own",
        "hashes to compare with")  # fmt: skip
@option("--layout", tuple(sorted(LAYOUTS)), None, "kitti", "told by its folders",
        "where the data set has its pictures")  # fmt: skip
@option("--workers", int, "N", "4", "all cores", "processes")
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
        differs, failed = sets.make(of, folder, like=like, progress=words.progress("file"), **how)
        for name, why in failed.items():
            say(f"{name}: {why}")
        words.say(f"{folder}: {'differs in ' + ', '.join(differs) if differs else 'OK'}")
        code = FAILED if failed else DIFFERENT if differs else 0
    elif predictions is None:
        raise click.UsageError("give --of to write the set, or --predictions to score some")
    if predictions is not None:
        scores = sets.score(folder, predictions, truth=truth)
        print(scores)
        if plot is not None:
            scores.plot(plot)
    return code
