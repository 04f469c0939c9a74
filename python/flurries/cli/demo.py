"""`flurries demo`: the two experiments of Langer 2004 on a photograph, with today's snow."""

from pathlib import Path

import click
import numpy as np

from flurries import io
from flurries._contract import Array
from flurries._trace import current, tracing
from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath
from flurries.cli.options import FILE, THREADS, command, option, voice
from flurries.cli.words import Words, stages
from flurries.effects import Snow, TentSnow
from flurries.io import VideoWriter, write_picture
from flurries.scene.scene import DEFAULT_FOCAL, Scene

FPS = 30.0
FEW = 2000

# Metres per second, forward and upward; with the fall it puts the focus of expansion into the sky.
FLIGHT = (0.0, -0.3, 5.0)


@command("flurries demo", "flurries demo --size 512 --frames 30 -o small")
@option("-o --output", FILE, "FOLDER", "small", None,
        "where the files go; those of an earlier demo are replaced", default="demo")  # fmt: skip
@option("--size", click.IntRange(64, 8192), "PX", "512", None, "side of a frame", default=1024)
@option("--frames", click.IntRange(1, 100_000), "N", "30", None, "length of the films", default=60)
@THREADS
@voice
def demo(words: Words, output: str, size: int, frames: int) -> None:
    """Let it snow on a photograph: films and stills of three ways, a flight, its layers."""
    target = Path(output)
    target.mkdir(parents=True, exist_ok=True)
    picture = io.photograph("rocket", size=(size, size))
    flying, layers = flight(picture), target / "flight.exr"
    made = _film(target / "three.mp4", three(picture), frames, words)
    made += _film(target / "flight.mp4", [flying], frames, words)
    middle = (frames + 1) // 2
    flying.replace(space="linear").write(layers, [middle], layers=True, plate=True, overwrite=True)
    for file in (*made, layers):
        print(file)


def three(picture: Array, *, seed: int = 1) -> list[Scene]:
    """Return the three scenes of experiment (a): few flakes, the paper's texture, flakes."""
    looks: list[Snow | TentSnow] = [
        TentSnow("heavy", flakes=FEW, texture=0.0, haze=0.0),
        TentSnow("heavy", flakes=FEW),
        Snow("heavy"),
    ]
    return [Scene(picture, effects=[look], fps=FPS, seed=seed) for look in looks]


def flight(picture: Array, *, seed: int = 1) -> Scene:
    camera = CameraPath(Camera(DEFAULT_FOCAL * picture.shape[1]), velocity=FLIGHT)
    snow = Snow("heavy", wind=(0.0, 0.0, 0.0))
    return Scene(picture, camera=camera, effects=[snow], fps=FPS, seed=seed)


def _film(film: Path, scenes: list[Scene], frames: int, words: Words) -> list[Path]:
    """Render scenes side by side into a film, with its middle as a still; return both files."""
    still = film.with_suffix(".png")
    size = (sum(scene._shape[1] for scene in scenes), scenes[0]._shape[0])
    with VideoWriter(film, size, FPS) as video, tracing() as trace:
        for number in words.progress("frame")(range(1, frames + 1)):
            image = np.hstack([scene.render(number) for scene in scenes])
            with current.get().stage("encode"):
                video.write(image)
            if number == (frames + 1) // 2:
                write_picture(still, image)
    words.say(f"{film.name}: {stages(trace, frames)}")
    return [film, still]
