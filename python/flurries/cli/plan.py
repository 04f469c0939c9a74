"""`flurries plan`: what rendering costs."""

from __future__ import annotations

from typing import Any

from flurries.cli.options import BUDGET, FRAMES, REPRODUCIBLE, THREADS, command, option, voice
from flurries.cli.weather import scene_of, scene_options
from flurries.cli.words import Words
from flurries.frame.calibration import scales


@command(
    "flurries plan photo.jpg --snow heavy",
    "flurries plan scene.toml --frames 1-60 --json",
)
@FRAMES
@scene_options
@option("--json", "as_json", is_flag=True, help="JSON in place of a table")
@option("--calibrate", is_flag=True, help="measure this machine's speed again first")
@BUDGET
@THREADS
@REPRODUCIBLE
@voice
def plan(words: Words, frames: str | None, as_json: bool, calibrate: bool, **given: Any) -> None:
    """Print the steps of a frame, their times and memory, and what is left out and why."""
    scene = scene_of(**given)
    for line in scene.bent:
        words.say(line)
    if calibrate:
        words.say("measuring this machine")
        scales(again=True)
    found = scene.plan(frames)
    print(found.to_json() if as_json else found)
