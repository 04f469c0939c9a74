"""The demo: the two experiments of Langer 2004 on a photograph, as films, stills and an EXR.

(a) A still camera, three pictures side by side as in their Fig. 2: few flakes; many flakes; few
flakes and the texture. (b) A camera that flies forward and upward through heavy snow (their Fig. 3
and 5): the snow streams away from the focus of expansion.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import Array, integer
from flurries.camera.lens import Camera
from flurries.camera.path import CameraPath
from flurries.effects import Snow
from flurries.scene.scene import DEFAULT_FOCAL, Scene
from flurries.trace import Trace, tracing

__all__ = ["flight", "run", "three"]

FPS = 30.0
FEW, MANY = 2000, 16000

# Metres per second, forward and upward; with the fall it puts the focus of expansion into the sky.
FLIGHT = (0.0, -0.3, 5.0)
FLIGHT_FALL = 1.0


def photograph(size: int) -> Array:
    """Return the demo's photograph, (size, size, 3) uint8; it comes inside scikit-image."""
    from flurries.io import fit

    try:
        from skimage import data
    except ImportError:
        raise OSError("the demo's photograph comes inside scikit-image: install that") from None
    picture: Array = data.rocket()  # type: ignore[no-untyped-call]
    return fit(picture, (size, size))


def three(picture: Array, *, seed: int = 1) -> list[Scene]:
    """Return the three scenes of experiment (a): few flakes, many, few with the texture."""
    size = (picture.shape[1], picture.shape[0])
    heavy = {"preset": "heavy"}
    looks = [
        Snow.preset(heavy["preset"], flakes=FEW, texture=0.0, haze=0.0),
        Snow.preset(heavy["preset"], flakes=MANY, texture=0.0, haze=0.0),
        Snow.preset(heavy["preset"], flakes=FEW),
    ]
    return [Scene(size, picture, effects=[look], fps=FPS, seed=seed) for look in looks]


def flight(picture: Array, *, seed: int = 1) -> Scene:
    """Return the scene of experiment (b)."""
    size = (picture.shape[1], picture.shape[0])
    camera = CameraPath(Camera(DEFAULT_FOCAL * size[0]), velocity=FLIGHT)
    # The faster the camera, the farther off the texture must begin for the frame rate to follow it.
    snow = Snow.preset(
        "heavy", fall=FLIGHT_FALL, wind=(0.0, 0.0, 0.0), near_depth=20.0, flakes=20_000
    )
    return Scene(size, picture, camera, [snow], fps=FPS, seed=seed)


def run(folder: str | Path, *, size: int = 1024, frames: int = 60) -> list[Path]:
    """Render the demo and say where the files are and how long each stage took.

    Parameters
    ----------
    folder : str or path
        Made if it is not there; files of an earlier demo are replaced.
    size : int
        Pixels of a square frame.
    frames : int
        Length of the films.

    Returns
    -------
    list of Path
        The files.
    """
    side = integer("size", size, low=64, high=8192)
    count = integer("frames", frames, low=1, high=100_000)
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    picture = photograph(side)
    files = [
        *_three(target, three(picture), count),
        *_flight(target, flight(picture), count),
    ]
    for file in files:
        print(file)
    return files


def _three(folder: Path, scenes: list[Scene], frames: int) -> list[Path]:
    """Render experiment (a); its still is the film's middle."""
    from flurries.io import VideoWriter, write_picture

    film, still = folder / "three.mp4", folder / "three.png"
    width, height = scenes[0].size or (0, 0)
    traces = [Trace() for _ in scenes]
    with VideoWriter(film, (3 * width, height), FPS) as video:
        encode = 0.0
        for number in _bar(range(1, frames + 1), "still camera"):
            images = []
            for scene, total in zip(scenes, traces, strict=True):
                with tracing() as trace:
                    images.append(scene.render(number))
                _gather(total, trace)
            image = np.hstack(images)
            start = time.perf_counter()
            video.write(image)
            encode += time.perf_counter() - start
            if number == (frames + 1) // 2:
                write_picture(still, image)
    for name, total in zip(("few flakes", "many flakes", "few + texture"), traces, strict=True):
        _report(name, total)
    print(f"  {'encoding the film':<17} {1e3 * encode / frames:8.1f} ms a frame", file=sys.stderr)
    return [film, still]


def _flight(folder: Path, scene: Scene, frames: int) -> list[Path]:
    """Render experiment (b), with a still and an EXR whose layers are apart."""
    from flurries.io import VideoWriter, write_picture

    film, still, layers = (folder / f"flight{end}" for end in (".mp4", ".png", ".exr"))
    total, encode = Trace(), 0.0
    assert scene.size is not None
    with VideoWriter(film, scene.size, FPS) as video:
        for number in _bar(range(1, frames + 1), "flying camera"):
            with tracing() as trace:
                image = scene.render(number)
            _gather(total, trace)
            start = time.perf_counter()
            video.write(image)
            encode += time.perf_counter() - start
            if number == (frames + 1) // 2:
                write_picture(still, image)
    _report("flying", total)
    print(f"  {'encoding the film':<17} {1e3 * encode / frames:8.1f} ms a frame", file=sys.stderr)
    middle = (frames + 1) // 2
    scene.replace(space="linear").write(layers, [middle], layers=True, overwrite=True)
    return [film, still, layers]


def _gather(total: Trace, part: Trace) -> None:
    for name, seconds in part.seconds.items():
        total.add(name, seconds)


def _report(title: str, trace: Trace) -> None:
    stages = ", ".join(f"{name} {trace.milliseconds(name):.1f}" for name in trace.seconds)
    whole = sum(trace.milliseconds(name) for name in trace.seconds)
    print(f"  {title:<17} {whole:8.1f} ms a frame: {stages}", file=sys.stderr)


def _bar(frames: Any, title: str) -> Any:
    from tqdm import tqdm

    return tqdm(frames, desc=title, unit="frame", file=sys.stderr, dynamic_ncols=True)
