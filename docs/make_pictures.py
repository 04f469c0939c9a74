"""Make the pictures of the users' pages from the package as it is.

python docs/make_pictures.py [NAME ...]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from skimage import data

import flurries as fl
from flurries import io
from flurries.cli import demo

IMAGES = Path(__file__).parent / "images"
PRESETS = ("light", "moderate", "heavy", "blizzard")


def save(name: str, picture: np.ndarray, width: int) -> None:
    """Write a picture as a JPEG of that width."""
    height = round(width * picture.shape[0] / picture.shape[1])
    IMAGES.mkdir(exist_ok=True)
    io.write_picture(IMAGES / name, io.fit(picture, (width, height)), quality=85)


def flight() -> None:
    """The demo's flying camera: a contact sheet, a difference and a mean of frames."""
    picture = io.photograph("rocket", size=(1024, 1024))
    scene = demo.flight(picture)
    frames = [scene.render(t) for t in range(1, 31)]
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
        scenes = [fl.Scene(picture, effects=[fl.Snow(name)]) for name in PRESETS]
        rows.append(np.hstack([scene.render(31, region=region) for scene in scenes]))
    save("looks.jpg", np.vstack(rows), 1600)


def paper() -> None:
    """The paper's own map, its texture as we map it, and a texture of flakes."""
    picture = io.photograph("rocket", size=(1024, 1024))
    region = np.s_[300:700, 250:650]
    looks = [fl.effects.TentSnow("paper"), fl.effects.TentSnow("heavy"), fl.Snow("heavy")]
    scenes = [fl.Scene(picture, effects=[look]) for look in looks]
    save("paper.jpg", np.hstack([scene.render(31, region=region) for scene in scenes]), 1200)


def sizes() -> None:
    """One look at 512, 1024 and 2160 px: the middles, brought to one size."""
    parts = []
    for size in (512, 1024, 2160):
        scene = fl.Scene(
            io.photograph("rocket", size=(size, size)), effects=[fl.effects.TentSnow("heavy")]
        )
        low, high = round(0.3 * size), round(0.7 * size)
        parts.append(io.fit(scene.render(31, region=np.s_[low:high, low:high]), (512, 512)))
    save("sizes.jpg", np.hstack(parts), 1536)


def severity() -> None:
    """Severities 1 to 5 of snow, rain and mist, and rates of snow and rain."""
    picture = io.fit(data.astronaut(), (512, 512))
    region = np.s_[:300, 100:400]

    def row(effects: list) -> np.ndarray:
        scenes = [fl.Scene(picture, effects=[effect]) for effect in effects]
        return np.hstack([scene.render(3, region=region) for scene in scenes])

    rows = [row([kind(severity=n) for n in range(1, 6)]) for kind in (fl.Snow, fl.Rain, fl.Mist)]
    rows.append(row([fl.Snow(rate=rate) for rate in (0.3, 1.0, 3.0, 8.0, 20.0)]))
    rows.append(row([fl.Rain(rate=rate) for rate in (1.0, 4.0, 10.0, 25.0, 80.0)]))
    save("severity.jpg", np.vstack(rows), 1400)


def rain() -> None:
    """The presets of rain on a dark and a bright photograph, a step between frames, and a mean."""
    rows = []
    region = np.s_[300:700, 300:740]
    for photograph in (data.rocket(), data.astronaut()):
        picture = io.fit(photograph, (1024, 1024))
        scenes = [fl.Scene(picture, effects=[fl.effects.TentRain(name)]) for name in RAINS]
        rows.append(np.hstack([scene.render(31, region=region) for scene in scenes]))
    scene = fl.Scene(
        io.photograph("rocket", size=(1024, 1024)), effects=[fl.effects.TentRain("rain")]
    )
    frames = [scene.render(t, region=region).astype(float) for t in range(1, 31)]
    step = np.clip(128.0 + 3.0 * (frames[1] - frames[0]), 0, 255)
    mean = np.mean(frames, axis=0)
    rows.append(np.hstack([frames[0], step, mean]).astype(np.uint8))
    save("rain.jpg", np.vstack(rows), 1320)


