"""`flurries view`: a scene in the browser, with sliders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from flurries.cli.options import FILE, WORK, command, option, switch, voice
from flurries.cli.weather import scene_of, scene_options
from flurries.cli.words import Words
from flurries.viewer.server import Server, open_page, serve


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
