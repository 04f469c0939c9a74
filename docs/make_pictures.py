"""Make the pictures of the README and of docs/looks.md from the package as it is.

python docs/make_pictures.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from skimage import data

import flurries as fl
from flurries import demo, io

IMAGES = Path(__file__).parent / "images"
PRESETS = ("light", "moderate", "heavy", "blizzard")


def save(name: str, picture: np.ndarray, width: int) -> None:
    """Write a picture as a JPEG of that width."""
    height = round(width * picture.shape[0] / picture.shape[1])
    IMAGES.mkdir(exist_ok=True)
    io.write_picture(IMAGES / name, io.fit(picture, (width, height)), quality=85)


def three() -> None:
    """The demo's still camera: few flakes, many flakes, few flakes and the texture."""
    scenes = demo.three(demo.photograph(1024))
    save("three.jpg", np.hstack([scene.render(30) for scene in scenes]), 1536)


def flight() -> None:
    """The demo's flying camera: a still, a contact sheet, a difference and a mean of frames."""
    picture = demo.photograph(1024)
    scene = demo.flight(picture)
    frames = [scene.render(t) for t in range(1, 31)]
    save("flight.jpg", frames[14], 768)
    rows = [np.hstack([frames[10 * row + 3 * col] for col in range(3)]) for row in range(2)]
    save("flight_contact.jpg", np.vstack(rows), 1200)
    step = frames[1].astype(float) - frames[0]
    mean = np.mean([frame.astype(float) for frame in frames], axis=0) - picture
    both = [np.clip(128 + 1.5 * step, 0, 255), np.clip(4 * mean, 0, 255)]
    save("flight_motion.jpg", np.hstack(both).astype(np.uint8), 1200)


def looks() -> None:
    """Every preset on a dark, a bright and a busy photograph, 1:1 crops of 1024 px."""
    rows = []
    for photograph in (data.rocket(), data.astronaut(), data.coffee()):
        picture = io.fit(photograph, (1024, 1024))
        region = np.s_[300:700, 300:700]
        scenes = [fl.Scene(None, picture, effects=[fl.Snow.preset(name)]) for name in PRESETS]
        rows.append(np.hstack([scene.render(31, region=region) for scene in scenes]))
    save("looks.jpg", np.vstack(rows), 1600)


def paper() -> None:
    """The paper's own map beside ours."""
    picture = demo.photograph(1024)
    region = np.s_[300:700, 250:750]
    scenes = [fl.Scene(None, picture, effects=[fl.Snow.preset(n)]) for n in ("paper", "moderate")]
    save("paper.jpg", np.hstack([scene.render(31, region=region) for scene in scenes]), 1000)


def sizes() -> None:
    """One look at 512, 1024 and 2160 px: the middles, brought to one size."""
    parts = []
    for size in (512, 1024, 2160):
        scene = fl.Scene(None, demo.photograph(size), effects=[fl.Snow.preset("heavy")])
        low, high = round(0.3 * size), round(0.7 * size)
        parts.append(io.fit(scene.render(31, region=np.s_[low:high, low:high]), (512, 512)))
    save("sizes.jpg", np.hstack(parts), 1536)


if __name__ == "__main__":
    for make in (three, flight, looks, paper, sizes):
        make()
        print(make.__name__)