def drops() -> None:
    """The presets of rain made of drops on a dark and a bright photograph, 1:1."""
    rows = []
    for photograph, region in (
        (data.rocket(), np.s_[250:650, 280:780]),
        (data.astronaut(), np.s_[300:700, 250:750]),
    ):
        picture = io.fit(photograph, (1024, 1024))
        scenes = [fl.Scene(picture, effects=[fl.Rain(name)]) for name in RAINS]
        rows.append(np.hstack([scene.render(31, region=region) for scene in scenes]))
    save("drops.jpg", np.vstack(rows), 1500)


def wind() -> None:
    """Traces of flakes: in an even wind, in one that turns over depth, in gusts and swirls."""
    black = np.zeros((640, 640, 3), np.uint8)
    winds = (
        (1.0, 0.0, 0.0),
        fl.Wind((0.0, 0.0, 0.0), profile=[(3.0, (2.5, 0.0, 0.0)), (12.0, (-2.5, 0.0, 0.0))]),
        fl.Wind((1.0, 0.0, 0.0), gusts=1.2, swirl=1.0, scale=5.0),
    )
    parts = []
    for blow in winds:
        snow = fl.effects.TentSnow(wind=blow, flakes=1500, texture=0.0, haze=0.0, fall=1.0)
        scene = fl.Scene(black, effects=[snow])
        frames = [scene.render(t) for t in np.arange(40.0, 52.0, 0.5)]
        parts.append(np.minimum(3.0 * np.max(frames, axis=0), 255.0))
    save("wind.jpg", np.hstack(parts).astype(np.uint8), 1440)


def depth() -> None:
    """A photograph with its depth: heavy snow without it, by tiles, by pixels, and the depth."""
    left, _, disparity = data.stereo_motorcycle()
    # Metres; where nothing was measured, the wall behind.
    measured = np.isfinite(disparity)
    far = 994.978 * 0.193001 / (np.where(measured, disparity, 6.0) + 31.086)
    camera = fl.Camera(994.978)
    snow = {"near_depth": 2.0, "flakes": 6000, "flake_size": (0.004, 0.01)}
    effects = [
        (fl.effects.TentSnow("heavy", **snow), None),
        (fl.effects.TentSnow("heavy", **snow), far),
        (fl.effects.TentSnow("heavy", depth_mode="pixel", **snow), far),
    ]
    pictures = [
        fl.Scene(left, camera=camera, effects=[effect], depth=limit).render(31)
        for effect, limit in effects
    ]
    grey = np.clip(255.0 * (5.5 - far) / 3.5, 0.0, 255.0).astype(np.uint8)
    pictures.append(np.dstack([grey] * 3))
    save("depth.jpg", np.vstack([np.hstack(pictures[:2]), np.hstack(pictures[2:])]), 1400)


def stereo() -> None:
    """Two eyes, the right one's picture on the left: to be looked at cross-eyed."""
    scene = fl.Scene(
        io.photograph("rocket", size=(768, 768)), effects=[fl.effects.TentSnow("heavy")]
    )
    left, right = scene.stereo(31, distance=0.05, convergence=6.0)
    save("stereo.jpg", np.hstack([right, left]), 1200)


def jitter() -> None:
    """Waves that stand still: the mean of 60 frames of snow that falls straight down."""
    black = np.zeros((512, 512, 3), np.float32)
    parts = []
    for spread in (False, True):
        snow = fl.effects.TentSnow("heavy", wind=(0.0, 0.0, 0.0), flakes=0, haze=0.0, jitter=spread)
        scene = fl.Scene(black, effects=[snow])
        frames = [scene.render(t) for t in range(60)]
        parts += [frames[30], 3.0 * np.mean(frames, axis=0)]
    save("jitter.jpg", io.linear_to_srgb(np.hstack(parts).clip(0.0, 1.0)), 1400)


RAINS = ("drizzle", "rain", "downpour")
ALL = (flight, looks, paper, sizes, severity, rain, drops, wind, depth, stereo, jitter)

if __name__ == "__main__":
    for make in ALL:
        if not sys.argv[1:] or make.__name__ in sys.argv[1:]:
            make()
            print(make.__name__)
