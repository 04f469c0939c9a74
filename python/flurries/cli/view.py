"""`flurries view`: a scene in the browser, with sliders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from flurries.cli.options import FILE, WORK, command, option, voice
from flurries.cli.weather import scene_of, scene_options
from flurries.cli.words import Words
from flurries.viewer.server import Server, open_page, serve


@command(
    "flurries view photo.jpg --snow heavy", "flurries view scene.toml --port 8080 --no-browser"
)
@scene_options
@option("--save", metavar="FILE", type=FILE, example="tuned.toml", unset="NAME-tuned.toml beside "
        "the input", help="where the button writes the scene")  # fmt: skip
@option("--pixels", type=int, default=512, metavar="N", help="longer side of the picture",
        example="800")  # fmt: skip
@option("--port", type=click.IntRange(0, 65535), default=0, metavar="N",
        help="port of the page; 0 takes any that is free", example="8080")  # fmt: skip
@option("--no-browser", is_flag=True, help="only print the address")
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
