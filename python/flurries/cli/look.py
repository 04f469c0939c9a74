"""`flurries plan`, `light` and `view`: a scene before it is rendered."""

from pathlib import Path
from typing import Any

import click

from flurries.cli.options import FILE, FRAMES, OVERWRITE, WORK, command, option, switch, voice
from flurries.cli.weather import scene_of, scene_options
from flurries.cli.words import Words
from flurries.scene.scene import find_light, open_scene
from flurries.scene.toml.writer import describe
from flurries.viewer.server import Server, open_page, serve


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
    found = scene.plan(frames, probe=not no_probe, accuracy=accuracy)
    print(found.to_json() if as_json else found)


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


@command(
    "flurries view photo.jpg --snow heavy", "flurries view scene.toml --port 8080 --no-browser"
)
@scene_options
@option("--save", FILE, "FILE", "tuned.toml", "NAME-tuned.toml beside the input",
        "where the button writes the scene")  # fmt: skip
@option("--pixels", int, "N", "800", None, "longer side of the picture", default=512)
@option("--port", click.IntRange(0, 65535), "N", "8080", "0",
        "port of the page; 0 takes any that is free", default=0)  # fmt: skip
@switch("--no-browser", "only print the address")
@WORK
@voice
def view(
    words: Words, save: str | None, pixels: int, port: int, no_browser: bool, **given: Any
) -> None:
    """Show a scene in the browser, with sliders for its weather. Ctrl-C ends it."""
    path = Path(given["source"])
    target = save or path.with_name(f"{path.stem.lstrip('#') or 'scene'}-tuned.toml")
    server = Server(scene_of(**given), port=port, size=pixels, save=target)
    print(server.url, flush=True)
    words.say("Ctrl-C ends the viewer")
    if not no_browser:
        open_page(server)
    serve(server)
