"""`flurries plan`: what rendering takes."""

from __future__ import annotations

from typing import Any

from flurries.cli.options import FRAMES, WORK, command, switch, voice
from flurries.cli.weather import scene_of, scene_options
from flurries.cli.words import Words


@command(
    "flurries plan photo.jpg --snow heavy",
    "flurries plan scene.toml --frames 1-60 --json",
    "flurries plan scene.toml --accuracy",
)
@FRAMES
@scene_options
@switch("--json as_json", "JSON in place of a table")
@switch("--no-probe", "render nothing: the steps, without times and memory")
@switch("--accuracy", "also what more and fewer drawn flakes take and look like")
@WORK
@voice
def plan(
    words: Words, frames: str | None, as_json: bool, no_probe: bool, accuracy: bool, **given: Any
) -> None:
    """Print the steps of a frame, their times and memory, and what is left out and why."""
    scene = scene_of(**given)
    for line in scene.bent:
        words.say(line)
    found = scene.plan(frames, probe=not no_probe, accuracy=accuracy)
    print(found.to_json() if as_json else found)
