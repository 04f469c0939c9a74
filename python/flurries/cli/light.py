"""`flurries light`: the light of a shot, to print and to save."""

from __future__ import annotations

from pathlib import Path

import click

from flurries.cli.options import FILE, OVERWRITE, command, option, switch, voice
from flurries.cli.words import Words
from flurries.scene.scene import find_light, open_scene
from flurries.scene.toml.writer import describe


@command(
    "flurries light photo.jpg",
    "flurries light plate.%04d.exr -o shot.toml",
    "flurries light plate.%04d.exr --keys",
)
@click.argument("source", metavar="SCENE|PICTURE", type=FILE)
@option("-o --output", FILE, "SCENE", "scene.toml", "only printed",
        "scene file that gets it; the SCENE itself is written anew")  # fmt: skip
@switch("--keys", "a key for each of the frames: a sky that changes itself")
@OVERWRITE
@voice
def light(words: Words, source: str, output: str | None, keys: bool, overwrite: bool) -> None:
    """Find the light of a shot in nine frames of its plate, and print it as a scene file has it."""
    import tomli_w

    new = output is None or overwrite or Path(output).absolute() == Path(source).absolute()
    if output is not None and not new and Path(output).exists():
        raise click.UsageError(f"{output} is there already; --overwrite replaces it")
    scene = open_scene(source)
    scene = scene.replace(light=find_light(scene, keyed=keys))
    print(tomli_w.dumps({"light": describe(scene, leave_out=("effects",))["light"]}), end="")
    if output is not None:
        scene.save(output)
        words.say(f"{output} has the light")
