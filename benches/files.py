"""How long stills and films take to write, and how large they are: ``python benches/files.py``.

All times of one run, in turns, the shortest of several; a row's ratio is to its own baseline: a PNG
of libpng's sixth level, an EXR of OpenEXR's own level on one thread, neither of them read back; and
x264 alone at the same settings, fed with the same frames converted before. `--only presets` prints
what the presets of x264 make of snow at the rate factor of "high".
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import numpy as np
from skimage import data, metrics, transform

import flurries as fl
from flurries.io import VideoWriter, write_picture
from flurries.io.color import to_linear
from flurries.io.oiio import openimageio

Pixels = Any


def plate(height: int, width: int) -> Pixels:
    """Return a photograph of that size, uint8."""
    photo = transform.resize(data.rocket(), (height, width), order=3)
    return np.clip(255.0 * photo, 0.0, 255.0).astype(np.uint8)


def libpng(path: Path, pixels: Pixels) -> None:
    """Write a PNG as OpenImageIO does by itself."""
    library = openimageio()
    height, width, channels = pixels.shape
    output = library.ImageOutput.create(str(path))
    output.open(str(path), library.ImageSpec(width, height, channels, "uint8"))
    output.write_image(pixels)
    output.close()


def openexr(path: Path, pixels: Pixels) -> None:
    """Write a half EXR as OpenImageIO does by itself, rounded by NumPy."""
    library = openimageio()
    height, width, channels = pixels.shape
    specification = library.ImageSpec(width, height, channels, "half")
    specification.attribute("compression", "zip")
    output = library.ImageOutput.create(str(path))
    output.open(str(path), specification)
    output.write_image(pixels.astype(np.float16))
    output.close()


def best(ways: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Return the shortest time of each way, in ms."""
    found = dict.fromkeys(ways, float("inf"))
    for _ in range(rounds):
        for name, way in ways.items():
            start = time.perf_counter()
            way()
            found[name] = min(found[name], 1e3 * (time.perf_counter() - start))
    return found


def stills(folder: Path, height: int, width: int, rounds: int) -> None:
    """Print what stills of heavy snow cost."""
    frame = fl.Scene(None, plate(height, width), effects=[fl.Snow.preset("heavy")]).render(5)
    light = to_linear(frame, "display")
    ways: dict[str, tuple[Path, Callable[[], object]]] = {}

    def add(name: str, suffix: str, way: Callable[[Path], object]) -> None:
        path = folder / f"{len(ways)}{suffix}"
        ways[name] = path, lambda: way(path)

    add("PNG, libpng", ".png", lambda path: libpng(path, frame))
    add("PNG, ours, verified", ".png", lambda path: write_picture(path, frame))
    add("half EXR, OpenEXR", ".exr", lambda path: openexr(path, light))
    for compression in ("zip", "piz", "dwaa"):
        add(
            f"half EXR, ours, verified, {compression}", ".exr",
            lambda path, kind=compression: write_picture(path, light, compression=kind),
        )  # fmt: skip
    times = best({name: way for name, (_, way) in ways.items()}, rounds)
    base = 0, 1.0
    for name, (path, _) in ways.items():
        size, ms = path.stat().st_size, times[name]
        if name.endswith(("libpng", "OpenEXR")):
            base = size, ms
        print(
            f"| {name}, {width} x {height} | {ms:.0f} | {base[1] / ms:.1f} | {size / base[0]:.2f} |"
        )


def film(folder: Path, count: int, rounds: int) -> None:
    """Print what a film of heavy snow costs, over x264 alone."""
    scene = fl.Scene(None, plate(1080, 1920), effects=[fl.Snow.preset("heavy")], fps=24)
    tent = scene.replace(effects=[fl.TentSnow.preset("heavy")])
    for name, one in (("fl.Snow", scene), ("fl.TentSnow", tent)):
        writer = VideoWriter(folder / "alone.mp4", (1920, 1080), 24)
        # The encoder's frames, before the clock starts.
        with VideoWriter(folder / "first.mp4", (1920, 1080), 24) as first:
            converted = []
            for t in range(count):
                converted.append(first._converted(one.render(t)))
                first.count += 1
            first.count = 0
            first.write(one.render(0))

        def alone(writer: Any = writer, converted: Any = converted) -> None:
            with VideoWriter(folder / "alone.mp4", (1920, 1080), 24) as film:
                for picture in converted:
                    film._encode(picture)

        def whole(one: Any = one) -> None:
            one.write(folder / "whole.mp4", f"0-{count - 1}", overwrite=True)

        times = best({"alone": alone, "whole": whole}, rounds)
        each = times["whole"] / count
        print(f"| film of {name}, x264 alone | {times['alone'] / count:.0f} | 1 | |")
        print(f"| film of {name}, whole | {each:.0f} | {times['whole'] / times['alone']:.2f} | |")


def presets(folder: Path, count: int) -> None:
    """Print time, size and likeness of the same frames by presets of x264; SSIM of their luma."""
    scene = fl.Scene(None, plate(1080, 1920), effects=[fl.Snow.preset("heavy")], fps=24)
    frames = [scene.render(t) for t in range(count)]
    print("| preset | ms | KB | dB | SSIM |\n| --- | --- | --- | --- | --- |")
    for preset in ("slow", "medium", "fast", "faster", "veryfast"):
        path = folder / f"{preset}.mp4"
        pictures = [av.VideoFrame.from_ndarray(frame, format="rgb24") for frame in frames]
        start = time.perf_counter()
        with av.open(str(path), "w") as film:
            stream = film.add_stream("libx264", rate=24, options={"preset": preset, "crf": "16"})
            stream.width, stream.height, stream.pix_fmt = 1920, 1080, "yuv420p"
            for picture in (*pictures, None):
                film.mux(stream.encode(picture))
        each = 1e3 * (time.perf_counter() - start) / count
        with av.open(str(path)) as film:
            shown = [picture.to_ndarray(format="rgb24") for picture in film.decode(video=0)]
        error = np.mean((np.float64(shown) - frames) ** 2)
        grey = [[frame @ (0.299, 0.587, 0.114) for frame in (a[0], a[-1])] for a in (frames, shown)]
        alike = [
            metrics.structural_similarity(a, b, data_range=255.0)
            for a, b in zip(*grey, strict=True)
        ]
        decibels = 10.0 * np.log10(255.0**2 / error)
        size = path.stat().st_size / 1e3
        print(f"| {preset} | {each:.0f} | {size:.0f} | {decibels:.2f} | {np.mean(alike):.3f} |")


def main() -> None:
    """Print tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=("stills", "film", "presets"))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--frames", type=int, default=24)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if given.only == "presets":
            presets(Path(name), min(given.frames, 12))
            return
        print("| what | ms | of the baseline | bytes of it |\n| --- | --- | --- | --- |")
        if given.only != "film":
            stills(Path(name), 1080, 1920, given.rounds)
            stills(Path(name), 2160, 3840, given.rounds)
        if given.only != "stills":
            film(Path(name), given.frames, given.rounds)


if __name__ == "__main__":
    main()
