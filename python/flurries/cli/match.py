"""`flurries match`: from real falling snow to a scene."""

from pathlib import Path

import click
import numpy as np

from flurries.camera import Camera
from flurries.cli.options import FILE, OVERWRITE, command, option, voice
from flurries.cli.words import Words
from flurries.io import write_picture
from flurries.matching.match import match as matched


@command(
    "flurries match snow.mp4 --focal 384 -o fall.toml",
    "flurries match snow.mp4 --report fit.png --fps 25 --focal 384",
)
@click.argument("clip", metavar="CLIP", type=FILE)
@option("--clean", FILE, "PLATE", "plate.png", "the mean of CLIP",
        "CLIP without snow; a still needs it")  # fmt: skip
@option("-o --output", FILE, "SCENE", "scene.toml", "only printed",
        "scene file; without --clean its background is written beside it")  # fmt: skip
@option("--report", FILE, "PICTURE", "fit.png", "no picture",
        "a frame of CLIP beside one of the scene")  # fmt: skip
@option("--focal", float, "PX", "1500", "1.2 widths of CLIP", "focal length of its camera")
@option("--fps", float, "N", "25", "the film's own, else 30", "frames per second of CLIP")
@OVERWRITE
@voice
def match(
    words: Words, clip: str, clean: str | None, output: str | None, report: str | None,
    focal: float | None, fps: float | None, overwrite: bool,
) -> None:  # fmt: skip
    """Find the snow that falls in a film, and print it with its errors."""
    plate = Path(output).with_suffix(".plate.png") if output and clean is None else None
    for file in (output, report, plate):
        if file is not None and not overwrite and Path(file).exists():
            raise click.UsageError(f"{file} is there already; --overwrite replaces it")
    camera = None if focal is None else Camera(focal)
    found = matched(clip, clean, camera, fps, progress=words.progress("frame"))
    print(found)
    if report is not None:
        write_picture(report, found.report())
    if plate is not None:
        # Large ones are made smaller, and their camera's focal length is.
        write_picture(plate, np.rint(255.0 * found.plate).astype(np.uint8))
        camera = found.camera
    if output is not None:
        found.scene(clean or plate, light=found.light, camera=camera).save(output)
        words.say(f"{output} has the scene")
