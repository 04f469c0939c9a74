"""Films to write and to read back, by our writer and straight from the library."""

from fractions import Fraction

import av
import numpy as np

import flurries as fl
from flurries.io import VideoWriter

EXTENSIONS = ["mp4", "mov", "webm", "mkv"]


def film(count, width=96, height=64):
    """Moving waves whose colors stay within what any video can show."""
    y, x = np.mgrid[:height, :width]
    for n in range(count):
        waves = [np.sin((x + 3 * n) / 17), np.cos((y + 2 * n) / 13), np.sin((x + y - n) / 23)]
        yield np.rint(128 + 70 * np.stack(waves, axis=-1)).astype(np.uint8)


def write(path, frames, fps=24, **options):
    frames = list(frames)
    with VideoWriter(path, frames[0].shape[1::-1], fps, **options) as video:
        for frame in frames:
            video.write(frame)
    return path


def encode(path, codec, frames, *, rate=24, pixels="yuv420p", options=None):
    """A video straight from the library, with settings that our writer does not use."""
    with av.open(str(path), "w") as container:
        stream = None
        for number, frame in enumerate(frames):
            if stream is None:
                if options is None:
                    options = {"mbtree": "0"} if codec == "libx264" else {}
                stream = container.add_stream(codec, rate=rate, options=options)
                stream.codec_context.thread_count = 1
                stream.height, stream.width, stream.pix_fmt = *frame.shape[:2], pixels
            image = av.VideoFrame.from_ndarray(frame, "rgb24").reformat(format=pixels, threads=1)
            image.pts, image.time_base = number, Fraction(1, rate)
            container.mux(stream.encode(image))
        container.mux(stream.encode())
    return path


def snowfall(count: int = 24) -> list[np.ndarray]:
    """Return pictures of a film of falling snow, before a photograph."""
    plate = fl.io.fit(fl.io.photograph("coffee"), (320, 180))
    snow = fl.Snow(density=40.0, wind=(0.6, 0.0, 0.0), color=0.9, shape="round")
    scene = fl.Scene(plate, camera=fl.Camera(384.0), effects=[snow], fps=25, lens=None)
    return [scene.render(t) for t in range(count)]
